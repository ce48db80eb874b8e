"""Exudyn's floating frames of reference against native at equal error, the same points and modes in both codes.

The error is the largest distance of the tip from where it should be, of what bending does to it: the largest distance
from the tip of the same bodies rigid. Every code is held against its own converged answer, because on the boom the two
differ: Exudyn's joints on deforming nodes are other joints. Both run as fast as we could make them, with one sample a
second, each at the fastest of the settings in `SEARCHED` that is accurate enough.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache, partial
from itertools import product
from typing import Any

import numpy as np

import flexmb as fm
from crosscheck.library.find import resolve
from crosscheck.running.plan import variant_scene
from flexmb.integrate.integrator import Method
from flexmb.scene.schema import Scene
from flexmb.surrogate import rigidify
from tests.benchmarks.exudyn_runs import SPECTRAL_RADIUS, Newton, solved
from tests.benchmarks.must_hold.row import Measured, Row
from tests.benchmarks.must_hold.tuning import Setting, equal_error, up_to

GROUP = "Floating frames at equal error"
MARKER = "tip"
LEVELS = (1e-2, 1e-3, 1e-4)
STEPS = tuple(2.0**-k for k in range(3, 11))  # s; they divide the time between two samples
FINEST = (2.0**-9, 2.0**-10)  # of the trapezoidal rule, extrapolated to what Exudyn converges to
METHODS: tuple[Method, ...] = ("dop853", "exponential", "radau5")
TOLERANCES = tuple(10.0**-k for k in range(2, 9))
CONVERGED = 1e-12
TIGHT = 1e-8  # tolerance of Newton's method, by which a step's own error is found
TOLERANCES_OF_NEWTON = (1e-8, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2)
NATIVE_NEWTON = 1e-5  # a longer step with closer iterations costs less here than the other way round
SEARCHED = (
    "Exudyn: `TrapezoidalIndex2` and `GeneralizedAlpha` (spectral radius 0.9), steps of 1/8 s to 1/1024 s by halves, "
    "Newton and modified Newton, their tolerances 1e-8, 1e-6, 1e-5, 1e-4, 1e-3 and 1e-2, dense and sparse linear "
    "solver. Native: `dop853`, `exponential` and `radau5` at relative tolerances of 1e-2 to 1e-8, and "
    "`generalised_alpha` with Exudyn's steps and spectral radius."
)


def rows() -> list[Row]:
    """A second between samples, so that nobody pays for output."""
    cases = (
        ("beam", "spinning beam", "spinning_beam/beam_s_subcritical", 15),
        ("boom", "flexible boom", "deploying_boom/flexible", 10),
    )
    return [
        Row(
            f"ffrf_{name}_{level:g}", GROUP, f"Exudyn, {what}, {seconds} s, error {level:g}", 10.0,
            partial(_row, case, seconds, level), searched=SEARCHED,
        )
        for name, what, case, seconds in cases
        for level in LEVELS
    ]  # fmt: skip


def _row(case: str, seconds: int, level: float) -> Measured:
    native, rival = _settings(case, seconds)
    return equal_error(native, rival, level)


@cache
def _settings(case: str, seconds: int) -> tuple[list[Setting], list[Setting]]:
    """Those of native and of Exudyn, each up to the accuracy that the last of LEVELS demands."""
    (found,) = resolve((case,))
    variant = found.run.variant("full")
    scene, times = variant_scene(found.scene(variant), variant), np.linspace(0.0, seconds, seconds + 1)
    system, rigid = fm.compile(scene), fm.compile(rigidify(scene))
    exact, unbent = (_simulated(each, times, "dop853", CONVERGED) for each in (system, rigid))
    bending = float(np.max(np.linalg.norm(exact - unbent, axis=1)))
    return [*_native(system, times, exact, bending)], [*_exudyn(scene, times, bending)]


def _native(system: fm.System, times: np.ndarray, exact: np.ndarray, bending: float) -> Iterator[Setting]:
    def setting(label: str, method: Method, rtol: float, step: float | None = None) -> Setting:
        run = partial(_simulated, system, times, method, rtol, step)
        return Setting(run, f"{method}, {label}", _error(run(), exact, bending))

    for method in METHODS:
        yield from up_to(LEVELS[-1], (setting(f"rtol {rtol:g}", method, rtol) for rtol in TOLERANCES))
    steps = (setting(f"step {1e3 * step:.3g} ms", "generalised_alpha", NATIVE_NEWTON, step) for step in STEPS)
    yield from up_to(LEVELS[-1], steps)


def _simulated(
    system: fm.System, times: np.ndarray, method: Method, rtol: float, step: float | None = None
) -> np.ndarray:
    """Positions of the tip; fixed steps with Exudyn's spectral radius."""
    radius = None if step is None else SPECTRAL_RADIUS
    done = fm.simulate(
        system, times[-1], method, samples=times, rtol=rtol, atol=1e-2 * rtol, step=step, spectral_radius=radius
    )
    return done.markers[MARKER].position


def _exudyn(scene: Scene, times: np.ndarray, bending: float) -> Iterator[Setting]:
    """Steps by halves; Newton's settings where the step itself is accurate enough for a level for the first time."""
    from crosscheck.engines.exudyn.assembly import assemble

    assembly = assemble(scene)
    reference = ("TrapezoidalIndex2", Newton(TIGHT, True, False))
    coarse, fine = (_tip(assembly, solved(assembly, times, *reference, step)) for step in FINEST)
    exact = fine + (fine - coarse) / 3.0

    def setting(method: str, newton: Newton, step: float) -> Setting:
        run = partial(solved, assembly, times, method, newton, step)
        error = _error(_tip(assembly, run()), exact, bending)
        return Setting(run, f"{method}, step {1e3 * step:.3g} ms, {newton}", error)

    for method in ("TrapezoidalIndex2", "GeneralizedAlpha"):
        left = list(LEVELS)
        for step in STEPS:
            tight = setting(method, reference[1], step)
            yield tight
            reached = [level for level in left if tight.error <= level]
            if reached:
                for tolerance, modified, sparse in product(TOLERANCES_OF_NEWTON, (True, False), (False, True)):
                    yield setting(method, Newton(tolerance, modified, sparse), step)
            left = [level for level in left if level not in reached]
            if not left:
                break


def _tip(assembly: Any, states: Any) -> np.ndarray:
    from crosscheck.engines.exudyn.connections import marker_path
    from crosscheck.engines.exudyn.state import carrier_path

    (tip,) = (marker for marker in assembly.scene.markers if marker.name == MARKER)
    placed = assembly.bodies[tip.body]
    path = carrier_path(assembly, placed.carrier, states)
    return marker_path(path, placed.shape(tip.node), np.array(tip.offset_m)).position


def _error(found: np.ndarray, exact: np.ndarray, bending: float) -> float:
    """Largest distance, of what bending does; infinite for a run that did not reach its end."""
    if found.shape != exact.shape or not np.all(np.isfinite(found)):
        return np.inf
    return float(np.max(np.linalg.norm(found - exact, axis=1)) / bending)
