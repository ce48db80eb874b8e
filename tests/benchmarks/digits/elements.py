"""Exudyn's beam elements, with the settings of Newton's method that a tuner would try."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
from msgspec.structs import replace

import flexmb as fm
from flexmb.scene.tree import node_frame
from tests.benchmarks.digits.problem import Ladder, Paths
from tests.benchmarks.exudyn_runs import Newton, sections, solved

TOLERANCES = (1e-4, 1e-6)  # of Newton's method, with a Jacobian that is kept as long as it contracts
SPARSE = 12  # elements from which the sparse solver is faster than the dense one
METHODS = "GeneralizedAlpha", "TrapezoidalIndex2"
HALVINGS = 9
LOAD_STEPS = 5


def in_motion(scene: fm.Scene, count: int, times: np.ndarray) -> Iterator[Ladder]:
    """A plane beam as so many elements, by each method and Newton over steps of the time between samples."""
    beam = meshed(scene, count)
    for method in METHODS:
        for newton in (Newton(tolerance, True, count >= SPARSE) for tolerance in TOLERANCES):
            steps = [float(times[1]) / 2.0**k for k in range(HALVINGS)]
            yield Ladder(f"{count}, {method}, {newton}", [partial(run, beam, times, method, newton, h) for h in steps])


def run(beam: Any, times: np.ndarray, method: str, newton: Newton, step: float) -> Paths:
    """Paths (M,T,3) of the markers, in the order of their names; fewer times where Exudyn gave up."""
    states = solved(beam, times, method, newton, step)
    markers = sorted(beam.scene.markers, key=lambda marker: marker.name)
    places = [node_frame(beam.scene.bodies[0], marker.node).position[0] for marker in markers]
    found = sections(beam, states, np.array(places))
    return np.concatenate([found, np.zeros((*found.shape[:2], 1))], axis=2)


def at_rest(scene: fm.Scene, count: int, load: float) -> Iterator[Ladder]:
    """The equilibrium of a plane beam of so many elements under a load that is time, in equal steps of it."""
    yield Ladder(str(count), [partial(rest, meshed(scene, count), load, count >= SPARSE)])


def rest(beam: Any, load: float, sparse: bool) -> Paths:
    """Place (1,1,3) of the tip."""
    shop = beam.shop
    settings = shop.exu.SimulationSettings()
    settings.solution.file.write = False
    solvers = shop.exu.LinearSolverType
    settings.linearSolver.solverType = solvers.EigenSparse if sparse else solvers.EXUdense
    static = settings.staticSolver
    static.verboseMode, static.numberOfLoadSteps, static.loadStepDuration = 0, LOAD_STEPS, load
    static.newton.relativeTolerance = 1e-9
    shop.mbs.SolveStatic(settings, updateInitialValues=False, showHints=False)
    return np.array(shop.mbs.GetNodeOutput(beam.nodes[-1], shop.exu.OutputVariableType.Position))[None, None, :]


def meshed(scene: fm.Scene, count: int) -> Any:
    """The one plane beam of a scene, assembled as so many elements."""
    from crosscheck.engines.exudyn.beams import assemble_beam

    return assemble_beam(replace(scene, bodies=(replace(scene.bodies[0], elements=count),)), count)


def extrapolated(scene: fm.Scene, count: int, times: np.ndarray, steps: tuple[float, float]) -> Callable[[], Paths]:
    """Paths of many elements, extrapolated in the step of a method of second order."""

    def truth() -> Paths:
        beam = meshed(scene, count)
        coarse, fine = (run(beam, times, "GeneralizedAlpha", Newton(1e-8, True, True), step) for step in steps)
        return fine + (fine - coarse) / 3.0

    return truth
