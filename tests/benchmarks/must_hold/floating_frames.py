"""Exudyn's floating frames of reference against native at equal error, the same points and modes in both codes.

The error is the largest distance of the tip from where it should be, of what bending does to it: the largest distance
from the tip of the same bodies rigid. Every code is held against its own converged answer, because on the boom the two
differ: Exudyn's joints on deforming nodes are other joints. Both run as fast as we could make them, with one sample a
second. Native: the explicit or an implicit method, or generalised-alpha, which is Exudyn's too. Exudyn: the trapezoidal
rule or generalised-alpha with the longest step that is accurate enough, modified Newton (two to five times faster here
than Newton with a new Jacobian in every step), and the faster one of its linear solvers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np

import flexmb as fm
from crosscheck.library.find import resolve
from crosscheck.running.plan import variant_scene
from flexmb.integrate.integrator import Method
from flexmb.scene.schema import Scene
from flexmb.surrogate import rigidify
from tests.benchmarks.must_hold.row import Measured, RivalsDiffer, Row, duration, measured
from tests.benchmarks.rivals import turns

GROUP = "Floating frames at equal error"
MARKER = "tip"
LEVELS = (1e-2, 1e-3, 1e-4)
STEPS = tuple(2.0**-k for k in range(3, 11))  # s; they divide the time between two samples
FINEST = (2.0**-9, 2.0**-10)  # of the trapezoidal rule, extrapolated to what Exudyn converges to
METHODS: tuple[Method, ...] = ("dop853", "exponential", "radau5")
TOLERANCES = tuple(10.0**-k for k in range(2, 9))
CONVERGED = 1e-12
NEWTON, SPECTRAL_RADIUS = 1e-8, 0.9
NATIVE_NEWTON = 1e-5  # a longer step with closer iterations costs less here than the other way round
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
        Row(
            f"ffrf_{name}_{level:g}", GROUP, f"Exudyn, {what}, {seconds} s, error {level:g}", 10.0,
            partial(_equal_error, case, seconds, level),
        )
        for name, what, case, seconds in cases
        for level in LEVELS
    ]  # fmt: skip


def _equal_error(case: str, seconds: int, level: float) -> Measured:
    """Between the fastest settings of both codes that err by no more.

    Raises RivalsDiffer where one of them never gets that close to its own converged answer.
    """
    native, rival = (_fastest(code, level) for code in _candidates(case, seconds))
    times = turns(native.run, rival.run, rounds=ROUNDS)
    mine, other = np.median(times, axis=0)
    detail = f"{duration(mine)} ({native.label}) against {duration(other)} ({rival.label})"
    return measured(times[:, 1] / times[:, 0], detail)


def _fastest(candidates: Sequence[Candidate], level: float) -> Candidate:
    good = [each for each in candidates if each.error <= level]
    if not good:
        raise RivalsDiffer(f"no setting errs by {level:g} or less")
    return good[int(np.argmin(np.median(turns(*(each.run for each in good), rounds=2), axis=0)))]


@cache
def _candidates(case: str, seconds: int) -> tuple[Sequence[Candidate], Sequence[Candidate]]:
    """Settings of native and of Exudyn, each as accurate as the last of LEVELS demands or less."""
    (found,) = resolve((case,))
    variant = found.run.variant("full")
    scene, times = variant_scene(found.scene(variant), variant), np.linspace(0.0, seconds, seconds + 1)
    system, rigid = fm.compile(scene), fm.compile(rigidify(scene))
    exact, unbent = (_simulated(each, times, "dop853", CONVERGED) for each in (system, rigid))
    bending = float(np.max(np.linalg.norm(exact - unbent, axis=1)))
    return [*_native(system, times, exact, bending)], [*_exudyn(scene, times, bending)]


def _native(system: fm.System, times: np.ndarray, exact: np.ndarray, bending: float) -> Iterator[Candidate]:
    for method in METHODS:
        for rtol in TOLERANCES:
            run = partial(_simulated, system, times, method, rtol)
            error = _error(run(), exact, bending)
            yield Candidate(run, f"{method}, rtol {rtol:g}", error)
            if error <= LEVELS[-1]:
                break
    for step in STEPS:
        run = partial(_simulated, system, times, "generalised_alpha", NATIVE_NEWTON, step)
        error = _error(run(), exact, bending)
        yield Candidate(run, f"generalised_alpha, step {1e3 * step:.3g} ms", error)
        if error <= LEVELS[-1]:
            break


def _simulated(
    system: fm.System, times: np.ndarray, method: Method, rtol: float, step: float | None = None
) -> np.ndarray:
    """Positions of the tip; fixed steps with Exudyn's spectral radius."""
    radius = None if step is None else SPECTRAL_RADIUS
    done = fm.simulate(
        system, times[-1], method, samples=times, rtol=rtol, atol=1e-2 * rtol, step=step, spectral_radius=radius
    )
    return done.markers[MARKER].position


def _exudyn(scene: Scene, times: np.ndarray, bending: float) -> Iterator[Candidate]:
    from crosscheck.engines.exudyn.assembly import assemble

    assembly = assemble(scene)
    coarse, fine = (_tip(assembly, _solved(assembly, times, "TrapezoidalIndex2", step)) for step in FINEST)
    exact = fine + (fine - coarse) / 3.0
    for method in ("TrapezoidalIndex2", "GeneralizedAlpha"):
        for step in STEPS:
            run = partial(_solved, assembly, times, method, step)
            error = _error(_tip(assembly, run()), exact, bending)
            yield Candidate(run, f"{method}, step {1e3 * step:.3g} ms", error)
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


def _error(found: np.ndarray, exact: np.ndarray, bending: float) -> float:
    """Largest distance, of what bending does; infinite for a run that did not reach its end."""
    if found.shape != exact.shape or not np.all(np.isfinite(found)):
        return np.inf
    return float(np.max(np.linalg.norm(found - exact, axis=1)) / bending)
