"""What only runs of other codes show: breaks in time, divergence, hooks, turned frames, whole trajectories."""

import numpy as np
import pytest
from msgspec.structs import replace

from crosscheck.engines.contract import Effort, Run
from crosscheck.engines.native import NativeEngine
from crosscheck.engines.opensim.engine import MASSLESS
from crosscheck.engines.pinocchio.engine import PinocchioEngine
from crosscheck.engines.registry import engines
from crosscheck.engines.trajectories import continuous
from flexmb.scene.build import SceneBuilder
from flexmb.scene.functions import Constant, Function, Pulse, Sine, SpinUp
from flexmb.scene.schema import BeamStation, Scene, SceneEvent
from tests.crosscheck.engines.peers import installed
from tests.crosscheck.engines.random_scenes import random_scene

RIGID = ("pinocchio", "mujoco")
PEERS = (*RIGID, "drake", "dart", "opensim")
OF_SCIPY = ("dart", "opensim")  # whose efforts are SciPy's tolerances, and whose prescribed motion is its function's
KINDS = ("free", "revolute", "spherical", "prismatic", "universal")


def pushed(function: Function) -> Scene:
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
    engine, scene = installed(name), pushed(Pulse(value=6.0, start_s=0.3, duration_s=0.4))
    path = engine.compile(scene).simulate(Run(np.array([0.0, 0.5, 1.0])), engine.efforts(scene)[-(name not in RIGID)])
    assert path.markers["body"].velocity[:, 3] == pytest.approx([0.0, 0.6, 1.2], abs=1e-12)
    assert path.markers["body"].position[:, 0] == pytest.approx([0.0, 0.06, 0.24 + 0.36], abs=1e-12)
    assert path.times.tolist() == [0.0, 0.5, 1.0]


COARSE = {
    "pinocchio": None, "mujoco": Effort("step", 1e-3, "RK4"), "drake": Effort("step", 1e-3, "runge_kutta5"),
    "dart": Effort("tolerance", 1e-4, "DOP853"), "opensim": Effort("tolerance", 1e-4, "DOP853"),
}  # fmt: skip


@pytest.mark.parametrize("name", PEERS)
def test_divergence_is_a_status_with_the_good_part_kept(name, tmp_path, monkeypatch):
    """A damper of negative resistance: v doubles every 1/1000 s until numbers overflow."""
    monkeypatch.chdir(tmp_path)
    scene = pushed(Constant(value=1.0))
    rail = scene.hinges[0]
    scene = replace(scene, hinges=(replace(rail, translation=replace(rail.translation, damping_Ns_m=-2000.0)),))
    engine, times = installed(name), np.linspace(0.0, 2.0, 21)
    path = engine.compile(scene).simulate(Run(times), COARSE[name] or engine.efforts(scene)[0])
    assert path.status == "diverged" and "t = " in path.message
    assert 1 <= len(path.times) < len(times)
    assert all(np.isfinite(marker.position).all() for marker in path.markers.values())
    assert not list(tmp_path.iterdir()), "no log files"


def test_mujoco_hooks_are_taken_away_again():
    engine = installed("mujoco")
    import mujoco

    scene = pushed(Constant(value=1.0))
    model = engine.compile(scene)
    model.evaluate()
    model.simulate(Run(np.array([0.0, 0.1])), engine.efforts(scene)[0])
    assert mujoco.get_mjcb_control() is None
    assert mujoco.get_mju_user_warning() is None


@pytest.mark.parametrize("name", ["mujoco", "drake"])
def test_what_a_library_would_reject_is_refused(name):
    engine, scene = installed(name), pushed(Constant(value=1.0))
    impossible = replace(scene.bodies[0], inertia_kg_m2=((1.0, 0, 0), (0, 1.0, 0), (0, 0, 3.0)))
    scene = replace(scene, bodies=(impossible,))
    support = engine.supports(scene)
    assert support.kind == "no" and '"body"' in support.reason
    with pytest.raises(ValueError, match="principal moments"):
        engine.compile(scene)


def test_flexible_bodies_are_refused_with_the_way_out():
    section = SceneBuilder("beam").beam("b", length=1.0, elements=4, section=_section(), modes=1)
    scene = section.weld("w", "ground", "b").scene()
    for name in RIGID:
        support = engines()[name].supports(scene)
        assert support.kind == "no" and "finite-segment" in support.reason
    rigid = replace(scene, bodies=(replace(scene.bodies[0], level="rigid"),))
    assert all(engines()[name].supports(rigid).kind == "exact" for name in RIGID)


