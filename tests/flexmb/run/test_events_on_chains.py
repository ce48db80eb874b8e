"""Latches, releases and impacts in closed chains: closed forms, the balance by hand, a tree that is the same."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import msgspec
import numpy as np
import pytest

import flexmb as fm
from flexmb.run import segments
from tests.flexmb.closure.mechanisms import windows
from tests.repo.project import ROOT

Z = (0.0, 0.0, 1.0)


# The four-bar's initial angles are rounded, and do not close it: the nearest ones that do are taken, and told.
ROUNDED = pytest.mark.filterwarnings("ignore:.*the nearest values that they allow are taken:flexmb.SceneWarning")


def four_bar(*events: fm.SceneEvent) -> fm.Scene:
    """Crank, coupler, and rocker on two pivots of the ground, all in one plane: closures are redundant in space."""
    scene = fm.SceneBuilder("four-bar", gravity=(0.0, -9.81, 0.0))
    for name, length, mass in (("crank", 0.3, 1.0), ("coupler", 1.0, 2.0), ("rocker", 0.8, 1.5)):
        inertia = mass * length**2 / 12.0
        scene.rigid_body(name, mass=mass, com=(0.5 * length, 0.0, 0.0), inertia=(1e-3, inertia, inertia))
    scene.revolute("a", "ground", "crank", axis=Z, angle=1.0, rate=3.0)
    scene.revolute("b", "crank", "coupler", axis=Z, angle=-0.5, parent_position=(0.3, 0.0, 0.0))
    scene.revolute("c", "ground", "rocker", axis=Z, angle=1.9, parent_position=(1.0, 0.0, 0.0))
    scene.closure("d", "revolute", "coupler", "rocker", axis=Z, position_a=(1.0, 0.0, 0.0), position_b=(0.8, 0.0, 0.0))
    scene.marker("end", "coupler", offset=(1.0, 0.0, 0.0)).marker("top", "rocker", offset=(0.8, 0.0, 0.0))
    return scene.add(*events).scene()


def on(watch: str, level: float, action: fm.Latch | fm.Impact | fm.Release, name: str = "hit") -> fm.SceneEvent:
    return fm.SceneEvent(name=name, watch=watch, level=level, actions=(action,))


@ROUNDED
def test_an_impact_turns_a_mechanism_of_one_freedom_over():
    """u+ = -e u-, and the impulse is (1 + e) u'Mu over the speed of the coordinate: closures do no work."""
    e = 0.6
    scene = four_bar(on("c.rotation", 1.8, fm.Impact(coordinate="c.rotation", restitution=e)))
    run = fm.simulate(scene, 1.0, samples=51)
    event, system = run.events[0], fm.compile(scene)
    before, after = event.before.u, event.after.u
    assert np.allclose(after, -e * before, rtol=0.0, atol=1e-9 * np.abs(before).max())
    energy = before @ system.mass_matrix(event.before) @ before
    assert event.impulses["c.rotation"] == pytest.approx(-(1.0 + e) * energy / before[2], rel=1e-9)
    assert event.energy_change == pytest.approx(-0.5 * (1.0 - e**2) * energy, rel=1e-9)
    assert np.abs(run.energy_drift).max() < 1e-9 * run.energy_scale


def test_a_latch_where_all_rows_are_independent():
    """A slider-crank in space, closed by a ball joint: all its kinetic energy goes, and the impulse is determined."""
    scene = fm.load_scene(ROOT / "cases" / "closed_chains" / "slider_crank" / "scene.toml")
    latch = on("time", 0.1, fm.Latch(coordinate="drive.rotation"))
    event = fm.simulate(msgspec.structs.replace(scene, events=(latch,)), 0.2, samples=5).events[0]
    energy = event.before.u @ fm.System(scene).mass_matrix(event.before) @ event.before.u
    assert event.energy_change == pytest.approx(-0.5 * energy, rel=1e-9)
    assert np.all(np.isfinite(event.closures["wristpin"])) and np.any(event.closures["wristpin"])


