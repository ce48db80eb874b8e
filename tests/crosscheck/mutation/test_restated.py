"""Sections at another reference point: nothing changes, for beams of every form; a wrong transport is noticed."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import msgspec
import numpy as np
import pytest

from crosscheck.mutation.invariances import NotApplicable
from crosscheck.mutation.invariances.restated import RESTATED
from flexmb.scene.bodies import BeamBody, BeamStation
from flexmb.scene.build import SceneBuilder
from flexmb.scene.schema import Modes, Scene, StrainPolynomials
from flexmb.scene.sections import matrix
from flexmb.scene.shapes import beam_section
from tests.crosscheck.mutation.test_invariances import BY_NAME, rigid, strangers
from tests.flexmb.modal.coupled_references import coupled_stiffness, section_mass, station

SQUARE = beam_section(E=7e10, G=2.7e10, A=1e-4, Iy=8e-10, Iz=8e-10, rho=2700.0)  # two planes of one frequency
WIRE = BeamStation(x_m=0.0, EA_N=1e7, EIy_Nm2=3.0, EIz_Nm2=3.0, GJ_Nm2=2.0, mass_per_length_kg_m=0.4)


@cache
def blades() -> Scene:
    """Beams of all levels with coupled sections, and ones by numbers, with and without shear and rotary inertia."""
    builder = SceneBuilder("blades", gravity=(0.3, -0.5, -9.81))
    builder.rigid_body("hub", mass=50.0, inertia=(1.0, 2.0, 2.5))
    builder.free("base", "ground", "hub", angular_velocity=(0.5, 0.4, -1.0))
    section = station(0.0, coupled_stiffness(), section_mass(), (0.03, -0.02))
    tip = station(1.5, 0.5 * coupled_stiffness(), 0.7 * section_mass())
    for i, level in enumerate(("linear", "full", "stiffened", "ruthless", "rigid")):
        builder.beam(
            f"blade {i}", length=1.5, elements=4, modes=4, section=[section, tip], theory="timoshenko", level=level,
            points=("section", "rotary", "line")[i % 3], mass="lumped" if i == 1 else "consistent",
        )  # fmt: skip
        builder.revolute(f"flap {i}", "hub", f"blade {i}", axis=(0.0, 1.0, 0.0), angle=0.2 * i, rate=0.3, stiffness=4.0)
        builder.marker(f"end {i}", f"blade {i}", node="tip")
    curved = [msgspec.structs.replace(each, curvature_1_m=(0.3, -0.2, 0.5)) for each in (section, tip)]
    strains = StrainPolynomials(axial=1, shear_y=1, shear_z=1, torsion=2, bending_y=2, bending_z=2)
    builder.beam(
        "bow", length=1.5, elements=4, modes=Modes(count=0, polynomials=strains), section=curved, theory="timoshenko",
        level="exact", points="section",
    )  # fmt: skip
    builder.revolute("flap of bow", "hub", "bow", axis=(0.0, 1.0, 0.0), angle=-0.4, rate=0.3, stiffness=4.0)
    builder.marker("end of bow", "bow", node="tip")
    for name, section, more in (
        ("rod", SQUARE, {}), ("wire", WIRE, {"modes": Modes(count=4, families=("bending_y", "bending_z"))}),
        ("short", SQUARE, {"theory": "timoshenko"}),
    ):  # fmt: skip
        builder.beam(name, length=1.0, elements=4, section=section, **({"modes": 4} | more))
        builder.revolute(f"joint of {name}", "hub", name, axis=(0.0, 0.6, 0.8), rate=0.7)
        builder.marker(f"end of {name}", name, node="tip")
    builder.modal_state("bow", coordinates=(3e-3, *(0.0,) * 8))
    for body, count in (("blade 1", 4), ("rod", 4)):
        builder.modal_state(body, coordinates=tuple(0.003 * (i + 1) for i in range(count)), rates=(0.1,) * count)
    return builder.scene()


def test_nothing_changes_at_another_reference_point() -> None:
    counterpart = RESTATED.of(blades())
    stations = [station for body in counterpart.scene.bodies for station in getattr(body, "stations", ())]
    assert len({each.reference_point_m for each in stations}) == 6  # root and tip of the blades and of two other beams
    assert all(each.stiffness is not None and each.inertia is not None for each in stations)
    assert strangers(blades(), counterpart) == []


@pytest.mark.parametrize("fault", ["point left where it was", "stiffness uncoupled", "inertia uncoupled", "wrong side"])
def test_a_wrong_transport_is_noticed(fault: str) -> None:
    def spoilt(each: BeamStation) -> BeamStation:
        y, z = each.reference_point_m
        match fault:
            case "point left where it was":
                return msgspec.structs.replace(each, reference_point_m=(0.0, 0.0))
            case "wrong side":
                return msgspec.structs.replace(each, reference_point_m=(-y, z))
        key = fault.split()[0]
        values = np.array(getattr(each, key))
        values[:3, 3:] = values[3:, :3] = 0.0
        return msgspec.structs.replace(each, **{key: matrix(values)})

    counterpart = RESTATED.of(blades())
    for name in ("blade 1", "blade 2", "bow"):
        bodies = tuple(
            msgspec.structs.replace(body, stations=tuple(map(spoilt, body.stations)))
            if isinstance(body, BeamBody) and body.name == name
            else body
            for body in counterpart.scene.bodies
        )
        wrong = msgspec.structs.replace(counterpart.scene, bodies=bodies)
        assert strangers(blades(), replace(counterpart, scene=wrong))


@pytest.mark.parametrize("name", ["turned", "moved", "reordered", "rescaled", "mirrored"])
def test_nothing_changes_in_a_scene_of_coupled_sections(name: str) -> None:
    counterpart = BY_NAME[name].of(_without_states())
    assert counterpart.scene != _without_states()
    assert strangers(_without_states(), counterpart) == []


@pytest.mark.parametrize("key", ["stiffness", "inertia", "reference_point_m", "curvature_1_m"])
@pytest.mark.parametrize("name", ["rescaled", "mirrored"])
def test_a_matrix_left_as_it_was_is_noticed(name: str, key: str) -> None:
    counterpart = BY_NAME[name].of(_without_states())

    def kept(new: BeamStation, old: BeamStation) -> BeamStation:
        return msgspec.structs.replace(new, **{key: getattr(old, key)})

    bodies = list(counterpart.scene.bodies)
    for i, old in enumerate(_without_states().bodies):
        new = bodies[i]
        if isinstance(new, BeamBody) and isinstance(old, BeamBody) and old.name in ("blade 1", "blade 2", "bow"):
            stations = tuple(map(kept, new.stations, old.stations))
            bodies[i] = msgspec.structs.replace(new, stations=stations)
    wrong = msgspec.structs.replace(counterpart.scene, bodies=tuple(bodies), allow=("wave_speed", "thick_section"))
    assert strangers(_without_states(), replace(counterpart, scene=wrong))


@cache
def _without_states() -> Scene:
    """Without initial modal coordinates, which make beams points and modes in other units and in the mirror."""
    return msgspec.structs.replace(blades(), modal_states=())


def test_a_scene_without_beams_has_no_reference_points() -> None:
    with pytest.raises(NotApplicable, match="beam"):
        RESTATED.of(rigid())