@pytest.mark.parametrize(("name", "seed"), [
    ("drake", 0), ("drake", 1), ("dart", 0), ("dart", 1), ("dart", 2), ("opensim", 0), ("opensim", 1),
])  # fmt: skip
def test_runs_agree_with_pinocchios(name, seed):
    """Free and ball joints on turned frames of turning bodies, where DART's speeds have axes of their own."""
    rng, apart = np.random.default_rng(300 + seed), {"drake": 1e-8, "dart": 1e-9, "opensim": 1e-9}[name]
    scene = random_scene(rng, ("free", "revolute", *KINDS), driven=True)
    run, engine, fine = Run(np.linspace(0.0, 1.0, 6)), installed(name), Effort("tolerance", 1e-12, "DOP853")
    theirs = installed("pinocchio").compile(scene).simulate(run, fine)
    ours = engine.compile(scene).simulate(run, fine if name in OF_SCIPY else engine.efforts(scene)[-1])
    assert ours.status == "finished", ours.message
    for marker, path in theirs.markers.items():
        assert ours.markers[marker].position == pytest.approx(path.position, abs=apart), marker
        assert ours.markers[marker].velocity == pytest.approx(path.velocity, abs=10.0 * apart), marker
    for mine, other in ((ours.loads, theirs.loads), (ours.drives, theirs.drives)):
        for joint, load in other.items():
            assert mine[joint] == pytest.approx(load, rel=100.0 * apart, abs=100.0 * apart), joint
    if name in OF_SCIPY:
        assert ours.work == pytest.approx(theirs.work, rel=1e-8, abs=1e-8)


@pytest.mark.parametrize("name", PEERS)
def test_prescribed_spin_up_is_followed_to_the_end(name):
    """MuJoCo integrates the prescribed acceleration: the angle must still be the function's after 5 s."""
    scene = (
        SceneBuilder("spin")
        .rigid_body("arm", mass=1.0, com=(1.0, 0, 0), inertia=(0.1, 0.1, 0.1))
        .revolute("drive", "ground", "arm", prescribed=SpinUp(rate=4.0, duration_s=4.0))
        .marker("tip", "arm", offset=(1, 0, 0))
        .scene()
    )
    engine = installed(name)
    path = engine.compile(scene).simulate(Run(np.array([0.0, 2.0, 5.0])), engine.efforts(scene)[-1])
    angle = 4.0 / 4.0 * (2.0**2 / 2 - 2 * (4.0 / (2 * np.pi)) ** 2), 4.0 * (5.0 - 2.0)
    exact = np.column_stack([np.cos(angle), np.sin(angle)])
    # RK4 at the finest step over 5 s: (h w)^4 is 1e-10 or less.
    assert path.markers["tip"].position[1:, :2] == pytest.approx(exact, abs=1e-12 if name in OF_SCIPY else 1e-9)
    assert path.drives["drive"] == pytest.approx(np.array([[0.0], [1.1 * 2.0], [0.0]]), abs=1e-8)


def test_quaternion_signs_are_made_continuous():
    q = np.array([[1.0, 0, 0, 0], [-0.8, -0.6, 0, 0], [0.6, 0.8, 0, 0]])
    assert continuous(q).tolist() == [[1.0, 0, 0, 0], [0.8, 0.6, 0, 0], [0.6, 0.8, 0, 0]]


def _section():
    return BeamStation(
        x_m=0.0, EA_N=1e5, EIy_Nm2=30.0, EIz_Nm2=12.0, GJ_Nm2=9.0, mass_per_length_kg_m=0.7,
        rotary_y_kg_m=1e-4, rotary_z_kg_m=2e-4,
    )  # fmt: skip


def spinning_ball(stiffness: float = 0.0) -> Scene:
    """Turns three times about an oblique axis in 3 s, so that every rotation of its pitch passes a quarter turn."""
    return (
        SceneBuilder("ball")
        .rigid_body("body", mass=1.0, inertia=(0.2, 0.2, 0.2))
        .spherical("joint", "ground", "body", angular_velocity=(1.0, 6.0, 0.5), stiffness=stiffness)
        .marker("tip", "body", offset=(0.0, 0.3, 1.0))
        .scene()
    )


def test_drakes_ball_joint_turns_through_the_pitch_at_which_its_angles_are_singular():
    """A sphere turns uniformly: the rotation is that of |w| t about w."""
    drake, run = installed("drake"), Run(np.linspace(0.0, 3.0, 13))
    path = drake.compile(spinning_ball()).simulate(run, drake.efforts(spinning_ball())[-1])
    assert path.status == "finished", path.message
    w = np.array([1.0, 6.0, 0.5])
    half = np.linalg.norm(w) * run.times / 2.0
    expected = np.column_stack([np.cos(half), np.outer(np.sin(half), w / np.linalg.norm(w))])
    same = np.abs(np.sum(expected * path.markers["tip"].quaternion, axis=1))
    assert same == pytest.approx(np.ones(13), abs=1e-12)
    assert path.markers["tip"].velocity[:, :3] == pytest.approx(np.tile(w, (13, 1)), abs=1e-10)