@ROUNDED
def test_closures_pass_their_part_of_an_impulse_on():
    """By hand, from moments about each pivot: what the pin gives to the rocker is what the rocker's momentum lacks."""
    scene = four_bar(on("c.rotation", 1.8, fm.Latch(coordinate="c.rotation")))
    run = fm.simulate(scene, 0.6, samples=31)
    event, system = run.events[0], fm.compile(scene)
    jump, M = event.after.u - event.before.u, system.mass_matrix(event.before)
    torque, force = event.closures["d"][:3], event.closures["d"][3:]
    angle = event.before.q[2]
    arm = 0.8 * np.array([np.cos(angle), np.sin(angle), 0.0])
    on_rocker = np.cross(arm, force)[2] + torque[2] + event.impulses["c.rotation"]
    assert (M @ jump)[2] == pytest.approx(on_rocker, rel=1e-10)
    assert abs(torque[2]) < 1e-12  # what is out of the plane redundant rows leave open
    assert np.array_equal(np.isnan(event.closures["d"]), [True, True, False, False, False, True])
    crank, coupler = event.before.q[0], event.before.q[0] + event.before.q[1]
    reach = np.array([np.cos(coupler), np.sin(coupler), 0.0])
    assert (M @ jump)[1] == pytest.approx(-np.cross(reach, force)[2], rel=1e-10)
    reach = reach + 0.3 * np.array([np.cos(crank), np.sin(crank), 0.0])
    assert (M @ jump)[0] == pytest.approx(-np.cross(reach, force)[2], rel=1e-10)


@ROUNDED
def test_a_mechanism_that_latches_is_a_structure_until_it_is_let_go():
    events = (
        on("c.rotation", 1.8, fm.Latch(coordinate="c.rotation"), "latch"),
        on("time", 0.8, fm.Release(coordinate="c.rotation"), "release"),
    )
    run = fm.simulate(four_bar(*events), 1.2, samples=61)
    assert run.finished and [event.name for event in run.events] == ["latch", "release"]
    held = (run.t >= run.events[0].t) & (run.t < 0.8)
    assert held.sum() > 10 and np.ptp(run.q[held], axis=0).max() < 1e-13 and np.abs(run.u[held]).max() < 1e-12
    assert run.events[0].energy_change < 0.0 and np.abs(run.energy_drift).max() < 1e-9 * run.energy_scale
    weight = 9.81 * (0.15 * np.cos(run.q[held, 0]))  # by virtual work the drive carries the whole weight
    assert np.all(np.abs(run.drives["c"][held, 0]) > 0.01 * np.abs(weight))
    assert np.ptp(run.q[run.t > 0.8], axis=0).min() > 1e-3
    apart = run.markers["end"].position - run.markers["top"].position
    assert np.abs(apart).max() < 1e-12


def chain(closed: bool, *events: fm.SceneEvent) -> fm.Scene:
    """Three bodies in a row; the last hinge is one of the tree, or a body afloat in the plane and a closure."""
    scene = fm.SceneBuilder("row", gravity=(0.0, -9.81, 0.0))
    for name in ("one", "two", "three"):
        scene.rigid_body(name, mass=1.0, com=(0.5, 0.1, 0.0), inertia=(0.1, 0.1, 0.1))
    scene.revolute("h1", "ground", "one", axis=Z, angle=-0.4, rate=1.0)
    scene.revolute("h2", "one", "two", axis=Z, angle=0.3, rate=-2.0, parent_position=(1.0, 0.0, 0.0))
    if not closed:
        return scene.revolute("h3", "two", "three", axis=Z, parent_position=(1.0, 0.0, 0.0)).add(*events).scene()
    x, y = np.cos(-0.4) + np.cos(-0.1), np.sin(-0.4) + np.sin(-0.1)
    rates = np.array([[-np.sin(-0.4), np.cos(-0.4)], [-np.sin(-0.1), np.cos(-0.1)]]).T @ [1.0, -1.0]
    scene.planar(
        "afloat", "ground", "three", x=fm.LinearCoordinate(position_m=x, rate_m_s=rates[0]),
        y=fm.LinearCoordinate(position_m=y, rate_m_s=rates[1]),
        rotation=fm.AngularCoordinate(angle_rad=-0.1, rate_rad_s=-1.0),
    )  # fmt: skip
    return scene.closure("h3", "revolute", "two", "three", axis=Z, position_a=(1.0, 0.0, 0.0)).add(*events).scene()


