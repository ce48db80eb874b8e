"""Events that watch sensors and controllers, and what turns within a step; against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import flexmb as fm

G = 9.81
METHODS = [
    ("dop853", {}), ("rk4", {"step": 1e-3}), ("radau5", {"rtol": 1e-9}), ("exponential", {"rtol": 1e-9}),
    ("generalised_alpha", {"step": 1e-3, "spectral_radius": 1.0}),
]  # fmt: skip
END = (fm.EndRun(),)


def ball(*items, **rail) -> fm.Scene:
    """A mass of 2 kg on a vertical rail, 1 m high."""
    scene = fm.SceneBuilder("ball", gravity=(0.0, 0.0, -G)).rigid_body("ball", mass=2.0, inertia=(1.0, 1.0, 1.0))
    scene.prismatic("rail", "ground", "ball", position=1.0, **rail).marker("centre", "ball")
    return scene.sense_marker("height", "centre", "position").add(*items).scene()


def floor(watch: str, **how) -> fm.SceneEvent:
    bounce = fm.Impact(coordinate="rail.translation", **how)
    return fm.SceneEvent(name="floor", watch=watch, level=0.0, crossing="falling", actions=(bounce,))


@pytest.mark.parametrize(("method", "options"), METHODS)
def test_a_marker_bounces_as_its_coordinate_does(method, options):
    by_marker = fm.simulate(ball(floor("height[2]", restitution=0.8)), 2.5, method, samples=26, **options)
    expected = np.sqrt(2.0 / G) * (1.0 + 2.0 * np.cumsum([0.0, 0.8, 0.64, 0.512]))
    assert [event.name for event in by_marker.events] == ["floor"] * 4
    assert np.allclose([event.t for event in by_marker.events], expected, rtol=0.0, atol=1e-11)
    assert np.abs(by_marker.energy_drift).max() < 1e-9 and by_marker.q.min() > -1e-12
    assert by_marker.signals["height"][:, 2] == pytest.approx(by_marker.q[:, 0], abs=1e-14)


def pendulum(*items) -> fm.Scene:
    """A point of 3 kg on 2 m of massless rod, let go at the horizontal."""
    scene = fm.SceneBuilder("pendulum", gravity=(0.0, 0.0, -G))
    scene.rigid_body("bob", mass=3.0, com=(2.0, 0.0, 0.0), inertia=(1e-6, 1e-6, 1e-6))
    scene.revolute("pivot", "ground", "bob", axis=(0.0, 1.0, 0.0)).marker("tip", "bob", offset=(2.0, 0.0, 0.0))
    return scene.sense_load("load", "pivot").sense_coordinate("angle", "pivot").add(*items).scene()


def test_a_load_is_watched():
    """Along the rod the pivot carries 3 m g sin a, of which the vertical part is 3 m g sin(a)^2."""
    event = fm.SceneEvent(name="loaded", watch="load[5]", level=40.0, actions=END)
    run = fm.simulate(pendulum(event), 3.0, rtol=1e-12)
    angle = run.q[-1, 0]
    assert run.finished and 3.0 * 3.0 * G * np.sin(angle) ** 2 == pytest.approx(40.0, rel=1e-5)  # inertia of 1e-6
    assert run.signals["load"][-1, 5] == pytest.approx(40.0, abs=1e-9) and 0.1 < angle < 1.5


@pytest.mark.parametrize("period", [None, 0.05])
def test_a_controller_is_watched(period):
    """A continuous law at its level, to rounding; a sampled one at the instant at which it jumps over it."""
    law = fm.StateSpace(name="law", inputs=("angle",), D=((-2.0,),), period_s=period)
    event = fm.SceneEvent(name="enough", watch="law", level=-1.0, actions=END)
    run = fm.simulate(pendulum(law, event), 3.0, samples=301)
    if period is None:
        assert run.q[-1, 0] == pytest.approx(0.5, abs=1e-12)
    else:
        assert run.t[-1] / period == pytest.approx(np.round(run.t[-1] / period), abs=1e-9)
        one_before = run.q[np.argmin(np.abs(run.t - run.t[-1] + period)), 0]
        assert one_before < 0.5 < run.q[-1, 0]


def test_a_latch_breaks_where_its_load_is_too_large():
    """A latched arm on a hub that spins up: the load of the latch is that of a rigid arm, and it lets go at a limit."""
    scene = (
        fm.SceneBuilder("spin").rigid_body("hub", mass=1.0, inertia=(1.0, 1.0, 1.0))
        .rigid_body("arm", mass=2.0, com=(0.5, 0.0, 0.0), inertia=(1e-3, 0.1, 0.1))
        .revolute("axle", "ground", "hub", axis=(0.0, 0.0, 1.0), torque=fm.Ramp(rate=1.0))
        .revolute("joint", "hub", "arm", axis=(0.0, 0.0, 1.0), prescribed=fm.Constant(value=0.0))
        .sense_drive("strain", "joint.rotation")
        .event("breaks", "strain", 0.3, fm.Release(coordinate="joint.rotation")).scene()
    )  # fmt: skip
    run = fm.simulate(scene, 2.0, samples=41)
    on_axis = 0.1 + 2.0 * 0.25
    assert run.events[0].t == pytest.approx(0.3 * (1.0 + on_axis) / on_axis, abs=1e-12)
    held = run.t < run.events[0].t
    assert run.signals["strain"][held, 0] == pytest.approx(run.t[held] * on_axis / (1.0 + on_axis), abs=1e-12)
    assert np.all(run.signals["strain"][~held] == 0.0) and np.ptp(run.q[~held, 1]) > 1e-3


def spring(*events: fm.SceneEvent) -> fm.Scene:
    """x = cos t."""
    scene = fm.SceneBuilder("spring").rigid_body("mass", mass=1.0, inertia=(1.0, 1.0, 1.0))
    scene.prismatic("rail", "ground", "mass", position=1.0, stiffness=1.0).marker("centre", "mass")
    return scene.sense_marker("seen", "centre", "position").add(*events).scene()


ROUGH = [
    ("dop853", {"rtol": 1e-7}), ("rk4", {"step": 0.1}), ("radau5", {"rtol": 1e-5}), ("exponential", {"rtol": 1e-8}),
    ("generalised_alpha", {"step": 0.02, "spectral_radius": 1.0}),
]  # fmt: skip


@pytest.mark.parametrize("watch", ["rail.translation", "seen[2]"])
@pytest.mark.parametrize(("method", "options"), ROUGH)
def test_there_and_back_within_a_step_is_seen(method, options, watch):
    """Near its turning point at -1 the mass is beyond -0.9999 for 0.028 s, which is less than a step."""
    nothing = (fm.Change(path="rail.translation.damping_Ns_m", value=0.0),)
    both = fm.SceneEvent(name="both", watch=watch, level=-0.9999, actions=nothing)
    back = fm.SceneEvent(name="back", watch=watch, level=-0.9999, crossing="rising", actions=nothing)
    never = fm.SceneEvent(name="never", watch=watch, level=-1.0001, actions=nothing)
    run = fm.simulate(spring(both, back, never), 4.0, method, samples=5, **options)
    half = np.arccos(0.9999)
    assert [event.name for event in run.events] == ["both", "both", "back"]
    expected = [np.pi - half, np.pi + half, np.pi + half]
    tolerance = 3e-3 if method == "generalised_alpha" else 3e-4  # the level is passed at a hundredth of the speed
    assert np.allclose([event.t for event in run.events], expected, rtol=0.0, atol=tolerance)
    if method == "dop853":
        assert run.statistics.accepted_steps < 40


def test_what_is_no_signal_is_refused_with_its_place():
    for watch, message in (
        ("high", 'no "high"'), ("height", '"height" has 3 numbers'), ("height[3]", 'has no number 3'),
        ("height[x]", 'no "height\\[x\\]"'),
    ):  # fmt: skip
        with pytest.raises(fm.SceneError, match=message):
            ball(floor(watch))


def test_a_ball_comes_to_rest_on_the_floor_and_is_lifted_off():
    """Rebounds add up to t_1 (1 + e)/(1 - e); the floor carries m g, less what lifts, until that is more."""
    e, lift = 0.7, fm.SmoothStep(start_value=0.0, end_value=30.0, start_s=4.0, duration_s=2.0)
    for watch in ("rail.translation", "height[2]"):
        run = fm.simulate(ball(floor(watch, restitution=e, rests=True), force=lift), 6.0, samples=121)
        rests, leaves = run.events[-2:]
        assert (rests.name, leaves.name) == ("floor: at rest", "floor: leaves") and run.finished
        assert rests.t == pytest.approx(np.sqrt(2.0 / G) * (1.0 + e) / (1.0 - e), abs=1e-5)
        on_floor = (run.t >= rests.t) & (run.t < leaves.t)
        assert np.ptp(run.q[on_floor]) == 0.0 and abs(run.q[on_floor][0, 0]) < 1e-12
        stop = run.signals["floor: stop"][:, 0]
        lifted = on_floor & (run.t < 4.0)
        assert np.all(stop[~on_floor] == 0.0) and stop[lifted] == pytest.approx(2.0 * G, abs=1e-12)
        assert stop[on_floor].min() > 0.0 and leaves.impulses == {}
        x = (leaves.t - 4.0) / 2.0
        assert 30.0 * x**4 * (35.0 - 84.0 * x + 70.0 * x**2 - 20.0 * x**3) == pytest.approx(2.0 * G, abs=1e-9)
        assert run.q[-1, 0] > 0.1 and np.abs(run.energy_drift).max() < 1e-8


def test_a_finer_run_rests_later():
    """What is left of the rebounds is below the error that the run allows; in time it is the root of that."""
    e = 0.5
    whole = np.sqrt(2.0 / G) * (1.0 + e) / (1.0 - e)
    early = [
        whole - fm.simulate(ball(floor("rail.translation", restitution=e, rests=True)), 2.0, atol=atol).events[-1].t
        for atol in (1e-8, 1e-12)
    ]
    for left, atol in zip(early, (1e-8, 1e-12), strict=True):
        assert 0.0 < left <= 2.0 * np.sqrt(2.0 * atol / G) / (1.0 - e)
    assert early[1] < 0.05 * early[0]


def test_what_is_not_pressed_on_a_stop_does_not_rest():
    """A plastic impact without a force: the body stays where it is, held by nothing."""
    stop = fm.Impact(coordinate="rail.translation", restitution=0.0, rests=True)
    scene = fm.SceneBuilder("slider").rigid_body("mass", mass=1.0, inertia=(1.0, 1.0, 1.0))
    scene.prismatic("rail", "ground", "mass", position=-1.0, rate=1.0).event("wall", "rail.translation", 0.0, stop)
    run = fm.simulate(scene.scene(), 3.0, samples=31)
    assert [event.name for event in run.events] == ["wall"] and run.finished and abs(run.q[-1, 0]) < 1e-14


def test_a_run_that_ends_at_rest_is_taken_up():
    lift = fm.SmoothStep(start_value=0.0, end_value=30.0, start_s=4.0, duration_s=2.0)
    scene = ball(floor("rail.translation", restitution=0.5, rests=True), force=lift)
    whole, first = (fm.simulate(scene, t_end, samples=[0.0, t_end]) for t_end in (6.0, 3.0))
    rest = fm.simulate(first.restart.scene, 6.0, state=first.restart, samples=[3.0, 6.0])
    assert [event.name for event in rest.events] == ["floor: leaves"]
    assert rest.events[0].t == pytest.approx(whole.events[-1].t, abs=1e-10)
    assert rest.q[-1] == pytest.approx(whole.q[-1], abs=1e-8)


def test_a_distance_is_watched():
    """Two masses drift apart on one line: 3 m are between them where the sum of their ways says so."""
    scene = fm.SceneBuilder("apart").rigid_body("a", mass=1.0, inertia=(1.0, 1.0, 1.0))
    scene.rigid_body("b", mass=1.0, inertia=(1.0, 1.0, 1.0)).free("fa", "ground", "a", velocity=(-1.0, 0.0, 0.0))
    scene.free("fb", "ground", "b", position=(0.0, 2.0, 0.0), velocity=(1.0, 0.0, 0.0)).marker("at a", "a")
    scene.marker("at b", "b").sense_distance("gap", "at a", "at b").event("far", "gap[0]", 3.0, fm.EndRun())
    run = fm.simulate(scene.scene(), 3.0)
    assert run.t[-1] == pytest.approx(0.5 * np.sqrt(5.0), abs=1e-12)
    gap = np.sqrt(4.0 + 4.0 * run.t**2)
    assert run.signals["gap"] == pytest.approx(np.column_stack([gap, 4.0 * run.t / gap]), abs=1e-12)
