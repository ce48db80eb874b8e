"""Numbers by which events change a scene: derivatives of runs by them, and by all others across the change."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace

import flexmb as fm
from flexmb.ready import scenes
from flexmb.sensitivity import leg, part_scene
from tests.flexmb.closure.mechanisms import four_bar
from tests.flexmb.sensitivity.differences import differences, relative_error
from tests.flexmb.sensitivity.test_sensitivities import CLOSE, arm

T_END = 1.0
OF = ["pivot.rotation", "elbow.rotation.rate", "work", "energy.total"]
AGAIN = "elbow.rotation.stiffness_Nm_rad"  # what it is changed to is what it was: the equations stay as they are
BY = {
    "a stiffness": "events.stop.actions.0.value",
    "a mass": "heavier.actions.0.value",
    "gravity": "heavier.actions.1.value",
    "a function": "driven.actions.0.value.amplitude",
    "the same value again": "again.actions.0.value",
    "what is overwritten": "pivot.rotation.stiffness_Nm_rad",
    "the instant": "heavier.level",
    "the level": "stop.level",
    "what stays": "arm.mass_kg",
}


def changing() -> fm.Scene:
    """The arm, whose stiffness, mass, gravity and motor change one after the other."""
    sine = fm.Sine(amplitude=2.0, angular_frequency_rad_s=3.0)
    return (
        arm()
        .event("stop", "elbow.rotation", 0.1, fm.Change(path="pivot.rotation.stiffness_Nm_rad", value=30.0))
        .event("heavier", "time", 0.6, fm.Change(path="rod.mass_kg", value=3.0),
               fm.Change(path="gravity_m_s2.2", value=-5.0))
        .event("driven", "time", 0.7, fm.Change(path="pivot.rotation.torque_Nm", value=sine))
        .event("again", "time", 0.8, fm.Change(path=AGAIN, value=1.0))
        .scene()
    )  # fmt: skip


@pytest.fixture(scope="module")
def found():
    return fm.sensitivities(changing(), T_END, list(BY.values()), OF, samples=11)


@pytest.mark.parametrize("what", BY)
def test_runs_agree_with_differences(what, found):
    name = BY[what]
    k = found.parameters.index(name)
    h = 3e-3 * abs(found.parameter_values[k])
    apart = 2.0 * h * max(abs(event.derivatives[k]) for event in found.events)
    expected = differences(changing(), T_END, name, OF, h, samples=11, levels=2)
    assert np.max(relative_error(found, name, expected, apart)) < CLOSE
    assert np.max(np.abs(expected.outputs)) > 1e-3


def test_the_adjoint_finds_the_same(found):
    gradient = fm.gradient(changing(), T_END, found.parameters, fm.FinalValue("work"))
    np.testing.assert_allclose(gradient.derivatives, found.derivatives[-1, OF.index("work")], rtol=1e-7)


def test_leaving_out_what_a_value_changes_to_is_noticed(monkeypatch, found):
    """Negative control: the tables after changes depend on no number."""
    monkeypatch.setattr(part_scene.PartScene, "is_mechanical", lambda *_: False)
    other = fm.sensitivities(changing(), T_END, [BY["a stiffness"]], OF, samples=11)
    assert not np.any(other.derivatives[-1])
    assert np.all(found.derivatives[-1, :, 0])


def carried() -> fm.Scene:
    """A rod on a carriage that is driven upwards."""
    builder = fm.SceneBuilder("carried", gravity=(0.0, 0.0, -9.81))
    builder.rigid_body("carriage", mass=2.0, inertia=(1.0, 1.0, 1.0))
    builder.rigid_body("rod", mass=1.0, com=(0.4, 0.0, 0.1), inertia=(0.1, 0.2, 0.2))
    lift = fm.Sine(amplitude=0.3, angular_frequency_rad_s=3.0)
    builder.prismatic("rail", "ground", "carriage", axis=(0, 0, 1), prescribed=lift)
    return builder.revolute("pin", "carriage", "rod", axis=(0, 1, 0)).scene()


def changed_at(t: float, scene: fm.Scene, *changes: fm.Change) -> fm.Scene:
    return replace(scene, events=(fm.schema.SceneEvent(name="now", watch="time", level=t, actions=changes),))


def test_what_is_prescribed_moves_on_until_values_change(monkeypatch):
    """The work by the instant of a change, which brings more energy the higher bodies are then."""
    heavier = fm.Change(path="gravity_m_s2.2", value=-12.0), fm.Change(path="rod.mass_kg", value=1.5)
    scene, t_end, of = changed_at(0.2, carried(), *heavier), 0.5, ["work"]
    expected = differences(scene, t_end, "now.level", of, 1e-3, samples=3, levels=2)

    def error():
        found = fm.sensitivities(scene, t_end, ["now.level"], of, samples=3)
        return np.max(relative_error(found, "now.level", expected))

    assert error() < CLOSE
    adjoint = fm.gradient(scene, t_end, ["now.level"], fm.FinalValue("work"))
    assert adjoint.derivatives[0] == pytest.approx(expected.outputs[-1, 0], rel=CLOSE)
    monkeypatch.setattr(leg.Variation, "_energy_by_time", lambda *_: np.zeros(()))  # as it was
    assert error() > 0.01


def test_the_work_of_a_driven_loop_does_not_depend_on_when_values_change():
    """It is the energy at the end, where everything is prescribed, less that at the start."""
    turn = fm.Sine(amplitude=0.3, angular_frequency_rad_s=3.0, offset=1.0)
    scene = changed_at(0.2, four_bar(prescribed=turn), fm.Change(path="coupler.mass_kg", value=1.5))
    found = fm.sensitivities(scene, 0.5, ["now.level", "crank.mass_kg"], ["work"], samples=2)
    level, mass = found.derivatives[-1, 0]
    assert abs(level) < 1e-9 < 0.1 < abs(mass)


@pytest.mark.parametrize("closure", ["revolute", "cylindrical"])
def test_loops_choose_their_rows_behind_a_change(closure):
    """In the plane these closures have rows that depend on others; without them the motion is the same."""
    heavier = fm.Change(path="coupler.mass_kg", value=1.5)
    one, other = (changed_at(0.2, four_bar(closure=each), heavier) for each in (closure, "spherical"))
    by, of = ["now.level", "crank.mass_kg"], ["work", "joint.position.y"]
    found, expected = (fm.sensitivities(each, 0.5, by, of, samples=3).derivatives for each in (one, other))
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-7 * np.max(np.abs(expected)))
    here = fm.gradient(four_bar(closure=closure), 0.5, by[1:], fm.FinalValue(of[1]))
    there = fm.gradient(four_bar(closure="spherical"), 0.5, by[1:], fm.FinalValue(of[1]))
    assert here.derivatives == pytest.approx(there.derivatives, rel=1e-7)


def test_a_fit_finds_what_a_value_changes_to():
    softer = fm.Change(path="pivot.rotation.stiffness_Nm_rad", value=1.0)
    scene, name = scenes.pendulum().event("softer", "time", 0.1, softer).scene(), "softer.actions.0.value"
    data = fm.simulate(scene.with_values({name: 1.1}), 0.5, samples=11)
    found = fm.fit(scene, {"t": data.t, "pivot.rotation": data.q[:, 0]}, [name], sigma=1e-3)
    assert found.values == pytest.approx([1.1], rel=1e-4)
    assert np.max(fm.uncertainty(scene, 0.5, {name: 0.1}, ["pivot.rotation"], samples=2).sigma) > 1e-4


def test_pulses_and_schedules_that_begin_at_an_event_are_refused():
    pulse = fm.Pulse(value=1.0, start_s=0.6, duration_s=0.1)
    scene = arm().event("go", "time", 0.5, fm.Change(path="pivot.rotation.torque_Nm", value=pulse)).scene()
    with pytest.raises(ValueError, match="go.actions.0.value.start_s.*moves the start or the end of a pulse"):
        fm.sensitivities(scene, T_END, ["go.actions.0.value.start_s"], OF)


def test_numbers_on_which_nothing_depends_are_refused():
    """A coordinate that a function prescribes takes its initial value from there; so does one that starts a change."""
    steady = fm.Constant(value=0.8)
    scene = changing().with_values({"pivot.rotation.prescribed_rad": steady})
    name = "pivot.rotation.angle_rad"
    with pytest.raises(ValueError, match=f'"{name}" = 0.8: nothing in the run depends on it.*leave it out'):
        fm.sensitivities(scene, T_END, [name], OF)
    with pytest.raises(ValueError, match=f'"{name}" = 0.8: nothing in the run depends on it'):
        fm.gradient(scene, T_END, [name], fm.FinalValue("work"))
    system = fm.compile(scene)
    for name in ("pivot.rotation.angle_rad", "stop.level", BY["a mass"]):
        with pytest.raises(ValueError, match="do not depend on it.*see `sensitivities`"):
            system.parameters([name])
