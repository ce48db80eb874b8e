"""Running Exudyn's solvers, sampling their states, and checking whether a run succeeded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from crosscheck.engines.contract import Effort, Status
from crosscheck.engines.exudyn.assembly import Assembly
from crosscheck.engines.exudyn.beams import PlanarBeam
from crosscheck.engines.exudyn.kkt import initial_state
from crosscheck.engines.exudyn.state import States
from crosscheck.engines.steps import steps_between_samples
from flexmb.typing import Real

IMPLICIT = ("TrapezoidalIndex2", "GeneralizedAlpha")
EXPLICIT = "DOPRI5"
FIXED_EXPLICIT = ("ExplicitEuler", "RK44")
SPECTRAL_RADIUS = 0.9
NEWTON_SETTINGS = ((1e-10, True), (1e-8, True), (1e-8, False), (1e-6, False), (1e-4, False))
"""Relative and absolute tolerance of Newton's method, and whether it keeps its Jacobian as long as it contracts.

They are tried in turn until a run reaches its end. The modified method stops as soon as it meets its tolerance, which
is relative to the residual that a step begins with, and what it leaves adds up over the steps however short they are:
no U from steps contains it. At 1e-8 that was 3e-6 of the range on a robot of light links, five times U, 1e-4 in loads
of a four-bar, and 2 % in torques of a slider-crank. At 1e-10 errors fall with the step, in 1.0 to 1.1 times the time.
The floor that round-off puts under the residual depends on the stiffness of the bodies; below it Newton never converges
and the run stops early. The full method to 1e-6 leaves errors of 1e-7 in positions, and 8e-7 on the spinning beam of
level `full`; only finely meshed stiff beams need 1e-4.
"""
OF_SPATIAL_BEAMS = ((1e-6, True), (1e-6, False), (1e-4, False))
"""The same where beams are elements in space: in frames of thin strips the floor lies above 1e-8.

The modified method to 1e-6 takes half of the time of the full one; positions of the right-angle frame differ by 3e-7 m
from those of 1e-8. The full method takes the Jacobian by differences: that of the elements leaves out how their loads
turn, and does not converge at steps in which a frame moves far.
"""
DEFLECTION_LIMIT = 1e3
"""Largest deflection, in units of the body's length: beyond it a linear modal field means nothing."""

SPARSE_FROM = 60
"""Number of unknowns from which Exudyn's sparse solver is the faster one."""
FIRST_STEP, SMALLEST_STEP = 1e-3, 1e-5
"""First and smallest error-controlled step, in units of a sample interval.

From a first step that is far too long Exudyn falls to the smallest one and accepts its error, whatever it is.
"""


Counts = tuple[int, int]  # evaluations, or steps of Newton's method, and steps in time


@dataclass(frozen=True)
class ExudynSolution:
    """The result of a run, cut to its good samples."""

    states: States
    status: Status
    message: str
    wall_s: float
    evaluations: int
    steps: int


class Recorder:
    """Collects the state at every sample; Exudyn calls its sensors twice at the start, and the later call is used."""

    def __init__(self, assembly: Assembly | PlanarBeam) -> None:
        self.data = assembly.shop.mbs.systemData
        self.rows: list[tuple[float, Real, Real, Real, Real]] = []

    def take(self, t: float) -> None:
        data = self.data
        if self.rows and self.rows[-1][0] == t:
            self.rows.pop()
        self.rows.append(
            (
                t, np.array(data.GetODE2Coordinates()), np.array(data.GetODE2Coordinates_t()),
                np.array(data.GetAECoordinates()), np.array(data.GetDataCoordinates()),
            )
        )  # fmt: skip

    def states(self) -> States:
        times, q, v, multipliers, stored = (np.array(column) for column in zip(*self.rows, strict=True))
        count = len(times)
        return States(times, q, v, None, multipliers.reshape(count, -1), stored.reshape(count, -1))


def integrate(assembly: Assembly | PlanarBeam, times: Real, effort: Effort) -> ExudynSolution:
    """Integrate from 0 through `times`; uniform sampling for the implicit solvers."""
    run = _fixed if effort.method in IMPLICIT + FIXED_EXPLICIT else _explicit
    if effort.method in IMPLICIT and _starts_accelerated(assembly):
        _tell_accelerations(assembly)
    states, (evaluations, steps), wall = run(assembly, times, effort)
    good = _good_samples(assembly, states, times)
    if good == len(times):
        return ExudynSolution(states, "finished", "", wall, evaluations, steps)
    last = f"last good output at t = {times[good - 1]:g} s of {times[-1]:g} s"
    return ExudynSolution(states.cut(good), "diverged", f"{effort.label}: {last}", wall, evaluations, steps)


def _starts_accelerated(assembly: Assembly | PlanarBeam) -> bool:
    """Whether a prescribed motion begins with an acceleration.

    Exudyn knows offsets and their rates, so its own initial accelerations lack the second derivatives. With the
    trapezoidal rule this error persists with alternating sign, in loads and drives too.
    """
    return any(profile(0.0).acceleration for _, profile in assembly.prescribed)


def _tell_accelerations(assembly: Assembly | PlanarBeam) -> None:
    """Set Exudyn's accelerations at t = 0."""
    accelerations = initial_state(assembly).a
    assert accelerations is not None
    assembly.shop.mbs.systemData.SetODE2Coordinates_tt(accelerations[0], assembly.shop.exu.ConfigurationType.Initial)


