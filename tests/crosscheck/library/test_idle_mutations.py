"""What symmetry and rest leave out of a motion: mutations that nothing can show, and their near neighbours."""

from typing import Any

import msgspec
import numpy as np
import pytest
from msgspec.structs import replace

from crosscheck.library.case import CaseError
from crosscheck.library.mutations import CATALOGUE, mutate
from crosscheck.library.mutations.mirror import mirrors
from flexmb.scene.bodies import BeamBody, BeamStation, Modes, Node, RigidBody
from flexmb.scene.build import SceneBuilder
from flexmb.scene.check import check_scene
from flexmb.scene.functions import Constant
from flexmb.scene.hinges import AngularCoordinate, Free, Hinge, Revolute, Spherical, Weld
from flexmb.scene.schema import Closure, Load, PointMass, Scene, Wheel
from flexmb.scene.sections import mass_centres, matrix, restated
from tests.flexmb.modal.coupled_references import coupled_stiffness, section_mass, station

ROUND = ((2.0, 0.0, 0.0), (0.0, 2.4, 0.0), (0.0, 0.0, 3.0))
BUS = RigidBody(name="bus", mass_kg=30.0, inertia_kg_m2=ROUND, nodes=(Node(name="far", position_m=(0.6, 0.5, 0.2)),))
FLIGHT = Free(name="flight", parent="ground", child="bus", angular_velocity_rad_s=(0.0, 0.0, -0.1))
WHEEL = Wheel(
    name="wheel", body="bus", axis=(0.0, 0.0, 1.0), mass_kg=3.0, axial_inertia_kg_m2=0.05, transverse_inertia_kg_m2=0.03
)
TORQUE = Load(name="torque", body="bus", type="torque", direction=(0.0, 0.0, -1.0), function=Constant(value=0.25))
PUSH = Load(name="push", body="bus", node="far", type="force", direction=(1.0, 0.0, 0.0), function=Constant(value=1.0))
SPINNING = Scene(name="spinning", bodies=(BUS,), hinges=(FLIGHT,), wheels=(WHEEL,), loads=(TORQUE,))


def with_(item: Any, **changes: Any) -> Any:
    return msgspec.structs.replace(item, **changes)


def idle(scene: Scene, mutation: str, target: str) -> str:
    return CATALOGUE[mutation].idle(scene, target)


def of_bus(**changes: Any) -> Scene:
    return with_(SPINNING, bodies=(with_(BUS, **changes),))


def test_what_turns_in_a_mirror_s_plane_has_the_normal_for_its_only_axis() -> None:
    assert mirrors(SPINNING) == (2,)
    assert "torque's axis only" in idle(SPINNING, "load_frame", "torque")
    alike = of_bus(inertia_kg_m2=((2.0, 0.1, 0.0), (0.1, 2.4, 0.0), (0.0, 0.0, 3.0)))
    assert "inertia about that is the same" in idle(alike, "inertia_products", "bus")
    assert idle(SPINNING, "inertia_swapped", "bus") == "" and idle(SPINNING, "inertia", "bus") == ""


SKEW = ((2.0, 0.0, 0.1), (0.0, 2.4, 0.0), (0.1, 0.0, 3.0))


@pytest.mark.parametrize(
    "scene",
    [
        of_bus(inertia_kg_m2=SKEW),
        of_bus(com_m=(0.0, 0.0, 0.1)),
        with_(SPINNING, gravity_m_s2=(0.0, 0.0, -9.81)),
        with_(SPINNING, hinges=(with_(FLIGHT, angular_velocity_rad_s=(0.0, 1e-3, -0.1)),)),
        with_(SPINNING, hinges=(with_(FLIGHT, velocity_m_s=(0.0, 0.0, 1.0)),)),
        with_(SPINNING, hinges=(with_(FLIGHT, quaternion=(0.8, 0.6, 0.0, 0.0)),)),
        with_(SPINNING, wheels=(with_(WHEEL, axis=(0.0, 0.6, 0.8)),)),
        with_(SPINNING, loads=(TORQUE, PUSH)),
        with_(SPINNING, loads=(with_(TORQUE, direction=(0.6, 0.0, 0.8)),)),
        with_(SPINNING, point_masses=(PointMass(name="m", body="bus", mass_kg=1.0),)),
        with_(SPINNING, closures=(Closure(name="c", type="universal", body_a="ground", body_b="bus"),)),
    ],
)
def test_one_thing_out_of_the_plane_or_unknown_is_no_symmetry(scene: Scene) -> None:
    assert mirrors(scene) == ()
    assert idle(scene, "load_frame", "torque") == ""


