"""Every mutation changes what it says and nothing else, and refuses what it cannot change."""

from __future__ import annotations

import msgspec
import pytest

from crosscheck.library.case import CaseError, MutationKind
from crosscheck.library.mutations import mutate
from flexmb.scene.bodies import BeamBody, BeamStation, Modes, Node, RigidBody
from flexmb.scene.hinges import AngularCoordinate, Gimbal, Revolute, Spherical
from flexmb.scene.schema import Scene, Wheel

INERTIA = ((0.1, 0.0, 0.0), (0.0, 0.2, 0.0), (0.0, 0.0, 0.25))
TURNED = (0.8, 0.0, 0.6, 0.0)
SPRUNG = AngularCoordinate(stiffness_Nm_rad=3.0)
STATION = {"EA_N": 1e6, "EIy_Nm2": 10.0, "EIz_Nm2": 20.0, "GJ_Nm2": 8.0, "mass_per_length_kg_m": 0.2}
SCENE = Scene(
    name="all of it",
    gravity_m_s2=(0.0, 0.0, -9.81),
    bodies=(
        RigidBody(
            name="hub",
            mass_kg=4.0,
            com_m=(0.1, 0.0, 0.0),
            inertia_kg_m2=INERTIA,
            nodes=(Node(name="port", quaternion=TURNED),),
        ),
        BeamBody(
            name="boom",
            length_m=1.0,
            elements=4,
            stations=(BeamStation(x_m=0.0, **STATION), BeamStation(x_m=1.0, **STATION)),
            modes=Modes(count=2),
            level="stiffened",
        ),
        RigidBody(name="tip", mass_kg=1.0, inertia_kg_m2=INERTIA),
    ),
    hinges=(
        Revolute(name="base", parent="ground", child="hub", rotation=SPRUNG, child_quaternion=TURNED),
        Gimbal(name="root", parent="hub", child="boom", rotations=(SPRUNG, AngularCoordinate(), SPRUNG)),
        Spherical(name="end", parent="boom", parent_node="tip", child="tip", stiffness_Nm_rad=2.0),
    ),
    wheels=(
        Wheel(
            name="wheel",
            body="hub",
            axis=(0.0, 0.0, 1.0),
            mass_kg=1.0,
            axial_inertia_kg_m2=0.1,
            transverse_inertia_kg_m2=0.05,
        ),
    ),
)


def changes(one: object, other: object, place: str = "$") -> set[str]:
    """Places at which two structs differ."""
    if isinstance(one, msgspec.Struct) and type(one) is type(other):
        found = (changes(getattr(one, key), getattr(other, key), f"{place}.{key}") for key in one.__struct_fields__)
        return set().union(*found)
    if isinstance(one, tuple) and isinstance(other, tuple) and len(one) == len(other):
        return set().union(*(changes(a, b, f"{place}[{i}]") for i, (a, b) in enumerate(zip(one, other, strict=True))))
    return set() if one == other else {place}


@pytest.mark.parametrize(
    ("mutation", "target", "places"),
    [
        ("mass", "hub", {"$.bodies[0].mass_kg"}),
        ("mass", "boom", {f"$.bodies[1].stations[{i}].mass_per_length_kg_m" for i in range(2)}),
        ("inertia", "tip", {f"$.bodies[2].inertia_kg_m2[{i}][{i}]" for i in range(3)}),
        ("com", "hub", {"$.bodies[0].com_m[0]"}),
        ("hinge_axis", "base", {"$.hinges[0].axis[2]"}),
        ("hinge_rotation", "base", {"$.hinges[0].child_quaternion[2]"}),
        ("node_rotation", "hub.port", {"$.bodies[0].nodes[0].quaternion[2]"}),
        ("gravity_sign", "", {"$.gravity_m_s2[2]"}),
        ("wheel_axis", "wheel", {"$.wheels[0].axis[2]"}),
        ("stiffness", "root", {f"$.hinges[1].rotations[{i}].stiffness_Nm_rad" for i in (0, 2)}),
        ("stiffness", "end", {"$.hinges[2].stiffness_Nm_rad"}),
        (
            "stiffness",
            "boom",
            {f"$.bodies[1].stations[{i}].{key}" for i in range(2) for key in STATION if not key.startswith("mass")},
        ),
        ("dropped_stiffening", "boom", {"$.bodies[1].level"}),
        ("dropped_stiffening", "", {"$.bodies[1].level"}),
    ],
)
def test_a_mutation_changes_just_its_place(mutation: MutationKind, target: str, places: set[str]) -> None:
    assert changes(SCENE, mutate(SCENE, mutation, target)) == places


@pytest.mark.parametrize(
    ("mutation", "target", "message"),
    [
        ("com", "tip", "changes nothing"),
        ("node_rotation", "hub.nowhere", "changes nothing"),
        ("mass", "bus", "there are only hub, boom, tip"),
        ("hinge_axis", "end", "has no axis"),
        ("inertia", "boom", "changes nothing"),
        ("dropped_stiffening", "hub", "changes nothing"),
    ],
)
def test_a_control_that_would_change_nothing_is_refused(mutation: MutationKind, target: str, message: str) -> None:
    with pytest.raises(CaseError, match=message):
        mutate(SCENE, mutation, target)
