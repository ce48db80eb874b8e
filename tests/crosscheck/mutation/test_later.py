"""Runs that begin later give the same channels; what is not shifted with them is noticed, one thing after another."""

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import msgspec
import numpy as np
import pytest
from rich.console import Console

from crosscheck.engines.answers import checked_run
from crosscheck.engines.checked import CheckedEngine
from crosscheck.engines.contract import Effort, Engine, Run
from crosscheck.engines.native import NativeEngine
from crosscheck.engines.pinocchio.engine import PinocchioEngine
from crosscheck.library.find import load_case, shipped_folder
from crosscheck.mutation.invariance_runs import VERDICTS, InvarianceVerdict, run_invariances
from crosscheck.mutation.invariances import NotApplicable
from crosscheck.mutation.invariances.counterpart import Channels
from crosscheck.mutation.invariances.later import LATER, START_S
from crosscheck.terminal.mutation import print_invariances
from flexmb.control.attitude import eigenaxis_slew
from flexmb.jit.foreign import as_python
from flexmb.run.channels import channels_of, distance, signal_range
from flexmb.scene.bodies import RigidBody
from flexmb.scene.control import CoordinateSensor, Pid, ProfileSensor, StateSpace, TimeSensor
from flexmb.scene.events import Change, Latch, SceneEvent
from flexmb.scene.functions import Constant, ControlSignal, Pulse, Ramp, Sine, SmoothStep, SpinUp, Table
from flexmb.scene.hinges import AngularCoordinate, LinearCoordinate, Revolute
from flexmb.scene.schema import Load, Marker, PointMass, Scene, Wheel
from flexmb.typing import Real
from tests.crosscheck.sessions import CASE, PROVIDER, run_here

TIMES = np.linspace(0.0, 1.0, 11)
SAME = 1e-9  # of a channel's range; the tolerance is 1e-10
ROD = RigidBody(name="", mass_kg=1.0, com_m=(0.3, 0.0, 0.0), inertia_kg_m2=((0.1, 0, 0), (0, 0.2, 0), (0, 0, 0.2)))
Y = (0.0, 1.0, 0.0)


def rod(name: str) -> RigidBody:
    return msgspec.structs.replace(ROD, name=name)


def passive(*loads: Load) -> Scene:
    """Two arms, the first driven by a sine, the second pushed."""
    drive = AngularCoordinate(prescribed_rad=Sine(amplitude=0.3, angular_frequency_rad_s=4.0, phase_rad=0.2))
    return Scene(
        name="passive",
        gravity_m_s2=(0.0, 0.0, -9.81),
        bodies=(rod("upper"), rod("lower")),
        hinges=(
            Revolute(name="shoulder", parent="ground", child="upper", axis=Y, rotation=drive),
            Revolute(name="elbow", parent="upper", child="lower", parent_position_m=(0.6, 0.0, 0.0), axis=Y),
        ),
        loads=loads,
        markers=(Marker(name="lower", body="lower"),),
    )


def pushed(kind: str) -> Scene:
    functions = {
        "ramp": Ramp(rate=2.0, start_s=0.2),
        "smooth_step": SmoothStep(start_value=0.0, end_value=2.0, start_s=0.1, duration_s=0.5),
        "pulse": Pulse(value=2.0, start_s=0.2, duration_s=0.3),
    }
    return passive(Load(name="push", body="lower", type="torque", direction=Y, function=functions[kind]))


@cache
def active() -> Scene:
    """An arm under a sampled servo that follows a profile, with a push that an event on time switches on."""
    course = SmoothStep(start_value=0.0, end_value=0.5, start_s=0.1, duration_s=0.6)
    motor = AngularCoordinate(angle_rad=0.2, torque_Nm=ControlSignal(source="servo"))
    return Scene(
        name="active",
        bodies=(rod("arm"),),
        hinges=(Revolute(name="pivot", parent="ground", child="arm", axis=Y, rotation=motor),),
        loads=(Load(name="push", body="arm", type="torque", direction=Y, function=Constant(value=0.0)),),
        sensors=(CoordinateSensor(name="angle", of="pivot"), ProfileSensor(name="course", function=course)),
        controllers=(Pid(name="servo", inputs=("angle", "course[0]"), kp=3.0, kd=0.5, period_s=0.1, delay_s=0.03),),
        events=(
            SceneEvent(
                name="switch", watch="time", level=0.47,
                actions=(Change(path="push.function", value=Ramp(rate=1.0, start_s=0.4)),),
            ),
        ),
        markers=(Marker(name="arm", body="arm", offset_m=(0.6, 0.0, 0.0)),),
    )  # fmt: skip


def run_of(scene: Scene, starts_s: float, engine: Engine | None = None) -> Channels:
    engine = engine or NativeEngine()
    times = starts_s + TIMES
    method = "dop853" if isinstance(engine, NativeEngine) else "DOP853"
    done = engine.compile(scene).simulate(Run(times), Effort("tolerance", 1e-10, method))
    assert done.status == "finished", done.message
    return channels_of(checked_run(done, times, scene))


