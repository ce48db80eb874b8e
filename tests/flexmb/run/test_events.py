"""Events against closed forms, momentum and energy; those that do not happen; chattering."""

import numpy as np
import pytest

import flexmb as fm
from flexmb.scene.shapes import beam_section

G = 9.81
METHODS = [
    ("dop853", {}), ("rk4", {"step": 1e-3}), ("radau5", {"rtol": 1e-9}), ("exponential", {"rtol": 1e-9}),
    ("generalised_alpha", {"step": 1e-3, "spectral_radius": 1.0}),
]  # fmt: skip


def ball(height: float, *events: fm.SceneEvent, **rail) -> fm.Scene:
    """A mass on a vertical rail, at a height."""
    scene = fm.SceneBuilder("ball", gravity=(0.0, 0.0, -G)).rigid_body("ball", mass=2.0, inertia=(1.0, 1.0, 1.0))
    return scene.prismatic("rail", "ground", "ball", position=height, **rail).add(*events).scene()


def impact(restitution: float, level: float = 0.0) -> fm.SceneEvent:
    bounce = fm.Impact(coordinate="rail.translation", restitution=restitution)
    return fm.SceneEvent(name="bounce", watch="rail.translation", level=level, crossing="falling", actions=(bounce,))


@pytest.mark.parametrize(("method", "options"), METHODS)
def test_a_ball_bounces_as_the_closed_form(method, options):
    """t_n = t_1 (1 + 2 sum e^k); impulses m (1 + e) e^k v; each takes (1 - e^2) of what is left of the energy."""
    e, height = 0.8, 1.0
    first = np.sqrt(2.0 * height / G)
    run = fm.simulate(ball(height, impact(e)), 2.5, method, samples=101, **options)
    expected = first * (1.0 + 2.0 * np.cumsum([0.0, e, e**2, e**3, e**4]))
    count = int(np.sum(expected < 2.5))
    assert run.finished and [event.name for event in run.events] == ["bounce"] * count
    assert np.allclose([event.t for event in run.events], expected[:count], rtol=0.0, atol=1e-11)
    speed = G * first * e ** np.arange(count)
    impulses = [event.impulses["rail.translation"] for event in run.events]
    assert np.allclose(impulses, 2.0 * (1.0 + e) * speed, rtol=1e-11)
    assert np.allclose([event.energy_change for event in run.events], -(1.0 - e**2) * speed**2, rtol=1e-11)
    assert np.abs(run.energy_drift).max() < 1e-9 and run.q.min() > -1e-12
    assert all(event.before.q[0] == event.after.q[0] and abs(event.before.q[0]) < 1e-13 for event in run.events)


def arm(*events: fm.SceneEvent, flexible: bool = False) -> fm.Scene:
    """A free hub with two members on hinges and a wheel: nothing acts from outside."""
    scene = (
        fm.SceneBuilder("arm")
        .rigid_body("hub", mass=5.0, com=(0.1, 0.0, 0.0), inertia=(1.0, 2.0, 3.0))
        .rigid_body("one", mass=2.0, com=(0.5, 0.1, 0.0), inertia=(0.1, 0.2, 0.2))
        .rigid_body("two", mass=1.0, com=(0.4, 0.0, 0.1), inertia=(0.05, 0.1, 0.1))
        .free("flight", "ground", "hub", angular_velocity=(0.1, 0.2, 0.3), velocity=(1.0, 0.0, -0.5))
        .revolute("root", "hub", "one", axis=(0.0, 1.0, 0.0), angle=-1.0, rate=0.8, stiffness=0.3)
        .revolute("elbow", "one", "two", axis=(0.0, 0.6, 0.8), angle=1.5, rate=-1.4, parent_position=(1.0, 0.0, 0.0))
        .wheel("wheel", "hub", mass=0.5, axial_inertia=0.02, transverse_inertia=0.01, axis=(1.0, 0.0, 0.0), speed=30)
        .marker("hand", "two", offset=(0.8, 0.0, 0.0))
    )
    return scene.add(*events).scene()


def latch(hinge: str, level: float) -> fm.SceneEvent:
    watched = f"{hinge}.rotation"
    return fm.SceneEvent(name=f"{hinge} latches", watch=watched, level=level, actions=(fm.Latch(coordinate=watched),))


@pytest.fixture(scope="module")
def deployed() -> fm.Trajectory:
    """Two hinges latch one after the other, and the first is let go again."""
    free = fm.SceneEvent(name="release", watch="time", level=2.5, actions=(fm.Release(coordinate="elbow.rotation"),))
    return fm.simulate(arm(latch("root", 0.0), latch("elbow", 0.2), free), 3.0, samples=301)


