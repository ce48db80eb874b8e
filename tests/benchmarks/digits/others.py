"""Kratos' corotational elements at rest, and MuJoCo's rods in motion: chains of rigid bodies with springs."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

import flexmb as fm
from flexmb.surrogate import finite_segments
from tests.benchmarks.digits.elements import meshed
from tests.benchmarks.digits.native import LOAD_STEPS
from tests.benchmarks.digits.problem import REPEATS, Ladder, Paths

HALVINGS = 9
NEWTON, MOST_ITERATIONS = 1e-9, 60  # as Exudyn's relative tolerance


def at_rest(scene: fm.Scene, count: int, load: float) -> Iterator[Ladder]:
    """The equilibrium of one beam of so many of Kratos' elements under a load that is time, in equal steps of it.

    An element keeps its rotation, so that every repetition begins with a mesh of its own, made before it is timed.
    """
    from crosscheck.engines.kratos.layout import layout
    from crosscheck.engines.kratos.mesh import Mesh

    def prepared() -> list[tuple[Any, Any]]:
        meshes = [Mesh(layout(meshed(scene, count))) for _ in range((REPEATS + 1) * len(LOAD_STEPS))]
        return [(mesh, _static(mesh)) for mesh in meshes]

    def read(mesh: Any) -> Paths:
        node, world = mesh.nodes[mesh.layout.node_at("tip")], mesh.layout.world
        return (world.position + world.rotation @ np.array([node.X, node.Y, node.Z]))[None, None, :]

    meshes = prepared()
    yield Ladder(str(count), [partial(_rest, meshes, load, steps) for steps in LOAD_STEPS], read)


def _static(mesh: Any) -> Any:
    core = mesh.core
    scheme = core.ResidualBasedIncrementalUpdateStaticScheme()
    builder = core.ResidualBasedBlockBuilderAndSolver(core.SkylineLUFactorizationSolver())
    criterion = core.DisplacementCriteria(NEWTON, 1e-14)
    strategy = core.ResidualBasedNewtonRaphsonStrategy(
        mesh.part, scheme, criterion, builder, MOST_ITERATIONS, False, False, True
    )
    strategy.SetEchoLevel(0)
    strategy.Initialize()
    return strategy


def _rest(prepared: list[tuple[Any, Any]], load: float, steps: int) -> Any:
    mesh, strategy = prepared.pop()
    for at in np.linspace(0.0, load, steps + 1)[1:]:
        mesh.part.CloneTimeStep(float(at))
        mesh.load(float(at), -1.0)
        strategy.Solve()
    return mesh


def rods(scene: fm.Scene, count: int, times: np.ndarray) -> Iterator[Ladder]:
    """The beam as so many rigid rods with springs between them, by MuJoCo's RK4 over its step."""
    from crosscheck.engines.contract import Effort, Run
    from crosscheck.engines.registry import engine

    model = engine("mujoco").compile(finite_segments(scene, None, count))

    def run(step: float) -> Any:
        return model.simulate(Run(times), Effort(kind="step", method="RK4", value=step))

    def read(done: Any) -> Paths:
        return np.array([done.markers[name].position for name in sorted(done.markers)])

    yield Ladder(f"{count}, RK4", [partial(run, float(times[1]) / 2.0**k) for k in range(HALVINGS)], read)