def test_a_chain_with_a_closure_is_the_tree_without_one():
    """A latch and, of other hinges, impacts: the same times, speeds, impulses and energies, by other equations."""
    events = (
        on("h2.rotation", -0.2, fm.Impact(coordinate="h2.rotation", restitution=0.5), "stop"),
        on("h1.rotation", -1.0, fm.Latch(coordinate="h1.rotation"), "latch"),
    )
    tree, loop = (fm.simulate(chain(closed, *events), 1.0, samples=21) for closed in (False, True))
    assert [event.name for event in tree.events] == [event.name for event in loop.events]
    assert {"stop", "latch"} == {event.name for event in tree.events}
    for a, b in zip(tree.events, loop.events, strict=True):
        assert a.t == pytest.approx(b.t, abs=1e-9) and a.energy_change == pytest.approx(b.energy_change, abs=1e-8)
        assert np.allclose(a.after.u[:2], b.after.u[:2], rtol=0.0, atol=1e-8)
        for name, impulse in a.impulses.items():
            assert impulse == pytest.approx(b.impulses[name], abs=1e-8)
    assert np.allclose(tree.q[:, :2], loop.q[:, :2], rtol=0.0, atol=1e-8)


@ROUNDED
def test_what_closures_do_not_allow_is_told():
    """The crank is driven: a stop of the rocker cannot turn it over."""
    scene = four_bar(on("c.rotation", 1.8, fm.Impact(coordinate="c.rotation", restitution=0.5)))
    driven = scene.with_values({
        "a.rotation.prescribed_rad": fm.Table(times_s=tuple(range(6)), values=tuple(1.0 + 3.0 * t for t in range(6))),
        "a.rotation.angle_rad": 0.0, "a.rotation.rate_rad_s": 0.0,
    })  # fmt: skip
    with pytest.raises(fm.DynamicsError, match="closures and prescribed motions do not allow"):
        fm.simulate(driven, 1.0)


@pytest.mark.parametrize("settings", [{}, {"method": "rk4", "step": 1e-3}], ids=["dop853", "rk4"])
@pytest.mark.parametrize("level", [0.0, 1e-4, -1e-4, 5e-4])
def test_a_level_within_a_leap_is_found_there(level, settings):
    """A parallelogram turns evenly, pi/2 - pi t; at t = 0.5 all its bars lie on one line, which steps leap over."""
    scene = windows(1, np.pi, gravity=0.0)
    end = fm.SceneEvent(name="end", watch="foot 0.rotation", level=level, actions=(fm.EndRun(),))
    run = fm.simulate(msgspec.structs.replace(scene, events=(end,)), 1.0, samples=11, **settings)
    assert run.finished and [event.name for event in run.events] == ["end"]
    assert run.t[-1] == pytest.approx(0.5 - level / np.pi, abs=1e-9)
    assert run.q[-1, 0] == pytest.approx(run.q[-1, 2], abs=1e-9)  # parallel


METHODS: dict[str, dict[str, Any]] = {
    "dop853": {}, "rk4": {"step": 1e-3}, "radau5": {"rtol": 1e-8}, "exponential": {"rtol": 1e-8},
}  # fmt: skip
SLIGHT = fm.Change(path="foot 0.rotation.damping_Nms_rad", value=0.0)  # changes nothing
FOOT = "foot 0.rotation"
LONGEST = 2.0**-9 * 0.5  # s of a leap: in half a second no corner moves as far as the mechanism is large


def turning(event: fm.SceneEvent) -> fm.Scene:
    """A parallelogram that turns evenly, pi/2 - pi t."""
    return msgspec.structs.replace(windows(1, np.pi, gravity=0.0), events=(event,))