def _settings(assembly: Assembly | PlanarBeam):
    settings = assembly.shop.exu.SimulationSettings()
    settings.solution.file.write = False
    settings.timeIntegration.verboseMode = 0
    settings.timeIntegration.adaptiveStep = False
    return settings


def _fixed(assembly: Assembly | PlanarBeam, times: Real, effort: Effort) -> tuple[States, Counts, float]:
    """A fixed-step run; a sensor takes the samples, which fall on steps.

    Only the attempt that is taken counts as its time (s): who knows the scene sets what converges.
    """
    for tolerance, modified in _newton_settings(assembly) if effort.method in IMPLICIT else NEWTON_SETTINGS[:1]:
        start = perf_counter()
        states, counts = _fixed_steps(assembly, times, effort, tolerance, modified)
        wall = perf_counter() - start
        if len(states.times) >= len(times):
            break
    return states, counts, wall


def _newton_settings(assembly: Assembly | PlanarBeam) -> Sequence[tuple[float, bool]]:
    if isinstance(assembly, PlanarBeam):
        return NEWTON_SETTINGS[1:]  # whose floor lies above 1e-10
    return OF_SPATIAL_BEAMS if _in_space(assembly) else NEWTON_SETTINGS


def _in_space(assembly: Assembly | PlanarBeam) -> bool:
    return isinstance(assembly, Assembly) and bool(assembly.elements)


def _fixed_steps(
    assembly: Assembly | PlanarBeam, times: Real, effort: Effort, tolerance: float, modified: bool
) -> tuple[States, Counts]:
    shop = assembly.shop
    settings = _settings(assembly)
    control = settings.timeIntegration
    control.solverType = getattr(shop.exu.DynamicSolverType, effort.method)
    control.endTime = float(times[-1])
    control.numberOfSteps = steps_between_samples(times, effort.value) * (len(times) - 1)
    control.newton.relativeTolerance = control.newton.absoluteTolerance = tolerance
    control.newton.useModifiedNewton = modified
    control.newton.numericalDifferentiation.forODE2 = _in_space(assembly) and not modified
    control.generalizedAlpha.spectralRadius = SPECTRAL_RADIUS
    control.generalizedAlpha.computeInitialAccelerations = not _starts_accelerated(assembly)
    settings.solution.sensors.writePeriod = float(times[1])
    if shop.mbs.systemData.SystemSize() > SPARSE_FROM:
        settings.linearSolver.solverType = shop.exu.LinearSolverType.EigenSparse
    recorder = Recorder(assembly)

    def sample(mbs, t, sensors, factors, configuration):
        recorder.take(t)
        return [0.0]

    shop.mbs.SetSensorParameter(assembly.sampler, "sensorUserFunction", sample)
    _run(assembly, settings)
    made = shop.mbs.sys["dynamicSolver"].it
    return recorder.states(), (made.newtonStepsCount, made.currentStepIndex - 1)


def _run(assembly: Assembly | PlanarBeam, settings, update: bool = False) -> bool:
    """Run Exudyn's solver; False if it fails, by its return value or by an exception."""
    exu = assembly.shop.exu
    try:
        return assembly.shop.mbs.SolveDynamic(
            settings, updateInitialValues=update, showHints=False, showCausingItems=False
        )
    except (exu.SolverError, exu.ModelError):
        return False


def _explicit(assembly: Assembly | PlanarBeam, times: Real, effort: Effort) -> tuple[States, Counts, float]:
    """Error-controlled steps, restarted at every sample: the solver does not stop at output times by itself."""
    begin = perf_counter()
    shop = assembly.shop
    data, initial = shop.mbs.systemData, shop.exu.ConfigurationType.Initial
    start = data.GetSystemState(initial)
    recorder, settings = Recorder(assembly), _settings(assembly)
    settings.solution.sensors.active = False
    control = settings.timeIntegration
    control.solverType = shop.exu.DynamicSolverType.DOPRI5
    control.automaticStepSize, control.numberOfSteps = True, 1
    control.relativeTolerance = control.absoluteTolerance = effort.value
    shop.mbs.Assemble()
    recorder.take(0.0)
    steps, step = 0, FIRST_STEP * float(times[1])
    for left, right in zip(times, times[1:], strict=False):
        control.startTime, control.endTime = float(left), float(right)
        control.initialStepSize, control.minimumStepSize = step, SMALLEST_STEP * float(right - left)
        finished = _run(assembly, settings, update=True)
        taken = shop.mbs.sys["dynamicSolver"].it.currentStepIndex
        steps += taken
        if not finished or taken > 0.5 / SMALLEST_STEP:
            break
        step = float(right - left) / taken
        recorder.take(float(right))
        if not np.all(np.isfinite(recorder.rows[-1][1])):
            break
    data.SetSystemState(start, initial)
    states = recorder.states()
    return states, (6 * steps, steps), perf_counter() - begin


def _good_samples(assembly: Assembly | PlanarBeam, states: States, times: Real) -> int:
    """The number of samples to keep: at the requested times, finite, and with valid deflections."""
    count = min(len(states.times), len(times))
    good = np.abs(states.times[:count] - times[:count]) < 1e-6 * times[-1]
    good &= np.all(np.isfinite(states.q[:count]), axis=1) & np.all(np.isfinite(states.v[:count]), axis=1)
    for columns, reach in assembly.deflection_measures():
        good &= np.abs(states.q[:count, columns]) @ reach < DEFLECTION_LIMIT
    return int(np.argmin(np.append(good, False)))
