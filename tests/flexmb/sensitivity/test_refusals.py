"""What derivatives of runs refuse: with the place, the time or the event, before or instead of a wrong number."""

from __future__ import annotations

import msgspec
import pytest

import flexmb as fm
from flexmb.parameters.parameters import ParameterError
from flexmb.ready import scenes
from flexmb.scene.values import PathError
from flexmb.sensitivity.gate import admitted


def falling(**impact) -> fm.SceneBuilder:
    """A ball above a floor, which it reaches after 0.45 s."""
    floor = fm.Impact(coordinate="rail.translation", **impact)
    return (
        fm.SceneBuilder("falling", gravity=(0.0, 0.0, -9.81))
        .rigid_body("ball", mass=2.0, inertia=(0.1, 0.1, 0.1))
        .prismatic("rail", "ground", "ball", position=1.0)
        .event("floor", "rail.translation", 0.0, floor, crossing="falling")
    )


def ask(scene, by="bob.mass_kg", of="pivot.rotation", t_end=0.2, **given):
    return fm.sensitivities(scene, t_end, [by], [of], **given)


@pytest.mark.parametrize(
    ("by", "message"),
    [
        ("bob.weight", 'there is no "weight"'),
        ("panel.modes.count", "whole number"),
        ("panel.name", "nothing (can be|is) differentiated"),
        ("panel.stations", "is an array"),
    ],
)
def test_what_is_no_real_number_is_refused(by, message):
    scene = scenes.panelled(2, "full").scene()
    with pytest.raises(PathError, match=message):
        ask(scene, by)


def test_unknown_outputs_methods_and_settings_are_refused():
    scene = scenes.pendulum().scene()
    with pytest.raises(ValueError, match=r'no output "?\'?pivot.rotatio'):
        ask(scene, of="pivot.rotatio")
    with pytest.raises(ValueError, match='use "dop853" or "rk4"'):
        ask(scene, method="radau5")
    with pytest.raises(TypeError, match="has no argument 'rtoll'"):
        ask(scene, rtoll=1e-3)
    with pytest.raises(TypeError, match="list of names"):
        fm.sensitivities(scene, 1.0, ["bob.mass_kg"], "pivot.rotation")


def test_numbers_that_move_instants_are_refused():
    scene = scenes.with_feedback(scenes.pendulum(), period=0.05)
    with pytest.raises(ParameterError, match="moves the instants"):
        ask(scene, "servo.period_s")
    pulse = fm.Pulse(value=1.0, start_s=0.05, duration_s=0.1)
    scene = scenes.pendulum().force("push", "bob", direction=(0, 1, 0), function=pulse).scene()
    with pytest.raises(ParameterError, match="a pulse"):
        ask(scene, "push.function.start_s")
    assert ask(scene, "push.function.value").derivatives.shape == (201, 1, 1)


def test_a_run_that_chatters_is_refused():
    with pytest.raises(fm.DynamicsError, match='does not finish.*"floor"'):
        ask(falling(restitution=0.5).scene(), "ball.mass_kg", "rail.translation", t_end=4.0)


def test_coming_to_rest_is_refused_with_the_time():
    with pytest.raises(fm.EventError, match=r'at t = 1\.35.* "floor" comes to rest'):
        ask(falling(restitution=0.5, rests=True).scene(), "ball.mass_kg", "rail.translation", t_end=4.0)
    before = ask(falling(restitution=0.5, rests=True).scene(), "floor.level", "rail.translation", t_end=1.0)
    assert [event.name for event in before.events] == ["floor", "floor"]


def test_a_grazing_event_is_refused():
    """A throw that rises 1.25 m, with a level half a nanometre below: 0.1 mm/s are left there."""
    scene = (
        fm.SceneBuilder("throw", gravity=(0.0, 0.0, -10.0))
        .rigid_body("ball", mass=2.0, inertia=(0.1, 0.1, 0.1))
        .prismatic("rail", "ground", "ball", rate=5.0)
        .event("top", "rail.translation", 1.25 - 5e-10, fm.Impact(coordinate="rail.translation"))
        .scene()
    )
    with pytest.raises(fm.EventError, match='"top" at t = 0.49999 s grazes its level'):
        ask(scene, "ball.mass_kg", "rail.translation", t_end=1.0)


def test_events_at_one_instant_whose_times_change_differently_are_refused():
    """Two balls side by side, of which one may be released from another height."""
    builder = fm.SceneBuilder("two", gravity=(0.0, 0.0, -10.0))
    for name in ("left", "right"):
        builder.rigid_body(name, mass=2.0, inertia=(0.1, 0.1, 0.1))
        builder.prismatic(f"{name} rail", "ground", name, position=1.0)
        hit = fm.Impact(coordinate=f"{name} rail.translation", restitution=0.9)
        builder.event(f"{name} hits", f"{name} rail.translation", 0.0, hit, crossing="falling")
    scene = builder.scene()
    with pytest.raises(fm.EventError, match='"left hits" and "right hits" happen at one instant, t = 0.447214 s'):
        ask(scene, "left rail.translation.position_m", "left rail.translation", t_end=0.6)
    assert len(ask(scene, "gravity_m_s2.2", "left rail.translation", t_end=0.6).events) == 2


def test_a_singular_position_is_refused_with_the_closure():
    scene = scenes.looped().scene()
    with pytest.raises(fm.DynamicsError, match="derivatives stopped at t = 0.5.*singular"):
        ask(scene, t_end=1.5)


def test_loads_that_are_measured_in_closed_chains_are_refused():
    scene = msgspec.structs.replace(scenes.looped().scene(), sensors=(fm.LoadSensor(name="felt", hinge="pivot"),))
    with pytest.raises(NotImplementedError, match='sensor "felt" measures a load'):
        fm.sensitivities(scene, 0.1, ["bob.mass_kg"], ["pivot.rotation"])


@pytest.mark.parametrize("path", ["loop.position_a_m.0", "bob.mass_kg"])
def test_changes_that_open_a_closure_are_refused(path):
    """By any number: the jump to where it is closed depends on all. Changes that leave it closed are not."""
    change = fm.Change(path=path, value=2.001)
    scene = scenes.looped().event("longer", "time", 0.05, change).scene()
    if path.startswith("loop"):
        for by in ("longer.actions.0.value", "bob.mass_kg"):
            with pytest.raises(NotImplementedError, match='event "longer" changes .* closure "loop" depends'):
                admitted(scene, [by])
    else:
        assert admitted(scene, ["longer.actions.0.value"]).numbers


def test_the_level_of_an_event_does_not_change_in_a_run():
    """Neither by its full path nor by its short one."""
    for path in ("events.floor.level", "floor.level"):
        scene = falling().event("lower", "time", 0.1, fm.Change(path=path, value=-0.5))
        with pytest.raises(fm.SceneError, match=f'"{path}" stays as it is in a run'):
            fm.compile(scene.scene())
