"""Exudyn's floating frames of reference against native at equal error, the same points and modes in both codes.

Every code is held against its own converged answer, because on the boom the two differ by 7e-4 of the motion: Exudyn's
joints on deforming nodes are other joints. Exudyn runs as fast as we could make it: trapezoidal rule or
generalised-alpha with the longest step that is accurate enough, modified Newton (two to five times faster here than
Newton with a new Jacobian in every step), the faster one of its linear solvers, and one sample a second.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

import flexmb as fm
from crosscheck.library.find import resolve
from crosscheck.running.plan import variant_scene
from flexmb.scene.schema import Scene
from tests.benchmarks.must_hold.row import Measured, RivalsDiffer, Row, duration, measured
from tests.benchmarks.rivals import turns

GROUP = "Floating frames at equal error"
MARKER = "tip"
LEVELS = (1e-3, 1e-4, 1e-5)  # errors, of the range of the tip's motion; the row is the least favourable of them
STEPS = tuple(2.0**-k for k in range(3, 11))  # s; they divide the time between two samples
FINEST = (2.0**-9, 2.0**-10)  # of the trapezoidal rule, extrapolated to what Exudyn converges to
TOLERANCES = tuple(10.0**-k for k in range(2, 10))
CONVERGED = 1e-12
NEWTON, SPECTRAL_RADIUS = 1e-8, 0.9
ROUNDS = 5


@dataclass(frozen=True)
class Candidate:
    """A setting of one code with its error."""

    run: Callable[[], Any]
    label: str
    error: float


def rows() -> list[Row]:
    """A second between samples, so that nobody pays for output."""
    cases = (
        ("beam", "spinning beam", "spinning_beam/beam_s_subcritical", 15),
        ("boom", "flexible boom", "deploying_boom/flexible", 10),
    )
    return [
        Row(f"ffrf_{name}", GROUP, f"Exudyn, {what}, {seconds} s", 10.0, partial(_equal_error, case, seconds))
        for name, what, case, seconds in cases
    ]


def _equal_error(case: str, seconds: int) -> Measured:
    """The least ratio over LEVELS, each between the fastest settings of both codes that err by no more.

    Raises RivalsDiffer where one of them never gets that close to its own converged answer.
    """
    (found,) = resolve((case,))
    variant = found.run.variant("full")
    scene, times = variant_scene(found.scene(variant), variant), np.linspace(0.0, seconds, seconds + 1)
    codes = [list(code(scene, times)) for code in (_native, _exudyn)]
    ratios = []
    for level in LEVELS:
        native, rival = (_fastest(code, level) for code in codes)
        times_s = turns(native.run, rival.run, rounds=ROUNDS)
        mine, other = np.median(times_s, axis=0)
        detail = f"{duration(mine)} ({native.label}) against {duration(other)} ({rival.label}) at {level:g}"
        ratios.append(measured(times_s[:, 1] / times_s[:, 0], detail))
    return min(ratios, key=lambda ratio: ratio.value)


def _fastest(candidates: list[Candidate], level: float) -> Candidate:
    good = [each for each in candidates if each.error <= level]
    if not good:
        raise RivalsDiffer(f"no setting errs by {level:g} or less")
    return good[int(np.argmin(np.median(turns(*(each.run for each in good), rounds=2), axis=0)))]


def _native(scene: Scene, times: np.ndarray) -> Iterator[Candidate]:
    system = fm.compile(scene)

    def run(**settings) -> np.ndarray:
        return fm.simulate(system, times[-1], samples=times, **settings).markers[MARKER].position

    exact = run(method="dop853", rtol=CONVERGED, atol=1e-2 * CONVERGED)
    for rtol in TOLERANCES:
        candidate = partial(run, method="dop853", rtol=rtol, atol=1e-2 * rtol)
        yield Candidate(candidate, f"dop853, rtol {rtol:g}", _error(candidate(), exact))


def _exudyn(scene: Scene, times: np.ndarray) -> Iterator[Candidate]:
    from crosscheck.engines.exudyn.assembly import assemble

    assembly = assemble(scene)
    coarse, fine = (_tip(assembly, _solved(assembly, times, "TrapezoidalIndex2", step)) for step in FINEST)
    exact = fine + (fine - coarse) / 3.0
    for method in ("TrapezoidalIndex2", "GeneralizedAlpha"):
        for step in STEPS:
            candidate = partial(_solved, assembly, times, method, step)
            error = _error(_tip(assembly, candidate()), exact)
            yield Candidate(candidate, f"{method}, step {1e3 * step:.3g} ms", error)
            if error <= LEVELS[-1]:
                break


def _solved(assembly: Any, times: np.ndarray, method: str, step: float) -> Any:
    """States at `times` by fixed steps; fewer where Exudyn gives up."""
    from crosscheck.engines.exudyn.solve import SPARSE_FROM, Recorder

    shop = assembly.shop
    settings = shop.exu.SimulationSettings()
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = float(times[1])
    if shop.mbs.systemData.SystemSize() > SPARSE_FROM:
        settings.linearSolver.solverType = shop.exu.LinearSolverType.EigenSparse
    control = settings.timeIntegration
    control.verboseMode, control.adaptiveStep = 0, False
    control.solverType = getattr(shop.exu.DynamicSolverType, method)
    control.endTime, control.numberOfSteps = float(times[-1]), round(times[-1] / step)
    control.newton.useModifiedNewton = True
    control.newton.relativeTolerance = control.newton.absoluteTolerance = NEWTON
    control.generalizedAlpha.spectralRadius = SPECTRAL_RADIUS
    recorder = Recorder(assembly)

    def sample(mbs, t, sensors, factors, configuration) -> list[float]:
        recorder.take(t)
        return [0.0]

    shop.mbs.SetSensorParameter(assembly.sampler, "sensorUserFunction", sample)
    with suppress(shop.exu.SolverError, shop.exu.ModelError):  # what was recorded so far is too short to be taken
        shop.mbs.SolveDynamic(settings, updateInitialValues=False, showHints=False, showCausingItems=False)
    return recorder.states()


def _tip(assembly: Any, states: Any) -> np.ndarray:
    from crosscheck.engines.exudyn.markers import marker_path
    from crosscheck.engines.exudyn.state import carrier_path

    (tip,) = (marker for marker in assembly.scene.markers if marker.name == MARKER)
    placed = assembly.bodies[tip.body]
    path = carrier_path(assembly, placed.carrier, states)
    return marker_path(path, placed.shape(tip.node), np.array(tip.offset_m)).position


def _error(found: np.ndarray, exact: np.ndarray) -> float:
    """Largest distance, of the range of the motion; infinite for a run that did not reach its end."""
    if found.shape != exact.shape or not np.all(np.isfinite(found)):
        return np.inf
    return float(np.max(np.abs(found - exact)) / np.max(np.ptp(exact, axis=0)))