def strangers(scene: Scene, other: Scene, engine: Engine | None = None) -> list[str]:
    """Channels in which a scene begun later is another than the scene."""
    true, told = run_of(scene, 0.0, engine), run_of(other, START_S, engine)
    assert set(told) == set(true)

    def excess(name: str) -> Real:
        return np.max(distance(name, told[name], true[name])) - SAME * max(signal_range(name, true[name]), 1.0)

    return [name for name in true if excess(name) > 0.0]


def test_initial_values_that_repeat_a_profile_are_left_to_it() -> None:
    """At t = 0 the profile of the scene begun later is elsewhere: of a hinge, a wheel and a point mass."""
    sine = Sine(amplitude=0.3, angular_frequency_rad_s=4.0)
    angle = AngularCoordinate(rate_rad_s=1.2, prescribed_rad=sine)
    scene = Scene(
        name="repeated",
        bodies=(rod("arm"),),
        hinges=(Revolute(name="pivot", parent="ground", child="arm", axis=Y, rotation=angle),),
        wheels=(
            Wheel(name="wheel", body="arm", axis=Y, mass_kg=0.5, axial_inertia_kg_m2=0.2, transverse_inertia_kg_m2=0.1,
                  speed_rad_s=1.2, prescribed_rad=sine),
        ),
        point_masses=(
            PointMass(name="slosh", body="arm", mass_kg=0.2, directions=((1.0, 0.0, 0.0),),
                      coordinates=(LinearCoordinate(rate_m_s=1.2, prescribed_m=sine),)),
        ),
        markers=(Marker(name="arm", body="arm", offset_m=(0.6, 0.0, 0.0)),),
    )  # fmt: skip
    assert strangers(scene, LATER.of(scene).scene) == []


@pytest.mark.parametrize("kind", ["ramp", "smooth_step", "pulse"])
def test_functions_of_time_begin_with_the_run(kind: str) -> None:
    counterpart = LATER.of(pushed(kind))
    assert counterpart.starts_s == START_S
    assert strangers(pushed(kind), counterpart.scene) == []


def test_a_peer_may_begin_later_too() -> None:
    assert strangers(pushed("smooth_step"), LATER.of(pushed("smooth_step")).scene, PinocchioEngine()) == []


def test_samples_profiles_and_events_begin_with_the_run() -> None:
    assert strangers(active(), LATER.of(active()).scene) == []


def _still_drive(scene: Scene) -> Scene:
    return msgspec.structs.replace(scene, hinges=pushed("pulse").hinges)


def _still_load(scene: Scene) -> Scene:
    return msgspec.structs.replace(scene, loads=pushed("pulse").loads)


@pytest.mark.parametrize("spoil", [_still_drive, _still_load])
def test_a_function_that_is_not_shifted_is_noticed(spoil: Callable[[Scene], Scene]) -> None:
    assert strangers(pushed("pulse"), spoil(LATER.of(pushed("pulse")).scene))


@pytest.mark.parametrize("part", ["sensors", "controllers", "events"])
def test_feedback_and_events_that_are_not_shifted_are_noticed(part: str) -> None:
    spoilt = msgspec.structs.replace(LATER.of(active()).scene, **{part: getattr(active(), part)})
    assert strangers(active(), spoilt)


def test_what_cannot_be_shifted_says_why() -> None:
    rotation = AngularCoordinate(prescribed_rad=SpinUp(rate=1.0, duration_s=1.0))
    hinge = Revolute(name="hinge", parent="ground", child="arm", rotation=rotation)
    scene = Scene(name="spun up", bodies=(rod("arm"),), hinges=(hinge,))
    with pytest.raises(NotApplicable, match="spin_up"):
        LATER.of(scene)
    table = Table(times_s=(0.0, 0.2, 0.4, 0.6, 0.8, 1.0), values=(0.0, 1.0, -1.0, 0.5, 1.0, 0.0))
    with pytest.raises(NotApplicable, match="does not cover t = 0"):
        LATER.of(msgspec.structs.replace(active(), sensors=(ProfileSensor(name="course", function=table),)))
    clock = TimeSensor(name="clock")
    law = StateSpace(name="law", inputs=("clock",), D=((1.0,),))
    with pytest.raises(NotApplicable, match='reads the time by sensor "clock"'):
        LATER.of(msgspec.structs.replace(active(), sensors=(*active().sensors, clock), controllers=(law,)))
    late = SceneEvent(name="e", watch="time", level=0.5, actions=(Change(path="push.function.start_s", value=1.0),))
    with pytest.raises(NotApplicable, match="belongs to the clock"):
        LATER.of(msgspec.structs.replace(active(), events=(late,)))


def test_an_event_on_a_sensor_of_time_is_shifted_and_one_on_a_coordinate_is_not() -> None:
    events = tuple(
        SceneEvent(name=watch, watch=watch, level=0.5, actions=(Latch(coordinate="pivot.rotation"),))
        for watch in ("clock", "pivot.rotation")
    )
    scene = msgspec.structs.replace(active(), sensors=(*active().sensors, TimeSensor(name="clock")), events=events)
    assert [event.level for event in LATER.of(scene).scene.events] == [0.5 + START_S, 0.5]


