"""What is Drake's own: turned frames of ball joints, breaks in time, refusals, drives, divergence as a status."""

import sys

import numpy as np
import pytest
from msgspec.structs import replace

from crosscheck.engines.contract import Effort, EngineMissing, Run
from crosscheck.engines.registry import engine
from flexmb.scene.build import SceneBuilder
from flexmb.scene.functions import Constant, Function, Pulse, SpinUp
from flexmb.scene.schema import Scene
from tests.crosscheck.engines.random_scenes import random_scene

pytest.importorskip("pydrake")

DRAKE = engine("drake")


def pushed(function: Function) -> Scene:
    return (
        SceneBuilder("pushed")
        .rigid_body("body", mass=2.0, inertia=(0.1, 0.1, 0.1))
        .prismatic("rail", "ground", "body", axis=(1, 0, 0))
        .force("push", "body", direction=(1, 0, 0), function=function)
        .marker("body", "body")
        .scene()
    )


def spinning_ball(stiffness: float = 0.0) -> Scene:
    """Turns three times about an oblique axis in 3 s, so that every rotation of its pitch passes a quarter turn."""
    return (
        SceneBuilder("ball")
        .rigid_body("body", mass=1.0, inertia=(0.2, 0.2, 0.2))
        .spherical("joint", "ground", "body", angular_velocity=(1.0, 6.0, 0.5), stiffness=stiffness)
        .marker("tip", "body", offset=(0.0, 0.3, 1.0))
        .scene()
    )


def test_a_ball_joint_turns_through_the_pitch_at_which_its_angles_are_singular():
    """A sphere turns uniformly: the rotation is that of |w| t about w."""
    run = Run(np.linspace(0.0, 3.0, 13))
    path = DRAKE.compile(spinning_ball()).simulate(run, DRAKE.efforts(spinning_ball())[-1])
    assert path.status == "finished", path.message
    w = np.array([1.0, 6.0, 0.5])
    half = np.linalg.norm(w) * run.times / 2.0
    expected = np.column_stack([np.cos(half), np.outer(np.sin(half), w / np.linalg.norm(w))])
    same = np.abs(np.sum(expected * path.markers["tip"].quaternion, axis=1))
    assert same == pytest.approx(np.ones(13), abs=1e-12)
    assert path.markers["tip"].velocity[:, :3] == pytest.approx(np.tile(w, (13, 1)), abs=1e-10)


def test_the_spring_of_a_ball_joint_knows_its_turned_frame():
    """Energy stays while the frame is turned, though the spring turns with the joint's whole rotation."""
    scene = spinning_ball(stiffness=40.0)  # 40 N m/rad let it swing to 2.6 rad, short of the jump at half a turn
    path = DRAKE.compile(scene).simulate(Run(np.linspace(0.0, 2.0, 21)), DRAKE.efforts(scene)[-1])
    total = sum(path.energy.values())
    assert np.ptp(total) < 1e-9 * total[0]
    assert np.ptp(path.energy["spring"]) > 0.5 * total[0]


def test_a_pulse_between_samples_costs_no_accuracy():
    """F/m = 3 for 0.3 <= t < 0.7: v = 1.2, x(1) = 0.5*3*0.4^2 + 1.2*0.3."""
    scene = pushed(Pulse(value=6.0, start_s=0.3, duration_s=0.4))
    path = DRAKE.compile(scene).simulate(Run(np.array([0.0, 0.5, 1.0])), DRAKE.efforts(scene)[-1])
    assert path.markers["body"].velocity[:, 3] == pytest.approx([0.0, 0.6, 1.2], abs=1e-12)
    assert path.markers["body"].position[:, 0] == pytest.approx([0.0, 0.06, 0.24 + 0.36], abs=1e-12)


def test_divergence_is_a_status_with_the_good_part_kept():
    """A damper of negative resistance, which Drake's own dampers refuse: v doubles every 1/1000 s."""
    scene = pushed(Constant(value=1.0))
    rail = scene.hinges[0]
    runaway = replace(rail, translation=replace(rail.translation, damping_Ns_m=-2000.0))
    scene = replace(scene, hinges=(runaway,))
    path = DRAKE.compile(scene).simulate(Run(np.linspace(0.0, 2.0, 21)), Effort("step", 1e-3, "runge_kutta5"))
    assert path.status == "diverged" and "t = " in path.message
    assert 1 <= len(path.times) < 21
    assert all(np.isfinite(marker.position).all() for marker in path.markers.values())


def test_prescribed_spin_up_is_followed_to_the_end():
    scene = (
        SceneBuilder("spin")
        .rigid_body("arm", mass=1.0, com=(1.0, 0, 0), inertia=(0.1, 0.1, 0.1))
        .revolute("drive", "ground", "arm", prescribed=SpinUp(rate=4.0, duration_s=4.0))
        .marker("tip", "arm", offset=(1, 0, 0))
        .scene()
    )
    path = DRAKE.compile(scene).simulate(Run(np.array([0.0, 2.0, 5.0])), DRAKE.efforts(scene)[-1])
    angle = 4.0 / 4.0 * (2.0**2 / 2 - 2 * (4.0 / (2 * np.pi)) ** 2), 4.0 * (5.0 - 2.0)
    exact = np.column_stack([np.cos(angle), np.sin(angle)])
    assert path.markers["tip"].position[1:, :2] == pytest.approx(exact, abs=1e-9)
    assert path.drives["drive"] == pytest.approx(np.array([[0.0], [1.1 * 2.0], [0.0]]), abs=1e-8)


@pytest.mark.parametrize("seed", range(2))
def test_runs_agree_with_pinocchios(seed):
    rng = np.random.default_rng(200 + seed)
    scene = random_scene(rng, ("free", "revolute", "spherical", "prismatic", "universal"), driven=True)
    run = Run(np.linspace(0.0, 1.0, 6))
    theirs = engine("pinocchio").compile(scene).simulate(run, Effort("tolerance", 1e-12, "DOP853"))
    ours = DRAKE.compile(scene).simulate(run, DRAKE.efforts(scene)[-1])
    assert ours.status == "finished", ours.message
    for name, path in theirs.markers.items():
        assert ours.markers[name].position == pytest.approx(path.position, abs=1e-8), name
    for name, load in theirs.loads.items():
        assert ours.loads[name] == pytest.approx(load, rel=1e-6, abs=1e-6), name


def test_what_drake_refuses_is_named():
    scene = pushed(Constant(value=1.0))
    (body,) = scene.bodies
    impossible = replace(body, inertia_kg_m2=((1.0, 0, 0), (0, 1.0, 0), (0, 0, 3.0)))
    support = DRAKE.supports(replace(scene, bodies=(impossible,)))
    assert support.kind == "no" and '"body"' in support.reason
    with pytest.raises(ValueError, match="principal moments"):
        DRAKE.compile(replace(scene, bodies=(impossible,)))


def test_a_missing_library_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "pydrake", None)
    with pytest.raises(EngineMissing, match="pip install drake"):
        engine("drake").version()
