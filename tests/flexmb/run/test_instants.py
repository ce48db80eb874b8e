"""One rule for what happens at an instant: at the start of a run, inside, at its end, where it is taken up, between
stages; for every kind of event, and for controllers that sample. Closed forms say what comes of it."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest

import flexmb as fm

G = 9.81
METHODS: dict[str, dict[str, Any]] = {
    "dop853": {}, "rk4": {"step": 5e-3}, "radau5": {"rtol": 1e-9}, "exponential": {"rtol": 1e-9},
    "generalised_alpha": {"step": 5e-3, "spectral_radius": 1.0},
}  # fmt: skip
WHERE = "rail.translation"


def cart(*items: Any, gravity: float = 0.0, chain: bool = False, **rail: Any) -> fm.Scene:
    """A mass of 2 kg on a vertical rail; in a closed chain, which leaves it the same freedom, on request."""
    scene = fm.SceneBuilder("cart", gravity=(0.0, 0.0, -gravity)).rigid_body("cart", mass=2.0, inertia=(1.0, 1.0, 1.0))
    scene.prismatic("rail", "ground", "cart", **rail).marker("centre", "cart")
    if chain:
        scene.rigid_body("plate", mass=1e-9, inertia=(1e-9, 1e-9, 1e-9))
        scene.prismatic("beside", "ground", "plate", position=rail.get("position", 0.0), rate=rail.get("rate", 0.0))
        scene.closure("glue", "weld", "cart", "plate")
    return scene.sense_marker("height", "centre", "position").add(*items).scene()


def event(watch: str, level: float, *actions: Any, crossing: Any = "either", name: str = "it") -> fm.SceneEvent:
    return fm.SceneEvent(name=name, watch=watch, level=level, crossing=crossing, actions=actions)


# What moves at 1 m/s, 4 N or nothing acting on it, tau after an event: place, speed.
KINDS: dict[str, tuple[Any, Any]] = {
    "change": (
        fm.Change(path="rail.translation.force_N", value=fm.Constant(value=4.0)), lambda x: (x + x**2, 1.0 + 2.0 * x)
    ),
    "latch": (fm.Latch(coordinate=WHERE), lambda x: (0.0 * x, 0.0 * x)),
    "release": (fm.Release(coordinate=WHERE), lambda x: (x + x**2, 1.0 + 2.0 * x)),
    "bounce": (fm.Impact(coordinate=WHERE, restitution=0.5), lambda x: (-0.5 * x, -0.5 + 0.0 * x)),
    "rests": (fm.Impact(coordinate=WHERE, restitution=0.0, rests=True), lambda x: (0.0 * x, 0.0 * x)),
    "end": (fm.EndRun(), lambda x: (0.0 * x, 1.0 + 0.0 * x)),
}  # fmt: skip


def moving(kind: str, start: float, *items: Any, chain: bool = False) -> fm.Scene:
    """At place 0 at `start`."""
    if kind == "release":
        held = {"prescribed": fm.Ramp(rate=1.0, start_s=start), "force": fm.Constant(value=4.0)}
        return cart(*items, chain=chain, **held)
    return cart(*items, chain=chain, rate=1.0, force=fm.Constant(value=0.0))


def check(run: fm.Trajectory, kind: str, start: float, instant: float, shown: list[str]) -> None:
    """Rows from the instant on, its own included, are those after it."""
    tau, after = np.maximum(run.t - instant, 0.0), run.t >= instant
    way, speed = KINDS[kind][1](tau)
    place = np.where(after, instant - start + way, run.t - start)
    assert run.finished and [event.name for event in run.events] == shown
    assert run.q[:, 0] == pytest.approx(place, abs=1e-9)
    assert run.u[after, 0] == pytest.approx(speed[after], abs=1e-9)


def pairs(kinds: Any, usual: str) -> list[Any]:
    """Kinds and methods: by default all kinds by `dop853` and all methods with one kind, the others marked slow."""
    return [
        pytest.param(kind, method, marks=[] if method == "dop853" or kind == usual else pytest.mark.slow)
        for kind, method in product(kinds, METHODS)
    ]


@pytest.mark.parametrize(("kind", "method"), pairs(KINDS, "rests"))
def test_what_is_due_at_a_time_happens_once_wherever_in_a_run_it_lies(kind: str, method: Any) -> None:
    options, names = METHODS[method], ["it"]
    for start in (0.0, -1.25, 3.0) if method == "dop853" else (-1.25,):
        for later in (0.0, 0.5, 1.0):
            instant, end = start + later, start + 1.0
            scene = moving(kind, start, event("time", instant, KINDS[kind][0]))
            times = np.linspace(start, end, 5)
            run = fm.simulate(scene, end, method, t_start=start, samples=times, **options)
            check(run, kind, start, instant, names)
            assert run.events[0].t == instant and (kind != "end" or run.t[-1] == run.stopped_at == instant)
            if kind == "end":
                continue
            for cut in times[1:-1]:  # before the instant, on it, after it
                first = fm.simulate(scene, cut, method, t_start=start, samples=times[times <= cut], **options)
                second = fm.simulate(
                    first.restart.scene, end, method, state=first.restart, samples=times[times >= cut], **options
                )
                check(first.then(second), kind, start, instant, names)
                assert np.array_equal(second.q[1:], run.q[times > cut])
                assert np.array_equal(second.work[1:], run.work[times > cut])


@pytest.mark.parametrize("kind", ["change", "latch", "bounce", "end"])
def test_a_stage_has_the_instants_of_its_start_and_of_its_end(kind: str) -> None:
    for instant in (1.0, 1.5, 2.0):
        scene = moving(kind, 0.0, event("time", instant, KINDS[kind][0]))
        run = fm.simulate_stages(moving(kind, 0.0), [fm.RunStage(1.0, samples=5), fm.RunStage(1.0, {}, scene, 5)])
        check(run, kind, 0.0, instant, ["it"])


@pytest.mark.parametrize("watch", [WHERE, "height[2]"])
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "release"])
def test_what_comes_to_a_level_has_to_come_there(kind: str, watch: str) -> None:
    """Inside, and at the end that the run found out; what starts at its level, and leaves it, has been there before."""
    action, crossing = KINDS[kind][0], "rising"
    for start in (0.0, 3.0):
        run = fm.simulate(moving(kind, start, event(watch, 0.5, action, crossing=crossing)), start + 1.0, t_start=start)
        check(run, kind, start, run.events[0].t, ["it"])
        assert run.events[0].t == pytest.approx(start + 0.5, abs=1e-12)
        there = moving(kind, start, event(watch, 0.0, action, crossing=crossing))
        gone = fm.simulate(there, start + 1.0, t_start=start)
        if isinstance(action, fm.Impact):
            assert gone.events[0].t == start and gone.q[-1, 0] <= 1e-12  # a stop on which it moves into it
        else:
            assert gone.events == () and gone.q[-1, 0] == pytest.approx(1.0, abs=1e-9)


# Of the ways to stand on a stop: how it is crossed, what is watched, and whether the cart is in a closed chain.
BY_DEFAULT = {("falling", WHERE, False), ("either", "height[2]", False), ("falling", "height[2]", True)}


def test_events_of_one_instant_happen_in_the_order_of_the_scene() -> None:
    """Wherever it lies; a sampled controller acts after all of them, and an event on what it says comes last."""
    law = fm.StateSpace(name="law", inputs=("speed",), D=((1.0,),), period_s=0.25)
    speed = fm.CoordinateSensor(name="speed", of="rail", quantity="rate")
    for later in (0.0, 0.5, 1.0):
        items = (
            event("time", later, fm.Impact(coordinate=WHERE, restitution=0.5), name="first"),
            event("time", later, fm.Latch(coordinate=WHERE), name="second"),
            event("law", 0.5, fm.Change(path="cart.mass_kg", value=3.0), crossing="falling", name="last"),
        )
        run = fm.simulate(cart(law, speed, *items, rate=1.0), 1.0, samples=5)
        names = ["first", "second", "last"] if later else ["first", "second"]  # at the start nothing was said before
        assert [event.name for event in run.events] == names and {event.t for event in run.events} == {later}
        assert run.signals["law"][:, 0].tolist() == [float(t < later) for t in run.t]


@pytest.mark.parametrize(
    ("crossing", "watch", "chain"),
    [
        each if each in BY_DEFAULT else pytest.param(*each, marks=pytest.mark.slow)
        for each in product(("falling", "either"), (WHERE, "height[2]"), (False, True))
    ],
)
def test_what_stands_on_a_stop_does_not_fall_through_it(crossing: str, watch: str, chain: bool) -> None:
    """At rest it rests; what moves into the stop is struck, what leaves it is not; without `rests` it chatters."""
    levels = (0.3,) if chain else (0.0, 0.3)
    for level, off, speed, rests in product(levels, (0.0, -6e-17), (0.0, -1.0, 1.0), (True, False)):
        stop = fm.Impact(coordinate=WHERE, restitution=0.5, rests=rests)
        there = {"position": level + off, "rate": speed}
        scene = cart(event(watch, level, stop, crossing=crossing), gravity=G, chain=chain, **there)
        run = fm.simulate(scene, 1.0, samples=5)
        after = 0.5 if speed < 0.0 else speed
        rest = 2.0 * after / G / 0.5  # the time of all rebounds
        assert run.q[:, 0].min() > level - 1e-11 and run.u[0, 0] == pytest.approx(after, abs=1e-9)
        if not rests:
            assert run.status is fm.Status.CHATTERING and run.stopped_at == pytest.approx(rest, abs=1e-5)
            continue
        assert run.finished and run.events[-1].name == "it: at rest"
        assert run.events[-1].t == pytest.approx(rest, abs=1e-5)
        assert run.signals["it: stop"][-1, 0] == pytest.approx(2.0 * G, rel=1e-6)
        again = fm.simulate(scene, 2.0, state=run.last_state, samples=3)
        assert again.finished and again.q[:, 0] == pytest.approx(level, abs=1e-11)


def test_a_stop_above_and_one_that_nothing_presses() -> None:
    stop = fm.Impact(coordinate=WHERE, restitution=1.0, rests=True)
    up = fm.Constant(value=40.0)
    ceiling = fm.simulate(cart(event(WHERE, 0.0, stop, crossing="rising"), gravity=G, force=up), 1.0, samples=3)
    assert [event.name for event in ceiling.events] == ["it: at rest"] and np.all(ceiling.q == 0.0)
    assert ceiling.signals["it: stop"][-1, 0] == pytest.approx(2.0 * G - 40.0, rel=1e-12)
    still = fm.simulate(cart(event(WHERE, 0.0, stop)), 1.0, samples=3)
    assert still.events == () and np.all(still.q == 0.0)
    for speed in (1.0, -1.0):  # without a load it is on the side to which it moves
        leaves = fm.simulate(cart(event(WHERE, 0.0, stop), rate=speed), 1.0, samples=3)
        assert leaves.events == () and leaves.q[-1, 0] == pytest.approx(speed)
    pulled = fm.simulate(cart(event(WHERE, 0.0, stop, crossing="falling"), force=up), 1.0, samples=3)
    assert pulled.events == () and pulled.q[-1, 0] == pytest.approx(10.0)


def test_what_is_let_go_on_a_stop_rests_on_it() -> None:
    """Held there first, by a motion that is prescribed: nothing ever came to the stop."""
    stop = event(WHERE, 0.0, fm.Impact(coordinate=WHERE, restitution=0.0, rests=True), crossing="falling")
    for instant in (0.0, 0.5, 1.0):
        free = event("time", instant, fm.Release(coordinate=WHERE), name="free")
        scene = cart(stop, free, gravity=G, prescribed=fm.Constant(value=0.0))
        run = fm.simulate(scene, 1.0, samples=5)
        assert [event.name for event in run.events] == ["free", "it: at rest"]
        assert run.finished and np.abs(run.q).max() == 0.0
        rest = fm.simulate(run.restart.scene, 2.0, state=run.restart, samples=3)
        assert rest.events == () and np.abs(rest.q).max() == 0.0


RESTITUTION = 0.8


def hopping(watch: str, kind: str) -> fm.Scene:
    """A ball that bounces; in one kind beside a latch, in another one with a spring that another bounce hardens."""
    bounce = [fm.Impact(coordinate=WHERE, restitution=RESTITUTION)]
    items: list[Any] = []
    if kind == "change":
        bounce.append(fm.Change(path="rail.translation.stiffness_N_m", value=5.0))
    if kind == "latch and release":
        items = [
            event(f"{WHERE}.rate", 0.0, fm.Latch(coordinate=WHERE), crossing="falling", name="caught"),
            event("time", 1.5, fm.Release(coordinate=WHERE), name="free"),
        ]
    if kind == "sampled":
        items = [
            fm.StateSpace(name="law", inputs=("height[2]",), A=((0.5,),), B=((1.0,),), C=((0.3,),), period_s=0.15,
                          delay_s=0.2),
        ]  # fmt: skip
    force = fm.ControlSignal(source="law") if kind == "sampled" else fm.Sine(amplitude=1.0, angular_frequency_rad_s=2.0)
    floor = event(watch, 0.0, *bounce, crossing="falling", name="floor")
    return cart(floor, *items, gravity=G, position=1.0, force=force)


@pytest.mark.parametrize(("kind", "method"), pairs(["bounce", "change", "latch and release", "sampled"], "change"))
def test_a_run_that_is_taken_up_at_an_event_is_one_that_had_never_ended(kind: str, method: Any) -> None:
    """To the last bit: at each event, soon before and after it, at an instant of a controller, and twice."""
    watch, options = ("height[2]" if kind == "change" else WHERE), METHODS[method]
    scene, end = hopping(watch, kind), 2.5
    cuts = {event.t for event in fm.simulate(scene, end, method, samples=3, **options).events}
    times = np.unique([0.0, *cuts, *(min(cuts) + np.array([-1e-3, 1e-3])), 7 * 0.15, 2.2, end])
    whole = fm.simulate(scene, end, method, samples=times, **options)
    assert len(whole.events) > 2
    for cut in times[1:-1]:
        first = fm.simulate(scene, cut, method, samples=times[times <= cut], **options)
        assert first.finished and first.t[-1] == cut
        second = fm.simulate(first.restart.scene, end, method, state=first.restart, samples=times[times >= cut],
                             **options)  # fmt: skip
        left = times > cut
        assert np.array_equal(second.q[1:], whole.q[left]) and np.array_equal(second.u[1:], whole.u[left])
        assert np.array_equal(second.work[1:], whole.work[left])
        shown = [*first.events, *second.events]
        assert [each.name for each in shown] == [event.name for event in whole.events]
        assert [each.t for each in shown] == pytest.approx([event.t for event in whole.events], abs=1e-11)
        if kind == "sampled":
            assert np.array_equal(second.signals["law"][1:], whole.signals["law"][left])


def test_a_run_that_an_event_ended_is_taken_up_behind_it() -> None:
    """From a file too. It does not end there once more."""
    scene = cart(event(WHERE, 0.5, fm.EndRun(), crossing="rising"), rate=1.0, stiffness=8.0)
    first = fm.simulate(scene, 3.0)
    assert first.q[-1, 0] == pytest.approx(0.5) and first.restart is not None and first.restart.since == first.t[-1]
    second = fm.simulate(first.restart.scene, 3.0, state=first.restart)
    whole = fm.simulate(cart(rate=1.0, stiffness=8.0), 3.0, samples=[0.0, 3.0])
    assert second.events == () and second.q[-1] == pytest.approx(whole.q[-1], abs=1e-8)


def test_an_end_a_rounding_behind_an_event_is_reached() -> None:
    for method, options in METHODS.items():
        scene = cart(event("time", 0.5, KINDS["bounce"][0]), rate=1.0)
        for roundings in (1, 3, 20):
            end = 0.5 + roundings * np.spacing(0.5)
            run = fm.simulate(scene, end, method, samples=2, **options)
            assert run.finished and [event.name for event in run.events] == ["it"]
