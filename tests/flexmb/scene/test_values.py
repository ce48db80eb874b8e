"""Scenes with other values at dotted paths."""

import numpy as np
import pytest

import flexmb as fm
from flexmb.scene.shapes import beam_section
from flexmb.scene.values import PathError, parsed


@pytest.fixture(scope="module")
def scene() -> fm.Scene:
    strip = beam_section(E=7e10, G=2.7e10, A=1e-4, Iy=8e-10, Iz=8e-10, rho=2700.0)
    return (
        fm.SceneBuilder("boom", gravity=(0.0, 0.0, -9.81))
        .rigid_body("hub", mass=2.0, inertia=(1.0, 2.0, 3.0))
        .beam("rod", length=1.0, elements=4, section=strip, modes=3)
        .revolute("pivot", "ground", "hub", torque=fm.Constant(value=1.0))
        .weld("root", "hub", "rod")
        .marker("rod", "rod", node="tip")
        .scene()
    )


def test_values_land_where_their_paths_lead(scene):
    other = scene.with_values({
        "hub.mass_kg": 3, "bodies.rod.level": "linear", "gravity_m_s2": np.array([0.0, 0.0, -1.62]),
        "bodies.rod.stations.*.EIy_Nm2": 7.0, "pivot.rotation.angle_rad": np.float64(0.1), "hinges.0.axis.0": 0.0,
        "pivot.rotation.torque_Nm": {"kind": "pulse", "value": 2.0, "start_s": 0.0, "duration_s": 1.0},
    })  # fmt: skip
    assert other.bodies[0].mass_kg == 3.0 and isinstance(other.bodies[0].mass_kg, float)
    assert other.bodies[1].level == "linear" and {station.EIy_Nm2 for station in other.bodies[1].stations} == {7.0}
    assert other.gravity_m_s2 == (0.0, 0.0, -1.62) and other.hinges[0].rotation.angle_rad == 0.1
    assert other.hinges[0].rotation.torque_Nm == fm.Pulse(value=2.0, start_s=0.0, duration_s=1.0)
    assert other.with_values({"pivot.rotation.torque_Nm": None}).hinges[0].rotation.torque_Nm is None
    assert scene.bodies[0].mass_kg == 2.0 and scene.with_values({}) == scene
    assert fm.compile(other).body_names == fm.compile(scene).body_names


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("hub.mas_kg", 1.0, 'did you mean "mass_kg"'),
        ("hubb.mass_kg", 1.0, 'did you mean "hub"'),
        ("rod.level", "rigid", 'bodies and markers have a "rod": begin with one of them'),
        ("hub.mass_kg.x", 1.0, 'so there is no "x"'),
        ("bodies.rod.elements", 4.5, "4.5 is not a whole number"),
        ("hub.mass_kg", "heavy", "give one, not 'heavy'"),
        ("hub.mass_kg", True, "give one, not True"),
        ("gravity_m_s2", (0.0, 1.0), "has 3 entries, not 2"),
        ("gravity_m_s2", 9.81, "is an array"),
        ("pivot.rotation.torque_Nm", 1.0, "is a structure: give a structure"),
        ("pivot.rotation.prescribed_rad", 1.0, "is nothing: give a structure"),
        ("pivot.rotation.prescribed_rad", {"kind": "wave"}, "use one of"),
        ("bodies.rod.level", 3, "is a string"),
        ("bodies.9.mass_kg", 1.0, 'there is no "9"'),
    ],
)
def test_paths_and_values_that_do_not_fit_are_explained(scene, path, value, message):
    with pytest.raises(PathError, match=message):
        scene.with_values({path: value})


def test_what_a_command_line_sets():
    assert parsed("hub.mass_kg=2.5") == ("hub.mass_kg", 2.5)
    assert parsed('a.b = {kind = "constant", value = 1}') == ("a.b", {"kind": "constant", "value": 1})
    for wrong, message in (("hub.mass_kg", "is not an assignment"), ("hub.mass_kg=heavy", "not valid TOML")):
        with pytest.raises(PathError, match=message):
            parsed(wrong)
