"""Rows times the Jacobian of a tree: against the Jacobian, and by constants against dual numbers."""

from __future__ import annotations

import numpy as np
import pytest

import flexmb
from flexmb.entry import derivatives, pulled
from flexmb.jain.derivatives.pull_tables import ARMATURE, DAMPING, REST, STIFFNESS
from flexmb.scene.schema import Scene
from flexmb.tables.status import Status
from tests import trees
from tests.benchmarks.rivals import flexible_chain, rigid_chain
from tests.flexmb.connectors import connected_scenes
from tests.flexmb.entry.test_derivatives import RECIPES, T, bound


def distance(scene: Scene, fault: float = 0.0) -> float | None:
    """The distance of the row from that of the Jacobian, relative to what its terms add up to and to the bound of
    rounding; None where there are no accelerations."""
    system = flexmb.compile(scene)
    c, state = system.constants, system.initial_state
    y = np.concatenate([state.q, state.u, [0.0]])
    J, moved = np.full((len(y), len(y)), np.nan), np.full(len(y), np.nan)
    w, x = (make(c, system.nq, system.nu) for make in (derivatives.derivative_workspace, pulled.pull_workspace))
    row = np.random.default_rng(len(y)).normal(size=len(y))
    row[-1] = 0.0
    status = derivatives.jacobian(T, y, J, c, w)
    assert status == pulled.pull(T, y, row, moved, c, x)
    if status != Status.OK:
        return None
    along = np.random.default_rng(0).normal(size=len(y))
    moved *= 1.0 + fault
    size = np.abs(row) @ np.abs(J)
    # Light bodies that turn fast have columns that are what is left of larger terms, see `test_derivatives.errors`.
    size = size + np.max(np.abs(w.sweeps.speed["acceleration"]), initial=0.0) * np.max(np.abs(row))
    each = np.max(np.abs(moved - row @ J) / np.where(size > 0.0, size, 1.0))
    dual = abs(row @ (J @ along) - moved @ along) / (size @ np.abs(along))
    return float(max(each, dual) / bound(system))


@pytest.mark.parametrize("recipe", RECIPES)
def test_random_trees_against_the_jacobian(recipe):
    """Every hinge and level, wheels and loads; and rows and columns are transposes: l.(J x) = (J'l).x."""
    found = [distance(trees.random_scene(seed, RECIPES[recipe])) for seed in range(6)]
    known = [each for each in found if each is not None]
    assert len(known) >= 4 and max(known) <= 1.0


def test_a_planted_error_is_noticed():
    scene = trees.random_scene(0, trees.ARMED_RIGID)
    limit = bound(flexmb.compile(scene))
    assert distance(scene) <= 1.0 < distance(scene, 1e3 * limit)


@pytest.mark.filterwarnings('ignore:scene "connected" is doubtful')
@pytest.mark.parametrize("level", ["full", "linear", "stiffened", "rigid"])
def test_connectors(level):
    assert distance(connected_scenes.everything(level)) <= 1.0


@pytest.mark.parametrize("scene", [rigid_chain(1), rigid_chain(30), flexible_chain(12, 3, "full"),
                                   flexible_chain(9, 10, "ruthless")])  # fmt: skip
def test_chains_longer_than_a_base_point_serves(scene):
    assert distance(scene) <= 1.0


def branched() -> flexmb.SceneBuilder:
    """Rigid bodies with hinges of one and several speeds, springs, dampers and an armature, on a turned root."""
    turned = (0.9, 0.1, -0.3, 0.2)
    turned = tuple(float(each) for each in np.array(turned) / np.linalg.norm(turned))
    builder = flexmb.SceneBuilder("branched", gravity=(0.3, -1.0, -9.0))
    for k, name in enumerate(("hub", "arm", "hand", "fin")):
        builder.rigid_body(name, mass=1.0 + k, com=(0.1 * k, 0.2, -0.1), inertia=(0.3, 0.4, 0.35))
    at = {"parent_position": (0.3, 0.1, 0.2), "parent_quaternion": turned}
    builder.revolute("root", "ground", "hub", axis=(0.6, 0.0, 0.8), angle=0.4, rate=1.0, stiffness=3.0, **at)
    builder.prismatic("slide", "hub", "arm", axis=(0, 1, 0), position=0.2, rate=0.5, damping=0.4, armature=0.2, **at)
    builder.spherical("wrist", "arm", "hand", angular_velocity=(0.2, 1.0, -0.4), **at)
    builder.revolute("tail", "hub", "fin", axis=(0, 1, 0), angle=-0.7, rate=-2.0, stiffness=1.0, rest=0.3, **at)
    return builder


BY_TABLES = [
    "gravity_m_s2.1", "hub.mass_kg", "hand.com_m.1", "fin.inertia_kg_m2.0.0", "arm.inertia_kg_m2.2.2",
    "root.rotation.stiffness_Nm_rad", "tail.rotation.rest_rad", "slide.translation.damping_Ns_m",
    "slide.parent_position_m.0", "wrist.parent_position_m.1", "tail.child_position_m.0",
    "root.parent_quaternion.1", "wrist.parent_quaternion.2", "tail.parent_quaternion.3",
]  # fmt: skip


def test_constants_against_dual_numbers():
    """By masses, moments, springs, gravity, and by places and turns of hinges on the ground and on bodies."""
    from flexmb.sensitivity.adjoint.transposes import by_constants

    system = flexmb.compile(branched().scene())
    parameters = system.parameters(BY_TABLES)
    plant = parameters.plant
    c, state = plant.constants, plant.initial_state
    y = np.concatenate([state.q, state.u, [0.0]])
    exact = parameters.slopes(T, y, np.zeros((len(y), len(BY_TABLES))))
    x, row, moved = pulled.pull_workspace(c, plant.nq, plant.nu), np.zeros(len(y)), np.zeros(len(y))
    row[plant.nq : -1] = np.random.default_rng(1).normal(size=plant.nu)
    assert pulled.pull(T, y, row, moved, c, x) == Status.OK
    found = np.concatenate([by_constants(x.p, c, block.constants) for block in parameters.blocks])[: len(BY_TABLES)]
    assert np.all(np.abs(row @ exact) > 1e-3)
    assert np.max(np.abs(found / (row @ exact) - 1.0)) < 1e-9
    for column in (STIFFNESS, DAMPING, REST, ARMATURE):
        assert np.any(x.p.spring[:, column])