def test_the_spring_of_drakes_ball_joint_knows_its_turned_frame():
    """Energy stays while the frame is turned, though the spring turns with the joint's whole rotation."""
    scene = spinning_ball(stiffness=40.0)  # 40 N m/rad let it swing to 2.6 rad, short of the jump at half a turn
    drake = installed("drake")
    path = drake.compile(scene).simulate(Run(np.linspace(0.0, 2.0, 21)), drake.efforts(scene)[-1])
    total = sum(path.energy.values())
    assert np.ptp(total) < 1e-9 * total[0]
    assert np.ptp(path.energy["spring"]) > 0.5 * total[0]


def moves_as_in_pinocchio(name: str, turned: dict, *, offset: float, of_place: float, of_acceleration: float) -> None:
    """A body in free flight and one on a ball joint, turned and turning alike, by points far from their origins."""
    builder = SceneBuilder("turned", gravity=(0.3, -9.0, 2.0))
    for body in ("free", "ball"):
        builder.rigid_body(body, mass=2.0, com=(0.1, 0.2, -0.3), inertia=(0.1, 0.2, 0.25))
        builder.marker(body, body, offset=(offset, offset, offset))
    scene = builder.free("free", "ground", "free", **turned).spherical("ball", "ground", "ball", **turned).scene()
    ours, theirs = (installed(each).compile(scene).evaluate() for each in (name, "pinocchio"))
    for body, marker in theirs.markers.items():
        assert ours.markers[body].position == pytest.approx(marker.position, abs=of_place), body
        assert ours.markers[body].acceleration == pytest.approx(marker.acceleration, abs=of_acceleration), body


@pytest.mark.parametrize("angle", [0.0, 1e-6, 2e-5, 3e-4, 9e-4, 1e-2, 1.0, 3.1])
def test_darts_small_rotations_are_as_exact_as_large_ones(angle: float) -> None:
    """DART's exponential map is off by a sixth of the cube of a small angle: by 5e-12 at 3e-4 rad."""
    axis = np.array([0.6, -0.64, 0.48])
    turned = {"quaternion": [np.cos(angle / 2.0), *(np.sin(angle / 2.0) * axis)], "angular_velocity": (1.0, 2.0, 3.0)}
    moves_as_in_pinocchio("dart", turned, offset=10.0, of_place=5e-14, of_acceleration=1e-11)


@pytest.mark.parametrize("name", ["dart", "opensim"])
def test_loads_do_not_pile_up(name: str) -> None:
    """DART keeps external forces until they are cleared: the second look at a state must be as the first."""
    model = installed(name).compile(pushed(Constant(value=6.0)))
    assert [model.evaluate().markers["body"].acceleration[3] for _ in range(3)] == [3.0, 3.0, 3.0]


def test_next_to_massless_bodies_bring_no_warnings_to_the_terminal(capfd: pytest.CaptureFixture[str]) -> None:
    """A universal hinge has a body between its turns, a point mass no inertia, the wheel no mass."""
    scene = (
        SceneBuilder("light")
        .rigid_body("body", mass=1.0, inertia=(0.1, 0.1, 0.2))
        .universal("cross", "ground", "body")
        .point_mass("bead", "body", mass=0.1, directions=[(1, 0, 0)])
        .wheel("wheel", "body", axis=(0, 0, 1), mass=0.0, axial_inertia=0.02, transverse_inertia=0.01)
        .marker("body", "body")
        .scene()
    )
    installed("dart").compile(scene).evaluate()
    out, err = capfd.readouterr()
    assert "arning" not in out + err


def test_what_dart_refuses_is_named() -> None:
    rods = SceneBuilder("loop").rigid_body("rod", mass=1.0, inertia=(1, 1, 1)).revolute("pin", "ground", "rod")
    scene = rods.closure("bolt", "spherical", "ground", "rod").marker("rod", "rod").scene()
    support = installed("dart").supports(scene)
    assert support.kind == "no" and 'closure "bolt": DART closes loops by impulses' in support.reason
    with pytest.raises(ValueError, match="by impulses"):
        installed("dart").compile(scene)


@pytest.mark.parametrize("beside", [0.0, 1e-12, 1e-9, 1e-6, 1e-3])
def test_opensims_angles_of_balls_and_free_flight_may_be_singular(beside: float) -> None:
    """At a second angle of a quarter turn the others are ill-determined, but what they make together is not."""
    half = (0.5 * np.pi - beside) / 2.0
    first = np.array([np.cos(0.4), np.sin(0.4), 0.0, 0.0])
    turn = np.array([np.cos(half), 0.0, np.sin(half), 0.0])
    product = [first[0] * turn[0], first[1] * turn[0], first[0] * turn[2], first[1] * turn[2]]
    turned = {"quaternion": product, "angular_velocity": (1.0, 2.0, 3.0)}
    moves_as_in_pinocchio("opensim", turned, offset=1.0, of_place=1e-14, of_acceleration=1e-12)


