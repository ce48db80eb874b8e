"""SciPy's integrators for peers that have dynamics but no suitable integrator of their own."""

from __future__ import annotations

import time
from collections.abc import Callable
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
from scipy.integrate import solve_ivp

from crosscheck.engines.contract import Effort, Run, Snapshot, Trajectory
from crosscheck.engines.functions_of_time import breaks_between, scene_functions
from crosscheck.engines.linear.matrices import LinearMatrices
from crosscheck.engines.linear.outputs import NOTHING, LinearOutputs, outputs
from crosscheck.engines.trajectories import stack
from flexmb.scene.functions import Function
from flexmb.scene.schema import Scene
from flexmb.typing import Real

# atol/rtol. Angles of elastic chains are about 1e-3 rad: a coarser absolute tolerance lets their fastest modes ring.
_ATOL_RATIO = 1e-3
# Coordinates and speeds are of order 1 to 100: with a smaller atol the error control would react to round-off.
_LEAST_ATOL = 1e-13


def absolute_tolerance(rtol: float) -> float:
    """What goes with a relative tolerance."""
    return max(_ATOL_RATIO * rtol, _LEAST_ATOL)


METHODS = ("DOP853", "RK45", "RK23", "Radau", "BDF", "LSODA")  # of `solve_ivp`
RTOL_LADDER = tuple(Effort("tolerance", rtol, "DOP853") for rtol in (1e-6, 1e-8, 1e-10, 1e-12))


class EquationsOfMotion(Protocol):
    """Equations of motion dy/dt = rate(t, y) of a state y whose last number is the work done so far."""

    def initial(self) -> Real: ...
    def rate(self, t: float, y: Real) -> Real: ...
    def state(self, t: float, y: Real) -> Any:
        """y in the terms of the peer, as its observer needs it."""


class Observer(Protocol):
    def observe(self, t: float, state: Any) -> Snapshot: ...


class Linearised(Protocol):
    def at(self, t: float, state: Any) -> LinearMatrices: ...


class ScipyModel:
    """A scene compiled for a peer that SciPy's DOP853 steps; `linear` gives its derivatives, None if it has none."""

    def __init__(
        self, scene: Scene, dynamics: EquationsOfMotion, observer: Observer, linear: Linearised | None = None
    ) -> None:
        self._dynamics, self._observer, self._linear = dynamics, observer, linear
        self._functions = scene_functions(scene)

    def warm_up(self) -> None:
        """Nothing is compiled; touch the code once so that first-call costs are not timed."""
        self._dynamics.rate(0.0, self._dynamics.initial())

    def evaluate(self) -> Snapshot:
        return self._observed(0.0, self._dynamics.initial())

    def simulate(self, run: Run, effort: Effort) -> Trajectory:
        start = time.perf_counter()
        with np.errstate(over="ignore", invalid="ignore"):  # divergence is a status
            y = self._dynamics.initial()
            states, evaluations, message = integrate(self._dynamics.rate, y, self._functions, run.times, effort)
        wall = time.perf_counter() - start
        samples = [self._observed(t, y) for t, y in zip(run.times, states, strict=False)]
        work = np.array([y[-1] for y in states])
        linear = self._linearised(run, states)
        return stack(
            run.times, samples, message=message, wall_s=wall, evaluations=evaluations, work=work, linear=linear
        )

    def _linearised(self, run: Run, states: list[Real]) -> LinearOutputs:
        at = self._linear
        if at is None:
            return NOTHING
        pairs = zip(run.times, states, strict=False)
        return outputs(run.linear, (at.at(t, self._dynamics.state(t, y)) for t, y in pairs))

    def _observed(self, t: float, y: Real) -> Snapshot:
        return self._observer.observe(t, self._dynamics.state(t, y))


def integrate(
    rate: Callable[[float, Real], Real], y: Real, functions: list[Function], times: Real, effort: Effort
) -> tuple[list[Real], int, str]:
    """States at the sample times reached, evaluations of the right-hand side, and why it stopped early.

    The integrator restarts where a function of time is not smooth, so that no step crosses a kink; at the end of each
    interval the right-hand side takes the limit from the left.
    """
    ends = [times[0], *breaks_between(functions, times[0], times[-1]), times[-1]]
    states = [y]
    evaluations = 0
    for begin, end in pairwise(ends):
        before_end = np.nextafter(end, begin)
        inside = times[(times > begin) & (times <= end)]
        solved = solve_ivp(
            lambda t, y, last=before_end: rate(min(t, last), y),
            (begin, end), y, method=effort.method, t_eval=np.union1d(inside, [end]),
            rtol=effort.value, atol=absolute_tolerance(effort.value),
        )  # fmt: skip
        evaluations += solved.nfev
        good = np.isfinite(solved.y).all(axis=0)
        count = len(good) if good.all() else int(np.argmin(good))
        asked = np.isin(solved.t[:count], inside)
        states += list(solved.y.T[:count][asked])
        if solved.status != 0 or count < len(good):
            stopped = solved.t[count - 1] if count else begin
            return states, evaluations, f"stopped after t = {stopped:g} s: {solved.message}"
        y = solved.y[:, -1]
    return states, evaluations, ""
