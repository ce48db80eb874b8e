"""What only runs show: breaks in time, divergence as a status, MuJoCo's process-wide hooks, whole trajectories."""

import numpy as np
import pytest
from msgspec.structs import replace

from crosscheck.engines.contract import Effort, EngineMissing, Run
from crosscheck.engines.registry import engines
from crosscheck.engines.trajectories import continuous
from flexmb.scene.build import SceneBuilder
from flexmb.scene.functions import Constant, Pulse, SpinUp
from flexmb.scene.schema import BeamStation
from tests.crosscheck.engines.random_scenes import random_scene

PEERS = ("pinocchio", "mujoco")


def peer(name):
    engine = engines()[name]
    try:
        engine.version()
    except EngineMissing as missing:
        pytest.skip(str(missing))
    return engine


def pushed(function):
    return (
        SceneBuilder("pushed")
        .rigid_body("body", mass=2.0, inertia=(0.1, 0.1, 0.1))
        .prismatic("rail", "ground", "body", axis=(1, 0, 0))
        .force("push", "body", direction=(1, 0, 0), function=function)
        .marker("body", "body")
        .scene()
    )


@pytest.mark.parametrize("name", PEERS)
def test_a_pulse_between_samples_costs_no_accuracy(name):
    """F/m = 3 for 0.3 <= t < 0.7: v = 1.2, x(1) = 0.5*3*0.4^2 + 1.2*0.3. Polynomial, so round-off is all there is."""
    engine = peer(name)
    scene = pushed(Pulse(value=6.0, start_s=0.3, duration_s=0.4))
    path = engine.compile(scene).simulate(Run(np.array([0.0, 0.5, 1.0])), engine.efforts(scene)[0])
    assert path.markers["body"].velocity[:, 3] == pytest.approx([0.0, 0.6, 1.2], abs=1e-12)
    assert path.markers["body"].position[:, 0] == pytest.approx([0.0, 0.06, 0.24 + 0.36], abs=1e-12)
    assert path.times.tolist() == [0.0, 0.5, 1.0]


@pytest.mark.parametrize("name", PEERS)
def test_divergence_is_a_status_with_the_good_part_kept(name, tmp_path, monkeypatch):
    """A damper of negative resistance: v doubles every 1/1000 s until numbers overflow."""
    monkeypatch.chdir(tmp_path)
    scene = pushed(Constant(value=1.0))
    rail = scene.hinges[0]
    runaway = replace(rail, translation=replace(rail.translation, damping_Ns_m=-2000.0))
    engine = peer(name)
    scene = replace(scene, hinges=(runaway,))
    times = np.linspace(0.0, 2.0, 21)
    effort = Effort("step", 1e-3, "RK4") if name == "mujoco" else engine.efforts(scene)[0]
    path = engine.compile(scene).simulate(Run(times), effort)
    assert path.status == "diverged"
    assert "t = " in path.message
    assert 1 <= len(path.times) < len(times)
    assert all(np.isfinite(marker.position).all() for marker in path.markers.values())
    assert not list(tmp_path.iterdir()), "no log files"


def test_mujoco_hooks_are_taken_away_again():
    engine = peer("mujoco")
    import mujoco

    scene = pushed(Constant(value=1.0))
    model = engine.compile(scene)
    model.evaluate()
    model.simulate(Run(np.array([0.0, 0.1])), engine.efforts(scene)[0])
    assert mujoco.get_mjcb_control() is None
    assert mujoco.get_mju_user_warning() is None


def test_mujoco_refuses_what_its_compiler_would_reject():
    engine = peer("mujoco")
    scene = pushed(Constant(value=1.0))
    (body,) = scene.bodies
    impossible = replace(body, inertia_kg_m2=((1.0, 0, 0), (0, 1.0, 0), (0, 0, 3.0)))
    support = engine.supports(replace(scene, bodies=(impossible,)))
    assert support.kind == "no" and '"body"' in support.reason
    with pytest.raises(ValueError, match="principal moments"):
        engine.compile(replace(scene, bodies=(impossible,)))


def test_flexible_bodies_are_refused_with_the_way_out():
    section = SceneBuilder("beam").beam("b", length=1.0, elements=4, section=_section(), modes=1)
    scene = section.weld("w", "ground", "b").scene()
    for name in PEERS:
        support = engines()[name].supports(scene)
        assert support.kind == "no" and "finite-segment" in support.reason
    rigid = replace(scene, bodies=(replace(scene.bodies[0], level="rigid"),))
    assert all(engines()[name].supports(rigid).kind == "exact" for name in PEERS)


@pytest.mark.parametrize("seed", range(2))
def test_trajectories_agree_within_their_refinement(seed):
    rng = np.random.default_rng(200 + seed)
    scene = random_scene(rng, ("free", "revolute", "spherical", "prismatic", "universal"), driven=True)
    run = Run(np.linspace(0.0, 1.0, 11))
    finest, coarser = {}, {}
    for name in PEERS:
        engine = peer(name)
        model, efforts = engine.compile(scene), engine.efforts(scene)
        coarser[name], finest[name] = (model.simulate(run, effort) for effort in efforts[-2:])
    for marker in finest["mujoco"].markers:
        a, b = (finest[name].markers[marker].position for name in PEERS)
        U = sum(np.abs(finest[n].markers[marker].position - coarser[n].markers[marker].position).max() for n in PEERS)
        assert np.abs(a - b).max() <= U + 1e-11 * np.abs(a).max()
        assert U < 1e-7
    for hinge in finest["mujoco"].loads:
        a, b = (finest[name].loads[hinge] for name in PEERS)
        assert np.abs(a - b).max() <= 1e-6 * max(1.0, np.abs(a).max())


def test_prescribed_spin_up_is_followed_to_the_end():
    """MuJoCo integrates the prescribed acceleration: the angle must still be the function's after 5 s."""
    scene = (
        SceneBuilder("spin")
        .rigid_body("arm", mass=1.0, com=(1.0, 0, 0), inertia=(0.1, 0.1, 0.1))
        .revolute("drive", "ground", "arm", prescribed=SpinUp(rate=4.0, duration_s=4.0))
        .marker("tip", "arm", offset=(1, 0, 0))
        .scene()
    )
    for name in PEERS:
        engine = peer(name)
        path = engine.compile(scene).simulate(Run(np.array([0.0, 2.0, 5.0])), engine.efforts(scene)[-1])
        angle = 4.0 / 4.0 * (2.0**2 / 2 - 2 * (4.0 / (2 * np.pi)) ** 2), 4.0 * (5.0 - 2.0)
        exact = np.column_stack([np.cos(angle), np.sin(angle)])
        # RK4 at the finest step over 5 s: (h w)^4 is 1e-10 or less.
        assert path.markers["tip"].position[1:, :2] == pytest.approx(exact, abs=1e-9)
        assert path.drives["drive"][2] == pytest.approx([0.0], abs=1e-8)


def test_quaternion_signs_are_made_continuous():
    q = np.array([[1.0, 0, 0, 0], [-0.8, -0.6, 0, 0], [0.6, 0.8, 0, 0]])
    assert continuous(q).tolist() == [[1.0, 0, 0, 0], [0.8, 0.6, 0, 0], [0.6, 0.8, 0, 0]]


def _section():
    return BeamStation(
        x_m=0.0, EA_N=1e5, EIy_Nm2=30.0, EIz_Nm2=12.0, GJ_Nm2=9.0, mass_per_length_kg_m=0.7,
        rotary_y_kg_m=1e-4, rotary_z_kg_m=2e-4,
    )  # fmt: skip
