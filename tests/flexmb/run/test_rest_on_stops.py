"""Rest on stops: names, loads that pull at rest, all algorithms, closed chains, bending bodies, other units."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import flexmb as fm
from flexmb.scene.shapes import beam_section
from flexmb.system.algorithms import RUNNING
from tests.flexmb.run.test_events_of_signals import G, ball, floor
from tests.flexmb.run.test_events_on_chains import ROUNDED, four_bar

RESTS = floor("rail.translation", restitution=0.5, rests=True)
SPEED = fm.CoordinateSensor(name="speed", of="rail", quantity="rate")


@fm.user_function
def fickle(t, inputs, state, parameters, outputs, change):
    """A force that presses what moves and lifts what rests."""
    outputs[0] = 60.0 if inputs[0] == 0.0 else -5.0


@pytest.mark.parametrize(
    "item",
    [
        fm.CoordinateSensor(name="floor: stop", of="rail"),
        fm.DriveSensor(name="floor: stop", coordinate="other.translation"),
        fm.StateSpace(name="floor: stop", inputs=("height[2]",), D=((1.0,),)),
        fm.SceneEvent(name="floor: leaves", watch="time", level=1.0, actions=(fm.EndRun(),)),
    ],
    ids=["sensor", "another stop", "controller", "event"],
)
def test_names_that_a_run_gives_to_stops_are_refused_elsewhere(item: Any) -> None:
    scene = fm.SceneBuilder("two").rigid_body("a", mass=1.0, inertia=(1.0, 1.0, 1.0)).prismatic("rail", "ground", "a")
    scene.rigid_body("b", mass=1.0, inertia=(1.0, 1.0, 1.0)).prismatic("other", "ground", "b")
    scene.marker("centre", "a").sense_marker("height", "centre", "position").add(RESTS, item)
    with pytest.raises(fm.SceneError, match=r'floor: \w+".*of event "floor"'):
        scene.scene()


def test_two_stops_in_one_event_are_refused() -> None:
    with pytest.raises(fm.SceneError, match="give each stop an event of its own"):
        ball(fm.SceneEvent(name="both", watch="rail.translation", level=0.0, actions=RESTS.actions * 2))


def test_the_scene_of_a_run_that_ends_at_rest_is_sound() -> None:
    run = fm.simulate(ball(RESTS), 2.0)
    assert run.restart is not None and run.restart.scene.events[-1].name == "floor: leaves"
    assert fm.check_scene(run.restart.scene) == ()


@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_a_load_that_pulls_at_rest_lets_nothing_rest(restitution: float) -> None:
    """It would have to be held by a stop that pulls, or to rest and leave without end: the run says so, and where."""
    law = fm.UserLaw(name="law", function=f"{__name__}:fickle", inputs=("speed",))
    event = floor("rail.translation", restitution=restitution, rests=True)
    run = fm.simulate(ball(event, SPEED, law, force=fm.ControlSignal(source="law")), 3.0, max_steps=20_000)
    first = np.sqrt(2.0 / (G + 2.5))
    expected = first * (1.0 + 2.0 * restitution / (1.0 - restitution))
    assert run.status is fm.Status.CHATTERING and run.stopped_at == pytest.approx(expected, abs=1e-5)
    assert run.message.endswith('the last were "floor"') and "pulls at rest" in run.message
    assert {event.name for event in run.events} == {"floor"} and run.q.min() > -1e-9


def test_what_rests_and_leaves_in_turn_goes_on() -> None:
    """A force that shakes harder than the weight, seen though nothing moves that steps would resolve: no chattering."""
    shaking = fm.Sine(amplitude=30.0, angular_frequency_rad_s=2.0 * np.pi * 20.0)
    event = floor("rail.translation", restitution=0.0, rests=True)
    run = fm.simulate(ball(event, force=shaking), 2.5, samples=251)
    names = [event.name for event in run.events]
    assert run.finished and names.count("floor: leaves") > 30 and names.count("floor: at rest") > 30
    assert run.q.min() > -1e-12 and np.abs(run.energy_drift).max() < 1e-8


@pytest.mark.parametrize("algorithm", RUNNING)
def test_every_algorithm_rests_and_leaves(algorithm: Any) -> None:
    lift = fm.SmoothStep(start_value=0.0, end_value=30.0, start_s=2.0, duration_s=1.0)
    run = fm.simulate(ball(RESTS, force=lift), 3.0, algorithm=algorithm, samples=31)
    rests, leaves = run.events[-2:]
    assert (rests.name, leaves.name) == ("floor: at rest", "floor: leaves")
    assert rests.t == pytest.approx(3.0 * np.sqrt(2.0 / G), abs=1e-5)
    held = (run.t >= rests.t) & (run.t <= 2.0)
    assert run.signals["floor: stop"][held] == pytest.approx(2.0 * G, abs=1e-12)
    x = leaves.t - 2.0
    assert 30.0 * x**4 * (35.0 - 84.0 * x + 70.0 * x**2 - 20.0 * x**3) == pytest.approx(2.0 * G, abs=1e-9)


@pytest.mark.parametrize("algorithm", ["articulated", "composite"])
@ROUNDED
def test_a_linkage_rests_on_a_stop(algorithm: Any) -> None:
    """By virtual work along the speeds that an impact there had, the stop carries the weights."""
    stop = fm.Impact(coordinate="c.rotation", restitution=0.4, rests=True)
    event = fm.SceneEvent(name="stop", watch="c.rotation", level=1.8, actions=(stop,))
    run = fm.simulate(four_bar(event), 2.0, algorithm=algorithm, samples=21)
    assert run.finished and run.events[-1].name == "stop: at rest" and np.abs(run.u[-1]).max() < 1e-12
    (a, b, c), (va, vb, vc) = run.events[-2].before.q, run.events[-2].before.u
    crank, coupler = 0.15 * np.cos(a) * va, 0.3 * np.cos(a) * va + 0.5 * np.cos(a + b) * (va + vb)
    power = 9.81 * (1.0 * crank + 2.0 * coupler + 1.5 * 0.4 * np.cos(c) * vc)
    assert run.signals["stop: stop"][-1, 0] == pytest.approx(power / vc, rel=1e-9)
    assert np.abs(run.energy_drift).max() < 1e-9 * run.energy_scale


@ROUNDED
def test_what_knows_no_closed_chains_refuses_them() -> None:
    stop = fm.Impact(coordinate="c.rotation", restitution=0.4, rests=True)
    event = fm.SceneEvent(name="stop", watch="c.rotation", level=1.8, actions=(stop,))
    with pytest.raises(NotImplementedError, match='use algorithm="articulated" or "composite"'):
        fm.simulate(four_bar(event), 1.0, algorithm="frisch")


@pytest.mark.parametrize(
    ("level", "algorithm"), [("full", "articulated"), ("full", "composite"), ("linear", "frisch")]
)
def test_a_bending_body_rests_on_a_stop(level: Any, algorithm: Any) -> None:
    """An arm on a hinge with a stop: its load, once vibrations have died out, is the moment of the weight."""
    strip = beam_section(E=7e10, G=2.7e10, A=1e-4, Iy=8e-10, Iz=8e-10, rho=2700.0)
    scene = fm.SceneBuilder("arm", gravity=(0.0, 0.0, -G))
    scene.beam("arm", length=1.0, elements=4, section=strip, level=level, modes=fm.Modes(count=2, damping_ratio=0.3))
    scene.revolute("hinge", "ground", "arm", axis=(0.0, 1.0, 0.0), angle=-0.1)
    stop = fm.Impact(coordinate="hinge.rotation", restitution=0.3, rests=True)
    run = fm.simulate(scene.event("stop", "hinge.rotation", 0.0, stop).scene(), 2.0, algorithm=algorithm, samples=21)
    assert run.finished and run.events[-1].name == "stop: at rest" and abs(run.q[-1, 0]) < 1e-12
    moment = 0.27 * G * 0.5  # but for the shift of the centre by the sag squared
    assert run.signals["stop: stop"][-1, 0] == pytest.approx(-moment, rel=1e-3)


def falling(length: float, time: float, mass: float, **how: Any) -> fm.Scene:
    """The ball, in units that are 1/length m, 1/time s and 1/mass kg."""
    scene = fm.SceneBuilder("ball", gravity=(0.0, 0.0, -G * length / time**2))
    scene.rigid_body("ball", mass=2.0 * mass, inertia=(mass * length**2,) * 3)
    scene.prismatic("rail", "ground", "ball", position=length)
    return scene.add(floor("rail.translation", restitution=0.5, **how)).scene()


UNITS = {"mm": (1e3, 1.0, 1.0), "t, mm, ms": (1e3, 1e3, 1e-3), "own": (0.3, np.sqrt(0.3 * G), 0.5)}


@pytest.mark.parametrize("how", [{"rests": True}, {}], ids=["rests", "chatters"])
@pytest.mark.parametrize(("length", "time", "mass"), UNITS.values(), ids=UNITS)
def test_units_change_no_event(length: float, time: float, mass: float, how: Any) -> None:
    """Where atol, a length here, is converted too."""
    si = fm.simulate(falling(1.0, 1.0, 1.0, **how), 3.0, samples=4)
    run = fm.simulate(falling(length, time, mass, **how), 3.0 * time, samples=4, atol=1e-12 * length)
    assert run.status is si.status and abs(len(run.events) - len(si.events)) <= (0 if how else 3)
    for one, other in list(zip(si.events, run.events, strict=False))[:40]:
        assert one.name == other.name and other.t == pytest.approx(one.t * time, rel=1e-9)
        if one.t < 1.35:  # later ones are small beside the error that is allowed
            impulse = one.impulses["rail.translation"] * mass * length / time
            assert other.impulses["rail.translation"] == pytest.approx(impulse, rel=1e-6)


@pytest.mark.parametrize("length", [1.0, 1e3])
@ROUNDED
def test_what_closures_do_not_allow_is_told_in_other_units(length: float) -> None:
    """A driven crank with a stop for its rocker; with a latch there, both stand still, exactly."""
    def loop(*items: Any, **crank: Any) -> fm.Scene:
        scene = fm.SceneBuilder("loop", gravity=(0.0, -9.81 * length, 0.0))
        for name, own in (("crank", 0.3), ("coupler", 1.0), ("rocker", 0.8)):
            inertia = own**2 / 12.0 * length**2
            scene.rigid_body(name, mass=1.0, com=(0.5 * own * length, 0, 0), inertia=(inertia / 9, inertia, inertia))
        scene.revolute("a", "ground", "crank", **crank)
        scene.revolute("b", "crank", "coupler", angle=-0.5, parent_position=(0.3 * length, 0.0, 0.0))
        scene.revolute("c", "ground", "rocker", angle=1.9, parent_position=(length, 0.0, 0.0))
        ends = {"position_a": (length, 0.0, 0.0), "position_b": (0.8 * length, 0.0, 0.0)}
        return scene.closure("d", "revolute", "coupler", "rocker", **ends).add(*items).scene()

    turning = fm.Table(times_s=tuple(range(6)), values=tuple(1.0 + 3.0 * t for t in range(6)))
    stop = fm.SceneEvent(
        name="stop", watch="c.rotation", level=1.8, actions=(fm.Impact(coordinate="c.rotation", restitution=0.5),)
    )
    with pytest.raises(fm.DynamicsError, match="closures and prescribed motions do not allow"):
        fm.simulate(loop(stop, prescribed=turning), 1.0)
    latch = fm.SceneEvent(name="stop", watch="c.rotation", level=1.8, actions=(fm.Latch(coordinate="c.rotation"),))
    run = fm.simulate(loop(latch, angle=1.0, rate=3.0), 1.0, samples=5)
    assert run.finished and np.all(run.events[0].after.u == 0.0) and np.abs(run.u[-1]).max() < 1e-12


def test_many_events_in_a_small_part_of_a_long_run_are_no_chattering() -> None:
    """A ball that hops for 1 ms each time, for ever: fifty hops are half a millionth of the run."""
    up = 0.5e-3 * G
    bounce = fm.Impact(coordinate="rail.translation", restitution=1.0)
    scene = fm.SceneBuilder("ball", gravity=(0.0, 0.0, -G)).rigid_body("ball", mass=2.0, inertia=(1.0, 1.0, 1.0))
    scene.prismatic("rail", "ground", "ball", rate=up)
    scene.event("floor", "rail.translation", 0.0, bounce, crossing="falling")
    scene.event("enough", "time", 0.0805, fm.EndRun())
    run = fm.simulate(scene.scene(), 1e5, samples=2)
    assert run.finished and len(run.events) == 81 and run.message.startswith('ended by event "enough"')


def test_the_error_of_work_at_a_stiff_stop_is_estimated() -> None:
    """No error control watches work; the balance of energy shows its error, and a tighter run tells it."""
    scene = fm.SceneBuilder("stiff", gravity=(0.0, 0.0, -G)).rigid_body("ball", mass=2.0, inertia=(1.0, 1.0, 1.0))
    scene.prismatic("rail", "ground", "ball", position=1.0)
    scene.linear_spring("stop", "rail", lower=0.0, stop_stiffness=1e6, stop_dissipation=0.3)
    for rtol in (1e-10, 1e-8):
        run = fm.simulate(scene.scene(), 3.0, rtol=rtol, atol=rtol / 100.0)
        estimate = run.error_estimate()
        drift = np.abs(run.energy_drift).max()
        assert 1e-8 < drift < np.max(estimate["energy.total"]) + np.max(estimate["work"]) < 1e-4
