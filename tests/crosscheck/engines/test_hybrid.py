"""Events and controllers in the loop of the peers, which knows nothing of flexmb's own: other codes beside ours."""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

import flexmb as fm
from crosscheck.engines.checked import CheckedEngine
from crosscheck.engines.contract import Effort, Run, Trajectory
from crosscheck.engines.hybrid.loop import HybridMotion
from crosscheck.engines.hybrid.refusals import refusal
from crosscheck.engines.registry import engine
from crosscheck.engines.trajectories import signals_of
from crosscheck.judging.uncertainty import RungSignal, estimate
from crosscheck.judging.verdict import Finding, Signal, compare
from flexmb.scene.schema import Scene
from tests.crosscheck.engines.peers import installed
from tests.repo.project import ROOT

PEERS = ("pinocchio", "mujoco")
FINE = {
    "native": Effort("tolerance", 1e-12, "dop853"),
    "pinocchio": Effort("tolerance", 1e-12, "DOP853"),
    "mujoco": Effort("step", 2.5e-3, "RK4"),
}
TIMES = np.linspace(0.0, 1.0, 41)


def arm() -> fm.SceneBuilder:
    """Two links about oblique axes, a carriage on a rail and a wheel, in a field."""
    return (
        fm.SceneBuilder("arm", gravity=(1.0, -2.0, -6.0))
        .rigid_body("upper", mass=2.0, com=(0.3, 0.0, 0.1), inertia=(0.2, 0.3, 0.25), nodes={"end": (0.7, 0.0, 0.0)})
        .rigid_body("lower", mass=1.0, com=(0.2, 0.1, 0.0), inertia=(0.05, 0.08, 0.07))
        .rigid_body("carriage", mass=0.5, inertia=(0.01, 0.02, 0.03))
        .revolute("shoulder", "ground", "upper", axis=(0.0, 0.6, 0.8), angle=0.3, rate=0.4, damping=0.2)
        .revolute("elbow", "upper", "lower", axis=(0.0, 1.0, 0.0), parent_node="end", angle=-0.6, stiffness=3.0)
        .prismatic("rail", "lower", "carriage", axis=(1.0, 0.0, 0.0), position=0.1, stiffness=40.0, damping=0.3)
        .wheel(
            "wheel", "upper", axis=(1.0, 0.0, 0.0), mass=0.3, axial_inertia=0.02, transverse_inertia=0.01, speed=20.0,
            torque=fm.ControlSignal(source="spin", gain=-0.5),
        )
        .force("push", "carriage", direction=(0.0, 1.0, 0.0), function=fm.ControlSignal(source="both[1]"))
        .torque("twist", "upper", direction=(0.0, 0.0, 1.0), function=fm.ControlSignal(source="both[0]"), frame="node")
        .marker("hand", "carriage", offset=(0.1, 0.2, 0.0))
        .marker("root", "upper")
    )  # fmt: skip


def controlled() -> fm.SceneBuilder:
    """Every kind of sensor that the loop reads and of law that it has, sampled and continuous, in a row."""
    return (
        arm()
        .sense_coordinate("angles", "elbow")
        .sense_coordinate("slip", "rail", quantity="rate")
        .sense_marker("gyro", "hand", "angular_velocity", frame="marker")
        .sense_marker("place", "hand", "position")
        .sense_marker("turn", "hand", "orientation")
        .sense_distance("reach", "root", "hand")
        .sense_time("clock")
        .sense_profile("course", fm.SmoothStep(start_value=0.0, end_value=0.5, start_s=0.21, duration_s=0.4))
        .pid("spin", ["gyro[1]", "course[0]"], kp=0.6, ki=2.0, kd=0.1, lower=-0.3, upper=0.3, period=0.07, delay=0.09)
        .state_space("lag", ["slip", "reach[1]"], A=[[-6.0]], B=[[3.0, 1.0]], C=[[1.0], [0.0]], D=[[0, 0], [0.1, 0]])
        .gain_table("held", ["clock", "place"], points=[0.0, 1.0], values=[1.0, 2.0], period=0.05, offset=0.02)
        .saturation("both", ["held[2]", "lag[0]", "turn[2]"], lower=-0.4, upper=0.4)
    )


def eventful() -> Scene:
    """Every kind of action, at a time, an angle, a rate, and places of the hand."""
    return (
        controlled()
        .event("stop", "rail.translation", -0.05, fm.Impact(coordinate="rail.translation", restitution=0.5))
        .event("elbow latches", "elbow.rotation", -0.55, fm.Latch(coordinate="elbow.rotation"), crossing="rising")
        .event("stiffer", "time", 0.35, fm.Change(path="rail.translation.stiffness_N_m", value=60.0))
        .event("elbow is let go", "time", 0.7, fm.Release(coordinate="elbow.rotation"))
        .event("quieter", "wheel.speed", 20.05, fm.Change(path="spin.kp", value=0.3))
        .event("low", "place[2]", -0.1, fm.Change(path="shoulder.rotation.damping_Nms_rad", value=0.5))
        .scene()
    )


