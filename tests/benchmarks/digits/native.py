"""Runs and equilibria by flexmb, over methods and tolerances."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np

import flexmb as fm
from flexmb.integrate.integrator import Method
from tests.benchmarks.digits.problem import Ladder, Paths

TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
HALVINGS = 6
LOAD_STEPS = (1, 2, 5)


def in_motion(label: str, scene: fm.Scene, times: np.ndarray, methods: Sequence[Method]) -> Iterator[Ladder]:
    """The scene by each method over tolerances; a method of equal steps over steps of the time between samples."""
    system = fm.compile(scene)
    for method in methods:
        if method == "generalised_alpha":
            rungs = [partial(run, system, times, method, 1e-4, times[1] / 2.0**k) for k in range(HALVINGS)]
        else:
            rungs = [partial(run, system, times, method, rtol) for rtol in TOLERANCES]
        yield Ladder(f"{label}, {method}", rungs, paths)


def run(
    system: fm.System, times: np.ndarray, method: Method, rtol: float, step: float | None = None
) -> fm.Trajectory:
    fixed = {} if step is None else {"step": step}
    return fm.simulate(system, times[-1], method, samples=times, rtol=rtol, atol=0.1 * rtol, **fixed)


def paths(done: fm.Trajectory) -> Paths:
    """Of the markers, in the order of their names; fewer times where the run did not reach its end."""
    return np.array([done.markers[name].position for name in sorted(done.markers)])


def at_rest(label: str, scene: fm.Scene, load: float) -> Iterator[Ladder]:
    """The equilibrium under a load that is time, in the fewest equal steps of it by which it is found."""
    system = fm.compile(scene)
    yield Ladder(label, [partial(rest, system, load, steps) for steps in LOAD_STEPS], lambda found: found)


def rest(system: fm.System, load: float, steps: int = LOAD_STEPS[-1]) -> Paths:
    """Place (1,1,3) of the tip under the last of equal steps of the load; nothing (0,) where it is not found."""
    state = system.initial_state
    try:
        for at in np.linspace(0.0, load, steps + 1)[1:]:
            state = fm.equilibrium(system, system.state(state.q, state.u, float(at)))
    except fm.EquilibriumError:
        return np.empty(0)
    return system.evaluate(state.t, state.q, state.u).markers["tip"].position[None, None, :]


def converged(scene: fm.Scene, times: np.ndarray, rtol: float = 1e-10) -> Callable[[], Paths]:
    """Paths by Radau IIA and a tight tolerance, for a truth."""
    return lambda: paths(run(fm.compile(scene), times, "radau5", rtol))


def converged_rest(scene: fm.Scene, load: float) -> Callable[[], Paths]:
    """The same of an equilibrium."""
    return lambda: rest(fm.compile(scene), load)
