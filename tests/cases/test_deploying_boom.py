"""The deploying boom and the free flexible beam: conservation, the latch's equilibrium, and their folders judged."""

from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace
from scipy.optimize import brentq

from crosscheck.engines.registry import engine
from flexmb.run.simulate import simulate
from flexmb.scene.files import load_scene
from flexmb.scene.schema import Scene
from tests.cases.shipped import noticed_controls

CASES = Path(__file__).parents[2] / "cases"
BOOM = CASES / "deploying_boom"
G = 9.81


def latch_under_gravity(angle: float) -> Scene:
    """The instrument of the rigid case alone, its latch hinge on the ground, gravity along y."""
    scene = load_scene(BOOM / "rigid" / "scene.toml")
    (instrument,) = (body for body in scene.bodies if body.name == "instrument")
    (latch,) = (hinge for hinge in scene.hinges if hinge.name == "latch")
    on_ground = replace(latch, parent="ground", parent_node="origin", rotation=replace(latch.rotation, angle_rad=angle))
    markers = tuple(marker for marker in scene.markers if marker.body == "instrument")
    return replace(scene, bodies=(instrument,), hinges=(on_ground,), markers=markers, gravity_m_s2=(0.0, G, 0.0))


def turned(axis: np.ndarray, angle: float, vector: np.ndarray) -> np.ndarray:
    """Rodrigues: `vector` turned about the unit vector `axis`."""
    across = np.cross(axis, vector)
    return vector + np.sin(angle) * across + (1.0 - np.cos(angle)) * np.cross(axis, across)


@pytest.mark.parametrize("name", ["native", "pinocchio", "mujoco"])
def test_latch_rests_where_spring_and_weight_balance(name):
    """k theta = axis . (r x m g): there nothing accelerates, and the load across the hinge is the weight's reaction."""
    pytest.importorskip({"native": "flexmb", "pinocchio": "pinocchio", "mujoco": "mujoco"}[name])
    scene = latch_under_gravity(0.0)
    body, latch = scene.bodies[0], scene.hinges[0]
    axis, weight = np.array(latch.axis), body.mass_kg * np.array(scene.gravity_m_s2)

    def moment(angle: float) -> float:
        spring = -latch.rotation.stiffness_Nm_rad * (angle - latch.rotation.rest_rad)
        return spring + axis @ np.cross(turned(axis, angle, np.array(body.com_m)), weight)

    rest = brentq(moment, -3.0, 3.0, xtol=1e-15, rtol=1e-15)
    seen = engine(name).compile(latch_under_gravity(rest)).evaluate()
    # the angle is known to a few units of the last digit, so is the moment, divided by a moment of inertia of 0.03
    assert np.max(np.abs(seen.markers["aperture"].acceleration)) < 1e-12 * G
    arm = turned(axis, rest, np.array(body.com_m))
    reaction = np.concatenate([-np.cross(arm, weight), -weight])
    assert seen.loads["latch"] == pytest.approx(reaction, abs=1e-12 * np.linalg.norm(reaction))
    moved = engine(name).compile(latch_under_gravity(rest + 0.01)).evaluate()
    assert np.max(np.abs(moved.markers["aperture"].acceleration)) > 1e-3 * G


@pytest.mark.parametrize(
    "scene",
    [
        "deploying_boom/rigid",
        "free_flying/flexible_beam",
        pytest.param("deploying_boom/flexible", marks=pytest.mark.slow),
    ],
)
def test_momentum_and_energy_balance(scene):
    """Both momenta stay to 1e-10, the energy less the work of drives and damper to 1e-9, at rtol 1e-11."""
    run = simulate(load_scene(CASES / scene / "scene.toml"), 10.0, rtol=1e-11, atol=1e-13)
    assert run.finished
    assert np.max(np.abs(run.energy_drift)) < 1e-9 * np.max(run.energy["kinetic"])
    for part in (slice(0, 3), slice(3, 6)):
        assert np.max(np.abs(run.momentum_drift[:, part])) < 1e-10 * np.linalg.norm(run.momentum[0, part])


def test_boom_ends_straight_at_its_full_length():
    """All prescribed angles end at zero: elbow and tip lie on one line from the shoulder, a member's length apart."""
    scene = load_scene(BOOM / "rigid" / "scene.toml")
    run = simulate(scene, 10.0, rtol=1e-11, atol=1e-13)
    length = sum(node.position_m[0] for body in scene.bodies for node in body.nodes if node.name == "tip")
    elbow, tip = run.markers["elbow"].position[-1], run.markers["tip"].position[-1]
    # fixed frames only: rounding of positions of metres
    assert np.linalg.norm(tip - elbow) == pytest.approx(length / 2, rel=1e-12)


def test_negative_controls_of_the_rigid_boom_are_noticed(tmp_path):
    assert noticed_controls("deploying_boom/rigid", tmp_path) == {
        "third member 1 % too heavy", "second elbow turned the other way", "mounting of the boom transposed",
        "latch spring 1 % too stiff",
    }  # fmt: skip