@pytest.mark.parametrize("level", [0.0, 1e-5, -1e-5, 1e-4, -1e-4])
@pytest.mark.parametrize("method", METHODS)
def test_events_at_a_singular_position_happen_at_their_instant_or_told_before_it(method: Any, level: float) -> None:
    """What changes, latches or turns over does so within a leap; as near as 1e-5 to the position, where it starts."""
    actions = (SLIGHT, fm.Latch(coordinate=FOOT), fm.Impact(coordinate=FOOT, restitution=0.5))
    for action, after in zip(actions, (-np.pi, 0.0, 0.5 * np.pi), strict=True):
        scene = turning(on(FOOT, level, action))
        run = fm.simulate(scene, 1.0, method, samples=41, **METHODS[method])
        (event,) = run.events
        instant = 0.5 - level / np.pi
        assert run.finished and event.t + event.early == pytest.approx(instant, abs=1e-9)
        assert event.early == 0.0 if abs(level) > 5e-5 else 0.0 < event.early < LONGEST
        assert event.after.u[0] == pytest.approx(after, abs=1e-6)
        angle = 0.5 * np.pi - np.pi * np.minimum(run.t, event.t) + after * np.maximum(run.t - event.t, 0.0)
        assert run.q[:, 0] == pytest.approx(angle, abs=1e-7) and run.q[:, 2] == pytest.approx(angle, abs=1e-7)
        assert np.abs(run.energy_drift).max() < 1e-8 * run.energy_scale


@pytest.mark.parametrize("due", [0.5, 0.5 + 1e-5, 0.5 - 1e-5, 0.5 + 1e-4, 0.5 - 1e-4, 0.49])
@pytest.mark.parametrize("method", ["dop853", "rk4"])
def test_times_at_a_singular_position_are_met(method: Any, due: float) -> None:
    """As an event's, or as the end of a run, also of one with events."""
    run = fm.simulate(turning(on("time", due, SLIGHT)), 1.0, method, samples=11, **METHODS[method])
    (event,) = run.events
    assert run.finished and 0.0 <= event.early < LONGEST and event.t + event.early == pytest.approx(due, abs=1e-15)
    assert event.early == 0.0 if abs(due - 0.5) > 5e-5 else event.early > 0.0
    assert np.abs(run.q[:, 0] - 0.5 * np.pi + np.pi * run.t).max() < 1e-8
    for scene in (windows(1, np.pi, gravity=0.0), turning(on(FOOT, 1.0, SLIGHT))):
        short = fm.simulate(scene, due, method, samples=11, **METHODS[method])
        assert short.finished and short.stopped_at == short.t[-1] == due
        assert np.abs(short.q[:, 0] - 0.5 * np.pi + np.pi * short.t).max() < 1e-8
        assert short.restart is None or short.restart.since <= due


@pytest.mark.parametrize("level", [0.1, 2e-3, -2e-3, -0.1])
def test_a_run_goes_on_from_events_beside_a_singular_position(level):
    """A change that changes nothing, on either side: the branch is that of the run without it."""
    scene = windows(1, np.pi, gravity=0.0)
    change = fm.Change(path="foot 0.rotation.damping_Nms_rad", value=0.0)
    event = fm.SceneEvent(name="nothing", watch="foot 0.rotation", level=level, actions=(change,))
    run = fm.simulate(msgspec.structs.replace(scene, events=(event,)), 1.0, samples=11)
    assert run.finished and len(run.events) == 1
    assert np.abs(run.q[:, 0] - 0.5 * np.pi + np.pi * run.t).max() < 1e-8


def test_a_leap_of_unknown_length_moves_no_event(monkeypatch: pytest.MonkeyPatch) -> None:
    """NaN is neither shorter nor longer than the segment: the event happens when it is due, and nothing is tried."""
    monkeypatch.setattr(segments, "_longest_leap", lambda *given: np.nan)
    situation, raw = SimpleNamespace(system=None), SimpleNamespace(status=fm.Status.OK, t=1.0)
    assert segments.too_near(situation, None, raw, 0.0, 1.0) == 0.0  # type: ignore[arg-type]