def test_latched_hinges_stay_and_momentum_passes_through(deployed):
    names = [event.name for event in deployed.events]
    assert sorted(names) == ["elbow latches", "release", "root latches"] and names[-1] == "release"
    for event in deployed.events[:2]:
        place = {"root latches": 8, "elbow latches": 9}[event.name]
        held = (deployed.t >= event.t) & (deployed.t < 2.5)
        assert held.sum() > 5 and np.ptp(deployed.q[held, place]) == 0.0
        assert np.all(deployed.u[held, place - 1] == 0.0)
        assert event.after.u[place - 1] == 0.0 and event.energy_change < 0.0
    scale = np.abs(deployed.momentum).max()
    assert np.abs(deployed.momentum_drift).max() < 1e-10 * scale
    assert np.abs(deployed.energy_drift).max() < 1e-9 * deployed.energy_scale
    lost = -sum(event.energy_change for event in deployed.events)
    assert lost > 0.01 * deployed.energy_scale and np.isclose(deployed.work[-1], -lost, rtol=1e-9)
    after = deployed.t >= 2.5
    assert np.ptp(deployed.q[after, 9]) > 0.0 and np.ptp(deployed.q[after, 8]) == 0.0  # the elbow alone was let go


def test_the_drive_of_a_latched_hinge_is_the_load_across_it(deployed):
    event = next(event for event in deployed.events if event.name == "root latches")
    held = deployed.t >= event.t
    assert np.all(deployed.drives["root"][~held] == 0.0) and np.all(deployed.drives["root"][held] != 0.0)


def test_an_impulse_is_that_of_least_change(deployed):
    """Gauss: of all speeds with the held ones at rest, those after are nearest in the metric of kinetic energy."""
    event, system = deployed.events[0], fm.compile(arm())
    M, jump = system.mass_matrix(event.before), event.after.u - event.before.u
    place = {"root latches": 7, "elbow latches": 8}[event.name]
    others = np.delete(M @ jump, place)
    assert np.abs(others).max() < 1e-12 * np.abs(M @ jump).max()
    assert np.isclose((M @ jump)[place], event.impulses[event.name.split()[0] + ".rotation"], rtol=1e-11)
    kinetic = [0.5 * u @ M @ u for u in (event.before.u, event.after.u)]
    assert np.isclose(kinetic[1] - kinetic[0], event.energy_change, rtol=1e-9)


def test_a_latched_scene_is_one_with_a_weld():
    """After both latch, the rest is one rigid body: its motion is that of a scene that starts welded."""
    both = fm.simulate(arm(latch("root", 0.0), latch("elbow", 0.2)), 3.0, samples=301)
    t = both.events[-1].t
    held = {"root.rotation": both.events[-1].after.q[8], "elbow.rotation": both.events[-1].after.q[9]}
    welded = arm()
    for name, angle in held.items():
        hinge, key = name.split(".")
        welded = welded.with_values({f"{hinge}.{key}.angle_rad": 0.0, f"{hinge}.{key}.rate_rad_s": 0.0,
                                     f"{hinge}.{key}.prescribed_rad": fm.Constant(value=float(angle))})  # fmt: skip
    times = np.r_[t, both.t[both.t > t]]
    alone = fm.simulate(welded, 3.0, state=both.events[-1].after, samples=times)
    assert np.allclose(alone.q[1:], both.q[both.t > t], rtol=0.0, atol=1e-9)


def test_changes_at_times_are_those_of_a_pulse():
    """A force that is switched on and off by events, and the same force as a pulse."""

    def switch(t: float, value: float) -> fm.SceneEvent:
        change = fm.Change(path="rail.translation.force_N", value=fm.Constant(value=value))
        return fm.SceneEvent(name=f"at {t}", watch="time", level=t, actions=(change,))

    switched = ball(0.0, switch(0.25, 30.0), switch(0.75, 0.0), force=fm.Constant(value=0.0), stiffness=20.0)
    pulsed = ball(0.0, force=fm.Pulse(value=30.0, start_s=0.25, duration_s=0.5), stiffness=20.0)
    a, b = (fm.simulate(scene, 1.0, samples=21) for scene in (switched, pulsed))
    assert np.allclose(a.q, b.q, rtol=0.0, atol=1e-9) and np.allclose(a.work, b.work, rtol=0.0, atol=1e-8)
    assert [event.t for event in a.events] == [0.25, 0.75] and len(a.t) == 21


def test_a_stiffness_that_changes_does_work():
    change = fm.Change(path="rail.translation.stiffness_N_m", value=60.0)
    lowest = fm.SceneEvent(name="firm", watch="rail.translation.rate", level=0.0, crossing="rising", actions=(change,))
    run = fm.simulate(ball(0.5, lowest, stiffness=20.0), 2.0, samples=41)
    assert run.events and np.abs(run.energy_drift).max() < 1e-9 * run.energy_scale
    assert np.isclose(run.events[0].energy_change, 0.5 * 40.0 * run.events[0].before.q[0] ** 2)


def test_the_run_ends_at_an_event():
    landed = fm.SceneEvent(name="landed", watch="rail.translation", level=0.0, actions=(fm.EndRun(),))
    run = fm.simulate(ball(1.0, landed), 2.0, samples=11)
    t = np.sqrt(2.0 / G)
    assert run.finished and run.stopped_at == run.t[-1] == pytest.approx(t, rel=1e-12)
    assert run.message == f'ended by event "landed" at t = {t:g} s' and abs(run.q[-1, 0]) < 1e-14