@cache
def run_of(name: str, made: Callable[[], Scene]) -> Trajectory:
    scene = made()
    return installed(name).compile(scene).simulate(Run(TIMES), FINE[name])


def apart(a: Trajectory, b: Trajectory) -> dict[str, float]:
    """By channel that both have, the largest difference relative to the largest number, or to 1."""
    ours, theirs = signals_of(a), signals_of(b)
    return {
        name: float(np.abs(ours[name] - theirs[name]).max() / max(1.0, np.abs(ours[name]).max()))
        for name in ours.keys() & theirs.keys()
    }


@pytest.mark.parametrize("name", PEERS)
def test_all_laws_sensors_and_actions_are_those_of_flexmb(name: str) -> None:
    ours, theirs = run_of("native", eventful), run_of(name, eventful)
    assert ours.status == theirs.status == "finished", theirs.message
    assert [event for event, _ in ours.events] == [event for event, _ in theirs.events]
    assert len({event for event, _ in ours.events}) == len(eventful().events), "every event happens"
    assert np.allclose([t for _, t in ours.events], [t for _, t in theirs.events], rtol=0.0, atol=1e-8)
    assert signals_of(theirs).keys() == signals_of(ours).keys()
    assert max(apart(ours, theirs).values()) < {"pinocchio": 1e-9, "mujoco": 1e-6}[name], apart(ours, theirs)


def rotors() -> Scene:
    """Two discs on one axis, one carried by the other: a latch makes them turn together."""
    return (
        fm.SceneBuilder("rotors")
        .rigid_body("carrier", mass=1.0, inertia=(0.2, 0.2, 0.3))
        .rigid_body("disc", mass=1.0, inertia=(0.3, 0.3, 0.5))
        .revolute("bearing", "ground", "carrier", axis=(0.0, 0.0, 1.0), rate=2.0)
        .revolute("clutch", "carrier", "disc", axis=(0.0, 0.0, 1.0), rate=3.0)
        .event("closes", "clutch.rotation", 1.53, fm.Latch(coordinate="clutch.rotation"))
        .marker("carrier", "carrier")
        .scene()
    )


@pytest.mark.parametrize("name", PEERS)
def test_the_impulse_of_a_latch_keeps_the_angular_momentum(name: str) -> None:
    """0.3 * 2 + 0.5 * 5 = 3.1 N m s, of 0.8 kg m2; energy 0.6 + 6.25 J falls to 3.1^2 / 1.6."""
    run = run_of(name, rotors)
    assert run.events == (("closes", pytest.approx(0.51, abs=1e-12)),)
    rate = run.markers["carrier"].velocity[:, 2]
    assert rate == pytest.approx(np.where(TIMES < 0.51, 2.0, 3.1 / 0.8), abs=1e-12)
    assert run.work == pytest.approx(np.where(TIMES < 0.51, 0.0, 3.1**2 / 1.6 - 6.85), abs=1e-12)
    assert run.drives["clutch"] == pytest.approx(np.zeros((len(TIMES), 1)), abs=1e-12)


def slewing() -> Scene:
    """A body that turns by three wheels, told by a law that flexmb has and the loop has once more."""
    axis, inertia = np.array([1.0, 2.0, 2.0]) / 3.0, np.array([8.0, 9.0, 10.0])
    craft = (
        fm.SceneBuilder("craft")
        .rigid_body("hub", mass=10.0, inertia=inertia)
        .free("orbit", "ground", "hub", angular_velocity=(0.3, -0.2, 0.4))
        .marker("tracker", "hub")
        .sense_marker("orientation", "tracker", "orientation")
        .sense_marker("gyro", "tracker", "angular_velocity", frame="marker")
        .sense_profile("slew", fm.SmoothStep(start_value=0.0, end_value=3.5, start_s=0.1, duration_s=0.8))
        .user_law(
            "attitude", ["orientation", "gyro", "slew"], "flexmb.control.attitude:eigenaxis_slew", outputs=3,
            parameters=[*axis, *(9.0 * inertia), *(5.0 * inertia)], period=0.04, delay=0.02,
        )
    )  # fmt: skip
    for i, direction in enumerate(np.eye(3)):
        torque = fm.ControlSignal(source=f"attitude[{i}]", gain=-1.0)
        craft.wheel(
            f"wheel {i}", "hub", axis=direction, mass=1.0, axial_inertia=0.1, transverse_inertia=0.06, torque=torque
        )
    return craft.scene()


@pytest.mark.parametrize("name", PEERS)
def test_the_law_of_a_slew_is_that_of_flexmb(name: str) -> None:
    ours, theirs = run_of("native", slewing), run_of(name, slewing)
    assert np.linalg.norm(ours.wheel_loads["wheel 0"][-1]) > 1.0
    assert max(apart(ours, theirs).values()) < {"pinocchio": 1e-9, "mujoco": 1e-6}[name], apart(ours, theirs)