def test_opensim_takes_no_inertia_without_mass() -> None:
    """It would drop it in silence: a rotor without mass would cost its drive nothing."""

    def with_rotor(mass: float) -> Scene:
        other = SceneBuilder("rotor").rigid_body("hub", mass=1.0, inertia=(0.1, 0.1, 0.1)).free("free", "ground", "hub")
        other.wheel("rotor", "hub", axis=(0, 0, 1), mass=mass, axial_inertia=0.02, transverse_inertia=0.01, speed=9.0)
        return other.marker("hub", "hub").scene()

    support = installed("opensim").supports(with_rotor(0.0))
    assert support.kind == "no" and 'without mass ("rotor")' in support.reason
    light = with_rotor(MASSLESS)
    ours, theirs = (installed(name).compile(light).evaluate() for name in ("opensim", "pinocchio"))
    assert ours.energy["kinetic"] == pytest.approx(theirs.energy["kinetic"], rel=1e-12) and ours.energy["kinetic"] > 0.8


@pytest.mark.parametrize("mass", [0.0, 0.1])
@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_opensim_drives_what_has_no_inertia(kind: str, mass: float) -> None:
    """Simbody divides by the inertia that a coordinate moves; here that is none, or that of a point on its axis."""
    builder = SceneBuilder("arm", gravity=(0.0, -9.81, 0.0))
    builder.rigid_body("arm", mass=1.0, com=(0.5, 0.0, 0.0), inertia=(0.1, 0.1, 0.1)).revolute("pin", "ground", "arm")
    builder.rigid_body("tool", mass=mass, inertia=(0.0, 0.0, 0.0)).marker("tool", "tool", offset=(0.0, 1.0, 0.0))
    drive = {"axis": (1.0, 0.0, 0.0), "prescribed": Sine(amplitude=0.3, angular_frequency_rad_s=2.0)}
    scene = getattr(builder, kind)("drive", "arm", "tool", parent_position=(1.0, 0.0, 0.0), **drive).scene()
    ours, theirs = (installed(name).compile(scene).evaluate() for name in ("opensim", "pinocchio"))
    assert ours.markers["tool"].acceleration == pytest.approx(theirs.markers["tool"].acceleration, abs=1e-13)
    assert ours.drives["drive"] == pytest.approx(theirs.drives["drive"], abs=1e-14)
    assert ours.loads["pin"] == pytest.approx(theirs.loads["pin"], abs=1e-13)


def finger(damping: float) -> Scene:
    """Two links of a hand, of grams, whose joints have a damper."""
    tree = SceneBuilder("finger", gravity=(0.0, 0.0, -9.81))
    for name, parent, at in (("one", "ground", 0.0), ("two", "one", 0.05)):
        tree.rigid_body(name, mass=0.02, com=(0.02, 0.0, 0.0), inertia=(1e-6, 2e-6, 2e-6))
        place = (at, 0.0, 0.0)
        tree.revolute(
            f"to {name}", parent, name, parent_position=place, axis=(0.0, 1.0, 0.0), damping=damping, rate=0.5
        )
    return tree.marker("tip", "two", offset=(0.05, 0.0, 0.0)).scene()


def test_pinocchio_steps_stiff_joints_by_an_implicit_method() -> None:
    """A hand of 16 such joints took minutes for 0.2 s by an explicit one; weak dampers change nothing."""
    pytest.importorskip("pinocchio")
    pinocchio, run, scene = PinocchioEngine(), Run(np.linspace(0.0, 0.5, 6)), finger(3.0)
    assert {effort.method for effort in pinocchio.efforts_for(finger(1e-4), 0.5)} == {"DOP853"}
    coarse, *_, fine = pinocchio.efforts_for(scene, 0.5)
    assert {coarse.method, fine.method} == {"Radau"}
    latched = replace(scene, events=(SceneEvent(name="stop", watch="time", level=0.1, actions=()),))
    assert {effort.method for effort in pinocchio.efforts_for(latched, 0.5)} == {"DOP853"}
    ours = NativeEngine().compile(scene).simulate(run, Effort("tolerance", 1e-10, "radau5"))
    theirs = pinocchio.compile(scene).simulate(run, fine)
    assert np.abs(ours.markers["tip"].position - theirs.markers["tip"].position).max() < 1e-9
    assert np.ptp(ours.markers["tip"].position[:, 2]) > 1e-5
    model, short = pinocchio.compile(scene), Run(np.linspace(0.0, 0.005, 2))
    implicit, explicit = (
        model.simulate(short, Effort("tolerance", 1e-6, method)).evaluations for method in ("Radau", "DOP853")
    )
    assert 5 * implicit < explicit