def test_sensors_are_watched_by_their_names():
    ended = fm.SceneEvent(name="fast", watch="speed", level=-2.0, actions=(fm.EndRun(),))
    speed = fm.CoordinateSensor(name="speed", of="rail", quantity="rate")
    late = fm.SceneEvent(name="late", watch="clock", level=0.1, actions=(impact(1.0).actions[0],))
    run = fm.simulate(ball(1.0, ended, late, speed, fm.TimeSensor(name="clock")), 2.0, samples=11)
    assert [event.name for event in run.events] == ["late", "fast"] and run.u[-1, 0] == -2.0
    with pytest.raises(fm.SceneError, match='no "height"'):
        ball(1.0, fm.SceneEvent(name="e", watch="height", level=0.0, actions=(fm.EndRun(),)))


def test_what_does_not_come_does_not_happen():
    """Wrong direction, level out of reach, at the level from the start: the run is that without events, bit for bit."""
    plain = fm.simulate(ball(1.0, stiffness=30.0), 3.0, samples=31)
    never = (
        fm.SceneEvent(name="up", watch="rail.translation", level=5.0, actions=(fm.EndRun(),)),
        fm.SceneEvent(name="start", watch="rail.translation", level=1.0, crossing="rising", actions=(fm.EndRun(),)),
        fm.SceneEvent(name="late", watch="time", level=9.0, actions=(fm.EndRun(),)),
    )
    run = fm.simulate(ball(1.0, *never[:1], *never[2:], stiffness=30.0), 3.0, samples=31)
    assert run.events == () and np.array_equal(run.q, plain.q) and np.array_equal(run.work, plain.work)
    falling = fm.SceneEvent(name="down", watch="rail.translation", level=0.0, crossing="rising", actions=(fm.EndRun(),))
    once = fm.simulate(ball(1.0, falling, stiffness=30.0), 3.0, samples=31)
    assert once.t[-1] > 0.5 and once.u[-1, 0] > 0.0
    assert fm.simulate(ball(1.0, never[1], stiffness=30.0), 1.0, samples=5).events == ()


@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_chattering_is_told(restitution):
    run = fm.simulate(ball(1.0, impact(restitution)), 5.0, samples=11)
    assert run.status is fm.Status.CHATTERING and "faster and faster" in run.message
    rest = np.sqrt(2.0 / G) * (1.0 + 2.0 * restitution / (1.0 - restitution))
    assert run.stopped_at == pytest.approx(rest, rel=1e-5) and run.q.min() > -1e-9


def test_steps_are_counted_over_all_pieces_and_a_stopped_run_goes_on():
    whole = fm.simulate(arm(latch("root", 0.0)), 3.0, samples=31)
    steps = whole.statistics.accepted_steps + whole.statistics.rejected_steps
    assert fm.simulate(arm(latch("root", 0.0)), 3.0, samples=31, max_steps=steps).finished
    run = fm.simulate(arm(latch("root", 0.0)), 3.0, samples=31, max_steps=steps - 1)
    assert run.status is fm.Status.MAX_STEPS and run.events and run.stopped_at < 3.0
    rest = fm.simulate(run.restart.scene, 3.0, state=run.restart, samples=[run.stopped_at, 3.0])
    assert np.array_equal(rest.q[-1], whole.q[-1])


def test_what_events_cannot_do_is_refused():
    with pytest.raises(NotImplementedError, match="has events"):
        fm.simulate_stages(ball(1.0, impact(1.0)), [fm.RunStage(1.0), fm.RunStage(1.0)])


def test_modes_take_their_part_of_a_latch():
    """Two flexible panels that latch at the same time, or next to it: both momenta and the balance of energy hold."""
    strip = beam_section(E=7e10, G=2.7e10, A=1e-4, Iy=8e-10, Iz=8e-10, rho=2700.0)
    scene = fm.SceneBuilder("panels").rigid_body("hub", mass=20.0, inertia=(5.0, 6.0, 7.0)).free("f", "ground", "hub")
    for side in (1, -1):
        name, seat = f"panel{side}", (0.0, 0.5 * side, 0.0)
        scene.beam(name, length=1.0, elements=6, section=strip, modes=4)
        scene.revolute(f"h{side}", "hub", name, parent_position=seat, angle=1.5 * side, stiffness=0.3)
        scene.add(latch(f"h{side}", 0.0))
    run = fm.simulate(scene.scene(), 2.0, rtol=1e-11, samples=41)
    assert len(run.events) == 2 and abs(run.events[0].t - run.events[1].t) < 1e-9
    modes = [place for place, (name, _) in enumerate(run.u_names) if ".mode_rate" in name]
    jump = run.events[0].after.u - run.events[0].before.u
    assert np.abs(jump[modes]).max() > 0.1
    assert np.abs(run.momentum_drift).max() < 1e-10
    assert np.abs(run.energy_drift).max() < 1e-9 * run.energy_scale