def judged(name: str, channel: str, made: Callable[[], Scene]) -> Finding:
    """The verdict on a peer beside native, by the efforts of both."""
    scene, signals = made(), []
    ladders = {
        "native": [Effort("tolerance", rtol, "dop853") for rtol in (1e-8, 1e-10, 1e-12)],
        "pinocchio": [Effort("tolerance", rtol, "DOP853") for rtol in (1e-8, 1e-10, 1e-12)],
    }
    for each in ("native", name):
        runs = [engine(each).compile(scene).simulate(Run(TIMES), effort) for effort in ladders[each]]
        values = [signals_of(run)[channel] for run in runs]
        rungs = [
            RungSignal(effort.value, value, run.evaluations)
            for effort, value, run in zip(ladders[each], values, runs, strict=True)
        ]
        size = float(np.ptp(values[-1], axis=0).max())
        signals.append(Signal(values[-1], estimate(channel, "tolerance", rungs, size), (size,)))
    ours, theirs = signals
    return compare(channel, ours, theirs, goal=1e-7)


def _weak_impulse(plain: Callable[..., None]) -> Callable[..., None]:
    def strike(motion: HybridMotion, name: str, rate: float) -> None:
        """A thousandth of the speed stays."""
        slot = motion._slot(name)
        before = motion._phase.mechanics.state(motion.t, motion.y).v[slot.v]
        plain(motion, name, rate + 1e-3 * (before - rate))

    return strike


def _late_samples(plain: Callable[..., float]) -> Callable[..., float]:
    return lambda motion, law: plain(motion, law) + 1e-4


FAULTS: dict[str, tuple[Callable[[Any], Any], str, Callable[[], Scene]]] = {
    "_strike": (_weak_impulse, "marker:carrier.angular_velocity", rotors),
    "_sample_time": (_late_samples, "marker:tracker.angular_velocity", slewing),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_wrong_impulse_and_a_wrong_sampling_instant_are_noticed(fault: str, monkeypatch: pytest.MonkeyPatch) -> None:
    installed("pinocchio")
    wrong, channel, made = FAULTS[fault]
    assert judged("pinocchio", channel, made).status == "agree"
    monkeypatch.setattr(HybridMotion, fault, wrong(getattr(HybridMotion, fault)))
    assert judged("pinocchio", channel, made).status == "differ"


def test_what_the_loop_has_not_is_refused_by_name() -> None:
    base = arm().state_space("spin", ["angle"], D=[[1.0]]).saturation("both", ["spin", "spin"], lower=-1.0, upper=1.0)
    plain = base.sense_coordinate("angle", "elbow").scene()
    assert refusal(plain) == ""
    caught, resting = fm.Latch(coordinate="elbow.rotation"), fm.Impact(coordinate="rail.translation", rests=True)
    later, law = fm.Change(path="spin.delay_s", value=0.1), "tests.flexmb.control.laws:proportional"
    extended: dict[str, Any] = {
        'sensor "jerk"': fm.MarkerSensor(name="jerk", marker="hand", quantity="acceleration"),
        'sensor "gauge"': fm.LoadSensor(name="gauge", hinge="elbow"),
        'sensor "motor"': fm.DriveSensor(name="motor", coordinate="elbow.rotation"),
        'controller "other"': fm.UserLaw(name="other", inputs=("angle",), function=law, parameters=(1.0,)),
        'event "rests"': fm.SceneEvent(name="rests", watch="rail.translation", level=0.3, actions=(resting,)),
        'event "ends"': fm.SceneEvent(name="ends", watch="time", level=0.3, actions=(fm.EndRun(),)),
        'event "asked"': fm.SceneEvent(name="asked", watch="spin", level=0.3, actions=(caught,)),
        'event "clocked"': fm.SceneEvent(name="clocked", watch="time", level=0.3, actions=(later,)),
    }  # fmt: skip
    for named, item in extended.items():
        scene = fm.SceneBuilder("more").add(
            *plain.bodies, *plain.hinges, *plain.wheels, *plain.loads, *plain.markers, *plain.sensors,
            *plain.controllers, item,
        ).scene()  # fmt: skip
        assert refusal(scene).startswith(named), refusal(scene)
        for peer in PEERS:
            assert CheckedEngine(installed(peer)).supports(scene).kind == "no"


def test_closures_that_open_or_close_are_refused_by_name() -> None:
    opened = fm.load_scene(ROOT / "cases" / "spacecraft" / "separation" / "scene.toml")
    closed = fm.SceneEvent(name="closes", watch="time", level=1.0, actions=(fm.Dock(closure="clamp"),))
    docked = fm.SceneBuilder("closes").add(*opened.bodies, *opened.hinges, *opened.closures, closed).scene()
    for scene in (opened, docked):
        assert refusal(scene).endswith("closures in the loop of the peers are closed at all times")
        for peer in PEERS:
            assert CheckedEngine(installed(peer)).supports(scene).kind == "no"
