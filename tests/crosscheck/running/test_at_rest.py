"""A variant that begins in its equilibrium: nothing accelerates there in any engine; what cannot rest is refused."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from crosscheck.engines.registry import engine
from crosscheck.library.find import load_case, shipped_folder
from crosscheck.library.reference import scene_digest
from crosscheck.running.at_rest import at_rest
from crosscheck.running.plan import plan, variant_scene
from flexmb.scene.build import SceneBuilder, linear
from flexmb.scene.functions import Constant, Sine
from flexmb.scene.schema import Scene
from flexmb.surrogate import modal_points
from tests.flexmb.surrogate.beams import beam_scene


def held(function: Constant | Sine) -> Scene:
    """A ball joint with a spring, a point mass on a spring, and a wheel, under gravity and a load."""
    tree = SceneBuilder("held", gravity=(1.0, -2.0, -9.0))
    tree.rigid_body("arm", mass=1.5, com=(0.3, 0.1, 0.0), inertia=(0.05, 0.08, 0.07))
    tree.spherical(
        "ball", "ground", "arm", stiffness=40.0, quaternion=(0.8, 0.0, 0.6, 0.0), angular_velocity=(1.0, 0.0, 2.0)
    )
    spring = linear(stiffness=300.0, damping=1.0, rate=0.7)
    along = ((0.0, 0.6, 0.8),)
    tree.point_mass("bob", "arm", mass=0.2, offset=(0.4, 0.0, 0.0), directions=along, coordinates=(spring,))
    moments = {"axial_inertia": 0.01, "transverse_inertia": 0.006}
    tree.wheel("wheel", "arm", axis=(0.0, 0.0, 1.0), mass=0.3, speed=0.0, angle=0.4, **moments)
    tree.force("push", "arm", node="origin", direction=(0.0, 1.0, 0.0), function=function)
    return tree.marker("arm", "arm", offset=(0.5, 0.0, 0.0)).scene()


@pytest.mark.parametrize("name", ["native", "pinocchio", "mujoco"])
def test_nothing_accelerates_in_the_equilibrium(name: str) -> None:
    scene = at_rest(held(Constant(value=2.0)))
    found = engine(name).compile(scene).evaluate()
    marker = found.markers["arm"]
    assert np.abs(marker.velocity).max() == 0.0
    assert np.abs(marker.acceleration).max() <= 1e-9
    before = engine(name).compile(held(Constant(value=2.0))).evaluate().markers["arm"]
    assert np.abs(before.acceleration).max() > 1.0  # the scene itself is far from it
    assert scene.wheels[0].angle_rad == pytest.approx(0.4)  # it has no spring, and stays


def test_a_flexible_body_sags() -> None:
    scene = modal_points(beam_scene())
    scene = msgspec.structs.replace(scene, gravity_m_s2=(0.0, 0.0, -0.3))
    resting = at_rest(scene)
    assert any(abs(value) > 0.0 for state in resting.modal_states for value in state.coordinates)
    markers = engine("native").compile(resting).evaluate().markers
    assert max(np.abs(each.acceleration).max() for each in markers.values()) <= 1e-7


def test_what_changes_with_time_does_not_rest() -> None:
    with pytest.raises(ValueError, match='"push" changes with time'):
        at_rest(held(Sine(amplitude=1.0, angular_frequency_rad_s=2.0)))


def test_a_body_that_falls_has_no_equilibrium() -> None:
    tree = SceneBuilder("falling", gravity=(0.0, 0.0, -9.81)).rigid_body("body", mass=1.0, inertia=(0.1, 0.1, 0.1))
    with pytest.raises(ValueError, match="equilibrium"):
        at_rest(tree.free("flight", "ground", "body").marker("body", "body").scene())


def test_a_variant_in_its_equilibrium_is_another_model_and_a_fault_has_its_own() -> None:
    case = load_case(shipped_folder() / "linearised" / "sagging_arm")
    variant = case.run.variants[0]
    plain = msgspec.structs.replace(variant, start=msgspec.UNSET)
    assert scene_digest(case, variant) != scene_digest(case, plain)
    assert variant_scene(case.scene(plain), plain) == case.scene(plain)
    _, jobs = plan(case, (), "none:none")
    elbows = {job.role: next(each for each in job.scene.hinges if each.name == "elbow").rotation for job in jobs}
    angles = {role: rotation.angle_rad for role, rotation in elbows.items()}
    assert len({round(angle, 9) for angle in angles.values()}) == len(angles)
    assert all(rotation.rate_rad_s == 0.0 for rotation in elbows.values())
