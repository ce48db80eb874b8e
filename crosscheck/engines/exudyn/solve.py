"""Running Exudyn's solvers, sampling their states, and finding out for ourselves whether a run went well."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter

import numpy as np

from crosscheck.engines.contract import Array, Effort, Status
from crosscheck.engines.exudyn.assembly import Assembly
from crosscheck.engines.exudyn.state import States

IMPLICIT = ("TrapezoidalIndex2", "GeneralizedAlpha")
EXPLICIT = "DOPRI5"
SPECTRAL_RADIUS = 0.9
NEWTON_RELATIVE, NEWTON_ABSOLUTE = 1e-8, 1e-8
"""Exudyn's defaults (1e-8, 1e-10) lie below the round-off floor of stiff bodies: Newton then never ends."""
DEFLECTION_LIMIT = 1e3
"""Largest deflection, in units of the body's length: beyond it a linear modal field means nothing."""


@dataclass(frozen=True)
class Solution:
    """What a run left behind, cut to its good samples."""

    states: States
    status: Status
    message: str
    wall_s: float
    evaluations: int


class Recorder:
    """Collects the state at every sample; Exudyn calls its sensors twice at the start, and the later call counts."""

    def __init__(self, assembly: Assembly) -> None:
        self.data = assembly.shop.mbs.systemData
        self.rows: list[tuple[float, Array, Array, Array, Array]] = []

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


def integrate(assembly: Assembly, times: Array, effort: Effort) -> Solution:
    """Integrate from 0 through `times`; uniform sampling for the implicit solvers."""
    run = _implicit if effort.method in IMPLICIT else _explicit
    start = perf_counter()
    states, evaluations = run(assembly, times, effort)
    wall = perf_counter() - start
    good = _good_samples(assembly, states, times)
    if good == len(times):
        return Solution(states, "finished", "", wall, evaluations)
    last = f"last good output at t = {times[good - 1]:g} s of {times[-1]:g} s"
    return Solution(states.cut(good), "diverged", f"{effort.label}: {last}", wall, evaluations)


def _settings(assembly: Assembly):
    settings = assembly.shop.exu.SimulationSettings()
    settings.solution.file.write = False
    settings.timeIntegration.verboseMode = 0
    settings.timeIntegration.adaptiveStep = False
    return settings


def steps_between_samples(times: Array, step: float) -> int:
    """Number of steps between two samples: the power of two that makes them at most `step`.

    Powers of two keep the ratio of the real steps of two efforts at what their values say. ValueError where the samples
    are not uniform.
    """
    gaps = np.diff(times)
    if np.ptp(gaps) > 1e-9 * times[-1]:
        raise ValueError("Exudyn's fixed-step solvers need uniformly spaced output times")
    return 2 ** max(0, int(np.ceil(np.log2(gaps[0] / step) - 1e-9)))


def _implicit(assembly: Assembly, times: Array, effort: Effort) -> tuple[States, int]:
    """A fixed-step run; a sensor takes the samples, which fall on steps."""
    shop = assembly.shop
    steps = steps_between_samples(times, effort.value) * (len(times) - 1)
    settings = _settings(assembly)
    control = settings.timeIntegration
    control.endTime, control.numberOfSteps = float(times[-1]), steps
    control.newton.relativeTolerance, control.newton.absoluteTolerance = NEWTON_RELATIVE, NEWTON_ABSOLUTE
    control.generalizedAlpha.spectralRadius = SPECTRAL_RADIUS
    settings.solution.sensors.writePeriod = float(times[1])
    if shop.mbs.systemData.SystemSize() > 60:
        settings.linearSolver.solverType = shop.exu.LinearSolverType.EigenSparse
    recorder = Recorder(assembly)

    def sample(mbs, t, sensors, factors, configuration):
        recorder.take(t)
        return [0.0]

    shop.mbs.SetSensorParameter(assembly.sampler, "sensorUserFunction", sample)
    shop.mbs.SolveDynamic(
        settings, solverType=getattr(shop.exu.DynamicSolverType, effort.method), showHints=False,
        showCausingItems=False,
    )  # fmt: skip
    return recorder.states(), shop.mbs.sys["dynamicSolver"].it.newtonStepsCount


def _explicit(assembly: Assembly, times: Array, effort: Effort) -> tuple[States, int]:
    """Error-controlled steps, restarted at every sample: the solver does not stop at output times by itself."""
    shop = assembly.shop
    data, initial = shop.mbs.systemData, shop.exu.ConfigurationType.Initial
    start = data.GetSystemState(initial)
    recorder, settings = Recorder(assembly), _settings(assembly)
    settings.solution.sensors.active = False
    control = settings.timeIntegration
    control.automaticStepSize, control.numberOfSteps = True, 1
    control.relativeTolerance = control.absoluteTolerance = effort.value
    shop.mbs.Assemble()
    recorder.take(0.0)
    steps = 0
    for left, right in zip(times, times[1:], strict=False):
        control.startTime, control.endTime = float(left), float(right)
        finished = shop.mbs.SolveDynamic(
            settings, solverType=shop.exu.DynamicSolverType.DOPRI5, updateInitialValues=True, showHints=False
        )
        steps += shop.mbs.sys["dynamicSolver"].it.currentStepIndex
        if not finished:
            break
        recorder.take(right)
    data.SetSystemState(start, initial)
    return recorder.states(), 6 * steps


def _good_samples(assembly: Assembly, states: States, times: Array) -> int:
    """How many samples to keep: in time, finite, and with deflections that still mean something."""
    count = min(len(states.times), len(times))
    good = np.abs(states.times[:count] - times[:count]) < 1e-6 * times[-1]
    good &= np.all(np.isfinite(states.q[:count]), axis=1) & np.all(np.isfinite(states.v[:count]), axis=1)
    for placed in assembly.bodies.values():
        if placed.carrier.modes is not None:
            first = assembly.shop.mbs.GetNodeODE2Index(placed.carrier.modes)
            eta = states.q[:count, first : first + len(placed.eta)]
            good &= np.abs(eta) @ placed.reach < DEFLECTION_LIMIT
    return int(np.argmin(np.append(good, False)))
