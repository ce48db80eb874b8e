"""Exudyn's beam elements, with the settings of Newton's method that a tuner would try."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
from msgspec.structs import replace

import flexmb as fm
from flexmb.scene.schema import BeamBody
from flexmb.scene.tree import node_frame
from tests.benchmarks.digits.problem import Ladder, Paths
from tests.benchmarks.exudyn_runs import Newton, sections, solved

TOLERANCES = (1e-4, 1e-6)  # of Newton's method, with a Jacobian that is kept as long as it contracts
SPARSE = 12  # elements from which the sparse solver is faster than the dense one
METHODS = "GeneralizedAlpha", "TrapezoidalIndex2"
HALVINGS = 9
LOAD_STEPS = (1, 2, 5)


def in_plane(scene: fm.Scene, count: int, times: np.ndarray) -> Iterator[Ladder]:
    """A plane beam as so many elements, by each method and Newton over steps of the time between samples."""
    beam = planar(scene, count)
    yield from _ladders(beam, count, times, METHODS, partial(plane_paths, beam))


def in_space(scene: fm.Scene, count: int, times: np.ndarray) -> Iterator[Ladder]:
    """Beams of a scene as so many elements each, in space."""
    from crosscheck.engines.exudyn.model import ExudynModel

    model = ExudynModel(meshed(scene, count))

    def read(states: Any) -> Paths:
        found = model.markers(states)
        return np.array([found[name].position for name in sorted(found)])

    yield from _ladders(model.assembly, count, times, METHODS, read)


def _ladders(
    assembly: Any, count: int, times: np.ndarray, methods: tuple[str, ...], read: Callable[[Any], Paths]
) -> Iterator[Ladder]:
    steps = [float(times[1]) / 2.0**k for k in range(HALVINGS)]
    for method in methods:
        for tolerance in TOLERANCES:
            newton = Newton(tolerance, True, count >= SPARSE)
            rungs = [partial(solved, assembly, times, method, newton, step) for step in steps]
            yield Ladder(f"{count}, {method}, {newton}", rungs, read)


def plane_paths(beam: Any, states: Any) -> Paths:
    """Of the markers, in the order of their names; fewer times where Exudyn gave up."""
    markers = sorted(beam.scene.markers, key=lambda marker: marker.name)
    places = [node_frame(beam.scene.bodies[0], marker.node).position[0] for marker in markers]
    found = sections(beam, states, np.array(places))
    return np.concatenate([found, np.zeros((*found.shape[:2], 1))], axis=2)


def at_rest(scene: fm.Scene, count: int, load: float) -> Iterator[Ladder]:
    """The equilibrium of a plane beam of so many elements under a load that is time, in equal steps of it."""
    beam = planar(scene, count)

    def read(states: None) -> Paths:
        place = beam.shop.mbs.GetNodeOutput(beam.nodes[-1], beam.shop.exu.OutputVariableType.Position)
        return np.array(place)[None, None, :]

    yield Ladder(str(count), [partial(rest, beam, load, count >= SPARSE, steps) for steps in LOAD_STEPS], read)


def at_rest_in_space(scene: fm.Scene, count: int, load: float) -> Iterator[Ladder]:
    """The same in space."""
    from crosscheck.engines.exudyn.model import ExudynModel
    from crosscheck.engines.exudyn.solve import Recorder

    model = ExudynModel(meshed(scene, count))

    def read(states: None) -> Paths:
        recorder = Recorder(model.assembly)
        recorder.take(load)
        return model.markers(recorder.states())["tip"].position[None]

    rungs = [partial(rest, model.assembly, load, count >= SPARSE, steps) for steps in LOAD_STEPS]
    yield Ladder(str(count), rungs, read)


def rest(assembly: Any, load: float, sparse: bool, steps: int) -> None:
    """Leaves the equilibrium in the system as its state."""
    shop = assembly.shop
    settings = shop.exu.SimulationSettings()
    settings.solution.file.write = False
    solvers = shop.exu.LinearSolverType
    settings.linearSolver.solverType = solvers.EigenSparse if sparse else solvers.EXUdense
    static = settings.staticSolver
    static.verboseMode, static.numberOfLoadSteps, static.loadStepDuration = 0, steps, load
    static.newton.relativeTolerance = 1e-9
    shop.mbs.SolveStatic(settings, updateInitialValues=False, showHints=False)


def planar(scene: fm.Scene, count: int) -> Any:
    """The one plane beam of a scene, assembled as so many elements."""
    from crosscheck.engines.exudyn.beams import assemble_beam

    return assemble_beam(meshed(scene, count), count)


def meshed(scene: fm.Scene, count: int) -> fm.Scene:
    """The scene with so many elements in each beam that is not rigid."""
    bodies = (
        replace(body, elements=count) if isinstance(body, BeamBody) and body.level != "rigid" else body
        for body in scene.bodies
    )
    return replace(scene, bodies=tuple(bodies))


def extrapolated(scene: fm.Scene, count: int, times: np.ndarray, steps: tuple[float, float]) -> Callable[[], Paths]:
    """Paths of many plane elements, extrapolated in the step of a method of second order."""

    def truth() -> Paths:
        beam, newton = planar(scene, count), Newton(1e-8, True, True)
        coarse, fine = (plane_paths(beam, solved(beam, times, "GeneralizedAlpha", newton, step)) for step in steps)
        return fine + (fine - coarse) / 3.0

    return truth
