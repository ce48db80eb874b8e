"""Exudyn's fixed steps on an assembled scene, with the settings that a tuner chooses among."""

from __future__ import annotations

from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np

SPECTRAL_RADIUS = 0.9


class Newton(NamedTuple):
    """Relative and absolute tolerance; whether a Jacobian is kept as long as it contracts; the linear solver."""

    tolerance: float
    modified: bool
    sparse: bool

    def __str__(self) -> str:
        kind, solver = "modified Newton" if self.modified else "Newton", "sparse" if self.sparse else "dense"
        return f"{kind} to {self.tolerance:g}, {solver}"


def solved(assembly: Any, times: np.ndarray, method: str, newton: Newton, step: float) -> Any:
    """States at `times` by fixed steps that divide the time between two; fewer where Exudyn gives up."""
    from crosscheck.engines.exudyn.solve import Recorder

    shop = assembly.shop
    settings = shop.exu.SimulationSettings()
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = float(times[1])
    solvers = shop.exu.LinearSolverType
    settings.linearSolver.solverType = solvers.EigenSparse if newton.sparse else solvers.EXUdense
    control = settings.timeIntegration
    control.verboseMode, control.adaptiveStep = 0, False
    control.solverType = getattr(shop.exu.DynamicSolverType, method)
    control.endTime, control.numberOfSteps = float(times[-1]), round(times[-1] / step)
    control.newton.useModifiedNewton = newton.modified
    control.newton.relativeTolerance = control.newton.absoluteTolerance = newton.tolerance
    control.generalizedAlpha.spectralRadius = SPECTRAL_RADIUS
    recorder = Recorder(assembly)

    def sample(mbs, t, sensors, factors, configuration) -> list[float]:
        recorder.take(t)
        return [0.0]

    shop.mbs.SetSensorParameter(assembly.sampler, "sensorUserFunction", sample)
    with suppress(shop.exu.SolverError, shop.exu.ModelError):  # what was recorded so far is too short to be taken
        shop.mbs.SolveDynamic(settings, updateInitialValues=False, showHints=False, showCausingItems=False)
    return recorder.states()


def sections(beam: Any, states: Any, x: np.ndarray) -> np.ndarray:
    """Positions (len(x), T, 2) of the nodes nearest to x (m) of a plane beam of `crosscheck.engines.exudyn.beams`."""
    found = []
    for place in x:
        node = beam.nodes[int(np.argmin(np.abs(beam.stations - place)))]
        first = beam.shop.mbs.GetNodeODE2Index(node)
        at = np.array(beam.shop.mbs.GetNodeParameter(node, "referenceCoordinates"))[:2]
        found.append(states.q[:, first : first + 2] + at)
    return np.array(found)
