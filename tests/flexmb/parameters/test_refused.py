"""Parameters that do not exist, or by which there is no derivative: errors with the place and the remedy."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

import flexmb
from flexmb.parameters import spectral
from flexmb.parameters.parameters import ParameterError
from flexmb.scene import schema as s
from flexmb.scene.bodies import TipMass
from flexmb.scene.build import SceneBuilder
from flexmb.scene.shapes import beam_section
from flexmb.scene.values import PathError

SQUARE = beam_section(E=7e10, G=2.7e10, A=1e-4, Iy=8e-10, Iz=8e-10, rho=2700.0)


def beam(modes: int, **more) -> flexmb.System:
    builder = SceneBuilder("beam", gravity=(0.0, 0.0, -9.81))
    builder.beam("boom", length=1.0, elements=4, modes=modes, level="linear", section=SQUARE, **more)
    builder.revolute("root", "ground", "boom", child_node="root", axis=(0.0, 1.0, 0.0))
    return flexmb.compile(builder.marker("end", "boom", node="tip").scene())


@pytest.mark.parametrize(("name", "error", "words"), [
    ("bom.length_m", PathError, "boom"),
    ("boom.lenght_m", PathError, "length_m"),
    ("boom.elements", PathError, "whole number"),
    ("boom.modes.count", PathError, "whole number"),
    ("boom.level", PathError, "real number"),
    ("boom.name", PathError, "real number"),
    ("boom.modes.static", PathError, "real number"),
    ("root.rotation.given", PathError, "real number"),
    ("root.rotation.torque_Nm", PathError, "write it into the scene"),
    ("root.parent_position_m", PathError, "name one of its numbers"),
    ("root.rotation", PathError, "real number"),
    ("boom.length_m.0", PathError, "has no parts"),
    ("stations.0.EIy_Nm2", PathError, "stations"),
])  # fmt: skip
def test_names_that_are_no_real_number(name, error, words):
    with pytest.raises(error, match=words):
        beam(2).parameters([name])


def test_lists_of_names():
    system = beam(2)
    with pytest.raises(TypeError, match="list of names"):
        system.parameters("boom.length_m")
    with pytest.raises(ValueError, match="at least one"):
        system.parameters([])
    with pytest.raises(ValueError, match="named twice"):
        system.parameters(["gravity_m_s2.2", "gravity_m_s2.2"])
    with pytest.raises(TypeError, match="named by a string"):
        system.parameters([1])


def test_places_of_one_path_must_agree():
    system = beam(2)
    assert system.parameters(["boom.stations.*.EIy_Nm2"]).values[0] == pytest.approx(56.0)
    with pytest.raises(PathError, match="has the values"):
        system.parameters(["boom.stations.*.x_m"])


def test_a_repeated_frequency_at_the_last_mode_is_refused():
    """The other plane's mode has the same frequency and is left out; which of both is kept depends on the number."""
    with pytest.raises(ParameterError, match=r"boom.stations.\*.EIz_Nm2.*mode 0.*take a value"):
        beam(1).parameters(["boom.stations.*.EIz_Nm2"])
    with pytest.raises(ParameterError, match=r"boom.stations.\*.EA_N.*do not depend on it: leave it out"):
        beam(1).parameters(["boom.stations.*.EA_N"])
    both = beam(1).parameters(["boom.length_m", "boom.stations.*.mass_per_length_kg_m"])  # they keep the order
    assert both.reached.all() and both.errors.max() < 1e-9


def test_what_appears_or_vanishes_is_refused():
    """A mass without rotary inertia cannot have less; points without rotary inertia are not among those that turn."""
    system = beam(2, tip_masses=(TipMass(x_m=1.0, mass_kg=0.1),))
    assert system.parameters(["boom.tip_masses.0.mass_kg"]).errors[0] < 1e-9
    with pytest.raises(ParameterError, match=r"break the triangle inequality.*take a value at which"):
        system.parameters(["boom.tip_masses.0.inertia_kg_m2.0.0"])
    modes = {"translation_modes": ((0.0, 0.0, 1.0),), "rotation_modes": ((0.0, 1.0, 0.0),)}
    points = [s.InertiaPoint(position_m=(x, 0.0, 0.0), mass_kg=1.0, **modes) for x in (0.5, 1.0)]
    builder = SceneBuilder("modal", gravity=(0.0, 0.0, 0.0)).modal_body("panel", points=points, stiffness=[[100.0]])
    system = flexmb.compile(builder.revolute("root", "ground", "panel").scene())
    assert system.parameters(["panel.points.0.mass_kg"]).errors[0] < 1e-9
    with pytest.raises(ParameterError, match=r"what the tables contain depends on it.*take a value at which"):
        system.parameters(["panel.points.0.inertia_kg_m2.0.0"])


def test_the_place_of_a_cut_names_the_remedy(monkeypatch):
    """Of a beam of level exact that is cut where a bob hangs; modes are known to no digits here."""
    monkeypatch.setattr(spectral, "LARGEST", -1.0)

    def said(cuts: tuple[str, ...] | None) -> str:
        builder = SceneBuilder("frame", gravity=(0.0, 0.0, -9.81))
        modes = s.Modes(count=0, polynomials=s.StrainPolynomials(torsion=2, bending_y=2, bending_z=2), cuts=cuts)
        builder.beam("stem", length=2.0, elements=12, section=SQUARE, level="exact", nodes={"port": 0.8}, modes=modes)
        builder.rigid_body("bob", mass=1.0, com=(0.0, 0.1, 0.0), inertia=(0.1, 0.1, 0.1))
        builder.weld("clamp", "ground", "stem")
        builder.revolute("pin", "stem", "bob", axis=(0.0, 0.0, 1.0), parent_node="port")
        system = flexmb.compile(replace(builder.scene(), allow=("uncut_beam",)))
        with pytest.raises(ParameterError) as refused:
            system.parameters(["stem.nodes.port.x_m"])
        return str(refused.value)

    assert 'leave beam "stem" in one piece by cuts = []' in said(None)
    assert "cuts" not in said(())