def test_the_mass_of_a_body_whose_mass_centre_rests_is_idle() -> None:
    assert "no force acts" in idle(SPINNING, "mass", "bus")
    moving = with_(FLIGHT, velocity_m_s=(1.0, 0.0, 0.0))
    for scene in (
        with_(SPINNING, hinges=(moving,)),
        with_(SPINNING, loads=(PUSH,)),
        with_(SPINNING, gravity_m_s2=(0.0, -1.0, 0.0)),
        with_(SPINNING, wheels=(with_(WHEEL, offset_m=(0.1, 0.0, 0.0)),)),
        of_bus(com_m=(0.1, 0.0, 0.0)),
    ):
        assert idle(scene, "mass", "bus") == ""


@pytest.mark.parametrize(
    ("hinge", "com", "rests"),
    [
        (Weld(name="h", parent="ground", child="bus"), (0.3, 0.2, 0.1), True),
        (Revolute(name="h", parent="ground", child="bus"), (0.0, 0.0, 0.4), True),
        (Revolute(name="h", parent="ground", child="bus"), (0.1, 0.0, 0.4), False),
        (Revolute(name="h", parent="ground", child="bus", child_position_m=(0.1, 0.0, 0.0)), (0.1, 0.0, 0.4), True),
        (Spherical(name="h", parent="ground", child="bus"), (0.0, 0.0, 0.0), True),
        (Spherical(name="h", parent="ground", child="bus"), (0.0, 0.0, 0.4), False),
    ],
)
def test_a_mass_centre_in_its_hinge_rests(hinge: Hinge, com: tuple[float, float, float], rests: bool) -> None:
    scene = Scene(name="held", bodies=(with_(BUS, com_m=com),), hinges=(hinge,))
    assert bool(idle(scene, "mass", "bus")) == rests


STATION = {"EA_N": 1e6, "EIy_Nm2": 10.0, "EIz_Nm2": 10.0, "GJ_Nm2": 8.0, "mass_per_length_kg_m": 0.2}
BAR = BeamBody(
    name="bar", length_m=1.0, elements=4, stations=(BeamStation(x_m=0.0, **STATION), BeamStation(x_m=1.0, **STATION)),
    modes=Modes(count=2, families=("torsion",)),
)  # fmt: skip
CLAMP = Weld(name="clamp", parent="ground", child="bar")
TWIST = Load(name="t", body="bar", node="tip", type="torque", direction=(1.0, 0.0, 0.0), function=Constant(value=1.0))
TWISTED = Scene(name="twisted", bodies=(BAR,), hinges=(CLAMP,), loads=(TWIST,))


def test_a_clamped_bar_that_only_twists_moves_no_mass_centre() -> None:
    for mutation, target in (("mass", "bar"), ("dropped_deformation", "bar"), ("load_frame", "t")):
        assert idle(TWISTED, mutation, target), mutation
    bending = with_(TWISTED, bodies=(with_(BAR, modes=Modes(count=2, families=("torsion", "bending_y"))),))
    turned = with_(TWISTED, hinges=(with_(CLAMP, parent_quaternion=(0.8, 0.0, 0.6, 0.0)),))
    heavy = with_(TWISTED, gravity_m_s2=(0.0, 0.0, -9.81))
    assert not any(idle(bending, mutation, "bar") for mutation in ("mass", "dropped_deformation"))
    assert not any(idle(heavy, mutation, "bar") for mutation in ("mass", "dropped_deformation"))
    assert idle(bending, "load_frame", "t") == "" and idle(turned, "load_frame", "t") == ""


@pytest.mark.parametrize(("family", "axis"), [("bending_y", 1), ("bending_z", 2)])
def test_a_mode_out_of_the_plane_is_never_excited(family: Any, axis: int) -> None:
    beam = with_(BAR, modes=Modes(count=1, families=(family,)))
    flat = [0.0, 0.0, 0.0]
    flat[3 - axis] = -9.81
    scene = with_(TWISTED, bodies=(beam,), loads=(), gravity_m_s2=tuple(flat))
    assert axis in mirrors(scene)
    assert "normal to the plane" in idle(scene, "mode_sign", "bar")
    flat[1] = flat[2] = -9.81
    assert idle(with_(scene, gravity_m_s2=tuple(flat)), "mode_sign", "bar") == ""