def test_an_engine_that_begins_at_zero_is_not_asked() -> None:
    class AtZero(NativeEngine):
        takes = ("connectors",)

    assert CheckedEngine(NativeEngine(), START_S).supports(passive()).kind == "exact"
    assert CheckedEngine(AtZero()).supports(passive()).kind == "exact"
    refused = CheckedEngine(AtZero(), START_S).supports(passive())
    assert refused.kind == "no" and "begins all runs at t = 0" in refused.reason


def test_laws_of_this_distribution_make_no_use_of_the_time() -> None:
    inputs, parameters = np.linspace(0.1, 0.9, 9), np.linspace(0.2, 1.0, 9)
    outputs = np.zeros((2, 3))
    for row, time in zip(outputs, (0.0, START_S), strict=True):
        as_python(eigenaxis_slew)(time, inputs, np.zeros(0), parameters, row, np.zeros(0))
    assert np.array_equal(*outputs) and np.any(outputs)


def invariances(out: Path, engine: str) -> Sequence[InvarianceVerdict]:
    """Those of the small case, run in this process."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("crosscheck.mutation.invariance_runs.run_planned", run_here)
        return run_invariances([load_case(CASE)], out, engine=engine, provider=PROVIDER)


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("invariances")


@pytest.fixture(scope="module")
def verdicts(out: Path) -> dict[str, InvarianceVerdict]:
    """Of a pendulum in a few lines, which knows neither where its hinge stands nor which way its World is turned."""
    found = invariances(out, "fine")
    return {each.invariance: each for each in found}


def test_units_and_the_mirror_change_nothing(verdicts: dict[str, InvarianceVerdict]) -> None:
    for name in ("rescaled", "mirrored"):
        assert verdicts[name].status == "agree"
        assert verdicts[name].channels >= 10


@pytest.mark.parametrize("name", ["moved", "turned"])
def test_an_engine_with_one_world_is_found_out(name: str, verdicts: dict[str, InvarianceVerdict]) -> None:
    assert verdicts[name].status == "differ"
    assert "marker:tip.position" in verdicts[name].differing
    assert not verdicts[name].ok


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("boosted", "stands on the ground by pivot"),
        ("clock", "nothing depends"),
        ("later", "engine fine begins all runs at t = 0"),
        ("reordered", "one of each"),
    ],
)
def test_what_says_nothing_says_why(name: str, reason: str, verdicts: dict[str, InvarianceVerdict]) -> None:
    assert verdicts[name].status == "not applicable" and verdicts[name].ok
    assert reason in verdicts[name].reason


def test_they_are_printed_and_kept(out: Path, verdicts: dict[str, InvarianceVerdict]) -> None:
    console = Console(record=True, width=120)
    assert print_invariances(console, list(verdicts.values())) == 1
    text = console.export_text()
    assert "pendulum/single" in text and "moved: differ" in text
    stored = json.loads((out / VERDICTS).read_text(encoding="utf-8"))
    assert {each["invariance"]: each["status"] for each in stored["verdicts"]} == {
        name: verdict.status for name, verdict in verdicts.items()
    }


def test_an_absent_engine_is_no_agreement(tmp_path: Path) -> None:
    found = invariances(tmp_path, "missing")
    assert {each.status for each in found} == {"did not run", "not applicable"}
    assert print_invariances(Console(quiet=True), found) == 1


def of_a_pendulum_at_rest(out: Path, linear: bool) -> tuple[InvarianceVerdict, ...]:
    """Verdicts on MuJoCo about a hanging pendulum, which does not move."""
    case = load_case(shipped_folder() / "linearised" / "hanging_pendulum")
    if not linear:
        variants = tuple(msgspec.structs.replace(variant, linear=msgspec.UNSET) for variant in case.run.variants)
        case = replace(case, run=msgspec.structs.replace(case.run, variants=variants))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("crosscheck.mutation.invariance_runs.run_planned", run_here)
        return run_invariances([case], out, engine="mujoco")


def test_what_rests_says_nothing(tmp_path: Path) -> None:
    found = of_a_pendulum_at_rest(tmp_path, linear=False)
    assert all(each.status == "not applicable" and each.ok for each in found)
    assert {each.invariance for each in found if each.reason == "nothing moves"} >= {"turned", "rescaled", "reordered"}


def test_what_rests_is_compared_by_its_linearised_motion(tmp_path: Path) -> None:
    found = {each.invariance: each for each in of_a_pendulum_at_rest(tmp_path, linear=True)}
    compared = [found[name] for name in ("turned", "moved", "rescaled", "reordered", "mirrored")]
    assert {each.status for each in compared} == {"agree"}
    assert {each.channels for each in compared} == {4}  # three derivatives, and the frequencies
    assert all(each.channel.startswith(("derivatives.", "frequencies")) for each in compared)
    assert found["boosted"].status == "not applicable"