@pytest.mark.parametrize(("stiffness", "round_one"), [(10.0, True), (11.0, False)])
def test_the_modes_of_a_round_section_have_no_order(stiffness: float, round_one: bool) -> None:
    stations = tuple(with_(station, EIz_Nm2=stiffness) for station in BAR.stations)
    beam = with_(BAR, stations=stations, modes=Modes(count=2, families=("bending_y", "bending_z")))
    scene = with_(TWISTED, bodies=(beam,))
    assert bool(idle(scene, "mode_order", "bar")) == round_one


@pytest.mark.parametrize(
    ("rotation", "named"),
    [
        (AngularCoordinate(angle_rad=-3.141592653589793), True),
        (AngularCoordinate(angle_rad=3.1), False),
        (AngularCoordinate(angle_rad=3.141592653589793, stiffness_Nm_rad=1.0), False),
        (AngularCoordinate(angle_rad=3.141592653589793, rate_rad_s=1.0), False),
    ],
)
def test_a_half_turn_is_the_same_on_the_opposite_axis(rotation: AngularCoordinate, named: bool) -> None:
    hinge = Revolute(name="pivot", parent="ground", child="bus", rotation=rotation)
    scene = Scene(name="pendulum", bodies=(BUS,), hinges=(hinge,))
    assert bool(idle(scene, "hinge_axis", "pivot")) == named


def test_a_body_that_does_not_turn_has_no_use_for_its_inertia() -> None:
    scene = Scene(name="fixed", bodies=(BUS,), hinges=(Weld(name="h", parent="ground", child="bus"),))
    assert idle(scene, "inertia", "bus") == "the body does not turn"


POINT = (0.03, -0.02)


def blade(section: BeamStation) -> Scene:
    builder = SceneBuilder("blade").beam("blade", length=2.0, elements=4, section=section, modes=4, theory="timoshenko")
    return builder.weld("root", "ground", "blade").scene()


SECTION = station(0.0, coupled_stiffness(), section_mass(), POINT)


def mutated(name, section: BeamStation = SECTION) -> BeamStation:
    """The first station after a mutation, which leaves a sound scene."""
    found = mutate(blade(section), name, "blade")
    check_scene(found)
    body = found.bodies[0]
    assert isinstance(body, BeamBody) and body.stations[0] == replace(body.stations[1], x_m=0.0)
    return body.stations[0]


def test_stiffness_is_that_of_the_whole_matrix() -> None:
    found = mutated("stiffness")
    np.testing.assert_allclose(found.stiffness, 1.01 * coupled_stiffness(), rtol=1e-14)
    assert replace(found, stiffness=SECTION.stiffness) == SECTION


@pytest.mark.parametrize(("name", "mass", "turning"), [("mass", 1.01, 1.0), ("inertia", 1.0, 1.01)])
def test_mass_and_inertia_stay_about_the_mass_centre(name: str, mass: float, turning: float) -> None:
    found = mutated(name)
    before, after = (mass_centres(np.array([each])) for each in (section_mass(), found.inertia))
    np.testing.assert_allclose(after[0], mass * before[0], rtol=1e-14)
    np.testing.assert_allclose(after[1], before[1], rtol=1e-14)
    np.testing.assert_allclose(after[2], turning * before[2], rtol=1e-12)
    assert replace(found, inertia=SECTION.inertia) == SECTION


def test_axes_are_exchanged_in_the_matrix() -> None:
    K = coupled_stiffness({(3, 4): 0.3})
    found = np.array(mutated("section_axes", replace(SECTION, stiffness=matrix(K))).stiffness)
    assert (found[4, 4], found[5, 5]) == (K[5, 5], K[4, 4]) and found[3, 4] == K[3, 4]


def test_the_reference_point_is_forgotten() -> None:
    assert mutated("section_point") == replace(SECTION, reference_point_m=(0.0, 0.0))
    with pytest.raises(CaseError, match="reference point off the axis"):
        mutated("section_point", restated(SECTION, (0.0, 0.0)))
