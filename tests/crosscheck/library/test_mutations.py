"""Every mutation changes what it says and nothing else, and refuses what it cannot change."""

from functools import cache
from typing import get_args

import msgspec
import numpy as np
import pytest

from crosscheck.library.case import CaseError, MutationKind
from crosscheck.library.mutations import CATALOGUE, applicable, mutate
from flexmb.scene.bodies import BeamBody, BeamStation, Modes, Node, RigidBody
from flexmb.scene.check import check_scene
from flexmb.scene.connectors import AngularFriction, AngularSpring, Bushing
from flexmb.scene.control import CoordinateSensor, MarkerSensor, Pid, ProfileSensor, StateSpace
from flexmb.scene.couplings import CoupledCoordinate, Coupling
from flexmb.scene.events import Change, Impact, Latch, SceneEvent
from flexmb.scene.functions import Ramp, Sine, SmoothStep
from flexmb.scene.hinges import AngularCoordinate, Gimbal, Revolute, Spherical
from flexmb.scene.schema import Closure, Free, Load, Marker, Planar, PointMass, Scene, SpringDamper, Wheel
from flexmb.surrogate import modal_points

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


SIX = tuple(tuple(10.0 * (i + 1) if i == j else 0.0 for j in range(6)) for i in range(6))
PUSH = Sine(amplitude=2.0, angular_frequency_rad_s=3.0)


@cache
def everything() -> Scene:
    """A scene with something for every mutation to change."""
    swing = AngularCoordinate(
        angle_rad=0.3,
        rate_rad_s=0.2,
        stiffness_Nm_rad=3.0,
        damping_Nms_rad=0.1,
        rest_rad=0.1,
        armature_kg_m2=0.2,
        torque_Nm=PUSH,
    )
    skew = ((0.2, 0.01, 0.02), (0.01, 0.3, 0.03), (0.02, 0.03, 0.4))
    hub = RigidBody(
        name="hub", mass_kg=4.0, com_m=(0.1, 0.2, 0.0), inertia_kg_m2=skew,
        nodes=(Node(name="port", position_m=(0.5, 0.0, 0.0), quaternion=TURNED),),
    )  # fmt: skip
    boom = msgspec.structs.replace(SCENE.bodies[1], modes=Modes(count=2, damping_ratio=0.01), nodes=())
    stations = tuple(
        msgspec.structs.replace(station, rotary_y_kg_m=1e-4, rotary_z_kg_m=2e-4, GAy_N=1e5, GAz_N=1e5)
        for station in boom.stations
    )
    boom = msgspec.structs.replace(boom, stations=stations)
    tip = msgspec.structs.replace(hub, name="tip")
    return Scene(
        name="everything",
        gravity_m_s2=(0.0, 1.0, -9.81),
        bodies=(hub, boom, tip),
        hinges=(
            Free(
                name="flight", parent="ground", child="hub", quaternion=TURNED, angular_velocity_rad_s=(0.1, 0.2, 0.3),
                velocity_m_s=(1.0, 0.0, 0.0),
            ),
            Gimbal(
                name="root", parent="hub", parent_node="port", child="boom", parent_quaternion=TURNED,
                parent_position_m=(0.1, 0.0, 0.0), sequence="xyz", rotations=(swing, swing, swing),
            ),
            Revolute(name="end", parent="boom", parent_node="tip", child="tip", rotation=swing),
        ),
        closures=(
            Closure(
                name="loop", type="revolute", body_a="ground", body_b="tip", node_b="port",
                position_a_m=(1.0, 0.0, 0.0), quaternion_a=TURNED,
            ),
        ),
        couplings=(
            Coupling(
                name="gear", hinge="end", offset=0.2,
                terms=(CoupledCoordinate(hinge="root", coordinate="rotations[0]", ratio=1.5),),
            ),
        ),
        wheels=(
            Wheel(
                name="wheel", body="hub", offset_m=(0.1, 0.0, 0.0), axis=(0.0, 0.0, 1.0), mass_kg=1.0,
                axial_inertia_kg_m2=0.1, transverse_inertia_kg_m2=0.06, speed_rad_s=3.0, friction_Nms_rad=0.1,
                torque_Nm=PUSH,
            ),
        ),
        point_masses=(PointMass(name="lump", body="hub", mass_kg=0.1),),
        connectors=(
            SpringDamper(
                name="spring", body_a="hub", body_b="tip", free_length_m=0.5, stiffness_N_m=10.0, damping_Ns_m=0.1,
                preload_N=1.0, position_a_m=(0.1, 0.0, 0.0), acts="tension", force_N=PUSH,
            ),
            Bushing(name="mount", body_a="hub", body_b="tip", quaternion_a=TURNED, stiffness=SIX),
            AngularSpring(
                name="stops", hinge="end", lower_rad=-1.0, upper_rad=1.0, stop_stiffness_Nm_rad=100.0,
                stop_dissipation_s_rad=0.1,
            ),
            AngularFriction(name="rubbing", hinge="end", sliding_Nm=1.0, smoothing_rad_s=0.1),
        ),
        sensors=(
            MarkerSensor(name="gyro", marker="tip", quantity="angular_velocity"),
            CoordinateSensor(name="elbow", of="end"),
            ProfileSensor(name="course", function=PUSH),
        ),
        controllers=(
            StateSpace(
                name="law", inputs=("gyro", "course[0]"), A=((0.5,),), B=((1.0, 0.0, 0.0, 0.0),), C=((2.0,),),
                period_s=0.1, delay_s=0.05,
            ),
            Pid(name="servo", inputs=("elbow",), kp=2.0, setpoint=0.5, lower=-1.0, upper=1.0),
        ),
        events=(
            SceneEvent(
                name="caught", watch="end.rotation", level=1.0,
                actions=(
                    Latch(coordinate="end.rotation"), Impact(coordinate="wheel.angle", restitution=0.5),
                    Change(path="push.function", value=PUSH),
                ),
            ),
        ),
        markers=(Marker(name="tip", body="tip"),),
        loads=(Load(name="push", body="hub", node="port", type="force", direction=(1.0, 0.0, 0.0), function=PUSH),),
    )  # fmt: skip


def beside_its_axis() -> Scene:
    """The scene with a beam whose sections are stated off its axis."""
    hub, boom, *others = everything().bodies
    stations = tuple(msgspec.structs.replace(station, reference_point_m=(0.02, 0.01)) for station in boom.stations)
    bodies = (hub, msgspec.structs.replace(boom, stations=stations), *others)
    return msgspec.structs.replace(everything(), bodies=bodies)


@pytest.mark.parametrize("mutation", get_args(MutationKind))
def test_every_mutation_has_a_target_and_leaves_the_rest_as_it_was(mutation: MutationKind) -> None:
    scene = beside_its_axis() if mutation == "section_point" else everything()
    targets = applicable(scene, CATALOGUE[mutation])
    assert targets
    for target in targets:
        changed = mutate(scene, mutation, target.name)
        collections = {place.split(".")[1].split("[")[0] for place in changes(scene, changed)}
        assert len(collections) == 1
        if mutation in ("damping", "damping_dropped", "stiffness", "mass"):
            check_scene(changed)


@pytest.mark.parametrize(
    ("mutation", "target", "places"),
    [
        ("connector_one_sided", "spring", {"connectors[0].acts"}),
        ("connector_stop", "stops", {"connectors[2].lower_rad", "connectors[2].upper_rad"}),
        ("friction_speed", "rubbing", {"connectors[3].smoothing_rad_s"}),
        ("bushing_ends", "mount", {f"connectors[1].{key}" for key in ("body_a", "body_b")}
            | {f"connectors[1].quaternion_{end}[{i}]" for end in "ab" for i in (0, 2)}),
        ("bushing_order", "mount", {f"connectors[1].stiffness[{i}][{i}]" for i in range(6)}),
        ("coupling_ratio", "gear", {"couplings[0].terms[0].ratio"}),
        ("coupling_sign", "gear", {"couplings[0].terms[0].ratio"}),
        ("coupling_offset", "gear", {"couplings[0].offset"}),
        ("motor_sign", "spring", {"connectors[0].force_N.amplitude"}),
        ("function_size", "course", {"sensors[2].function.amplitude"}),
        ("controller_gain", "law", {"controllers[0].C[0][0]"}),
        ("controller_offset", "law", {"controllers[0].offset_s"}),
        ("controller_limit", "servo", {"controllers[1].lower", "controllers[1].upper"}),
        ("sensor_frame", "gyro", {"sensors[0].frame"}),
        ("event_level", "caught", {"events[0].level"}),
        ("event_hold", "caught", {"events[0].actions[0]"}),
        ("event_restitution", "caught", {"events[0].actions[1].restitution"}),
        ("event_value", "caught", {"events[0].actions[2].value.amplitude"}),
    ],
)  # fmt: skip
def test_a_mutation_of_the_new_elements_changes_just_its_place(
    mutation: MutationKind, target: str, places: set[str]
) -> None:
    assert changes(everything(), mutate(everything(), mutation, target)) == {f"$.{place}" for place in places}


def test_a_level_comes_later_on_the_way_from_the_start() -> None:
    """From 0.3 rad to 1 rad by a hundredth of 0.7 rad; and whichever way it may be crossed, not the one it is."""
    assert mutate(everything(), "event_level", "caught").events[0].level == pytest.approx(1.007)
    assert mutate(everything(), "event_crossing", "caught").events[0].crossing == "falling"


def test_a_sensor_is_reversed_by_what_stands_behind_it() -> None:
    reverse, law, servo = mutate(everything(), "sensor_sign", "gyro").controllers
    assert reverse.inputs == ("gyro",) and reverse.D == ((-1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0))
    assert (reverse.period_s, reverse.offset_s, reverse.delay_s) == (0.1, 0.0, 0.0)
    assert law.inputs == ("gyro reversed", "course[0]") and servo == everything().controllers[1]


def test_components_are_exchanged_in_all_that_read_them() -> None:
    law, _ = mutate(everything(), "sensor_component", "gyro").controllers
    assert law.inputs == ("gyro[1]", "gyro[0]", "gyro[2]", "course[0]")
    law, _ = mutate(everything(), "sensor_component", "course").controllers
    assert law.inputs == ("gyro", "course[1]")


@pytest.mark.parametrize(
    ("mutation", "target", "message"),
    [
        ("connector_one_sided", "mount", "acts both ways"),
        ("bushing_order", "spring", "a bushing has"),
        ("controller_delay", "servo", "is continuous"),
        ("sensor_sign", "nothing", "no sensor whose numbers"),
        ("sensor_component", "elbow", "has one number"),
        ("sensor_frame", "course", "in no axes"),
        ("function_size", "gyro", "no hinge, wheel, load, actuator or profile"),
    ],
)
def test_what_an_element_does_not_have_is_refused(mutation: MutationKind, target: str, message: str) -> None:
    with pytest.raises(CaseError, match=message):
        mutate(everything(), mutation, target)


def test_a_node_that_a_connector_is_fixed_to_is_not_idle() -> None:
    spring = SpringDamper(name="s", body_a="ground", body_b="hub", node_b="port", stiffness_N_m=1.0)
    assert "nothing is mounted" in CATALOGUE["node_position"].idle(SCENE, "hub.port")
    assert CATALOGUE["node_position"].idle(msgspec.structs.replace(SCENE, connectors=(spring,)), "hub.port") == ""


def test_the_catalogue_is_the_list_of_names_that_a_run_file_may_use() -> None:
    assert set(CATALOGUE) == set(get_args(MutationKind))
    assert len(CATALOGUE) >= 20
    assert all(each.what and each.slip for each in CATALOGUE.values())


def test_a_mode_s_sign_at_the_nodes_is_not_that_in_the_inertia() -> None:
    """The beam becomes its points and modes, and only the nodes' first mode is the opposite."""
    (target,) = applicable(everything(), CATALOGUE["mode_sign"])
    true = modal_points(everything()).bodies[1]
    spoilt = mutate(everything(), "mode_sign", target.name).bodies[1]
    assert spoilt.points == true.points and spoilt.stiffness == true.stiffness
    for one, other in zip(true.nodes, spoilt.nodes, strict=True):
        np.testing.assert_array_equal(np.array(other.translation_modes[0]), -np.array(one.translation_modes[0]))
        assert other.translation_modes[1:] == one.translation_modes[1:]


@pytest.mark.parametrize(
    ("motion", "start"),
    [
        (Ramp(value=0.4, rate=2.0, start_s=1.0), 0.4 - 2.0),
        (Sine(amplitude=0.5, angular_frequency_rad_s=2.0, phase_rad=0.7, offset=0.1), 0.1 + 0.5 * np.sin(0.7)),
        (SmoothStep(start_value=-1.0, end_value=2.0, start_s=0.1, duration_s=1.0), -1.0),
    ],
)
def test_a_farther_prescribed_motion_begins_where_it_did(motion: Ramp | Sine | SmoothStep, start: float) -> None:
    driven = Revolute(name="base", parent="ground", child="hub", rotation=AngularCoordinate(prescribed_rad=motion))
    scene = msgspec.structs.replace(SCENE, hinges=(driven, *SCENE.hinges[1:]))
    changed = mutate(scene, "function_size", "base").hinges[0].rotation.prescribed_rad
    assert changed != motion
    match changed:
        case Ramp():
            begins = changed.value - changed.rate * changed.start_s
        case Sine():
            begins = changed.offset + changed.amplitude * np.sin(changed.phase_rad)
        case SmoothStep():
            begins = changed.start_value
    assert begins == pytest.approx(start, abs=1e-15)


def planar(*axes: tuple[float, float, float]) -> Scene:
    """A chain of rods on revolute hinges about these axes."""
    rods = tuple(
        RigidBody(name=f"rod{i}", mass_kg=1.0, inertia_kg_m2=((0.1, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))
        for i in range(len(axes))
    )
    parents = ("ground", *(rod.name for rod in rods))
    hinges = tuple(
        Revolute(name=f"h{i}", parent=parents[i], child=rod.name, axis=axes[i]) for i, rod in enumerate(rods)
    )
    return Scene(name="chain", bodies=rods, hinges=hinges)


Y, Z = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


@pytest.mark.parametrize(
    ("axes", "idle"), [((Y,), True), ((Z,), False), ((Y, Y), True), ((Z, Y), False), ((Y, (0.0, -1.0, 0.0)), True)]
)
def test_only_the_inertia_about_its_axis_matters_to_a_body_on_parallel_hinges(axes: tuple, idle: bool) -> None:
    """x and z exchanged in a rod along x: about y nothing changes, about z and in space it does."""
    scene = planar(*axes)
    assert bool(CATALOGUE["inertia_swapped"].idle(scene, scene.bodies[-1].name)) == idle


def test_a_flexible_or_free_carrier_leaves_no_only_axis() -> None:
    hinges = (Planar(name="flat", parent="ground", child="hub"), *SCENE.hinges[1:])
    scene = msgspec.structs.replace(SCENE, hinges=hinges)
    assert CATALOGUE["inertia_swapped"].idle(scene, "tip") == ""
    assert CATALOGUE["inertia_swapped"].idle(everything(), "hub") == ""


@pytest.mark.parametrize("quaternion", [(0.0, 0.6, 0.0, 0.8), (1.0, 0.0, 0.0, 0.0)])
def test_a_half_turn_transposed_is_itself(quaternion: tuple[float, float, float, float]) -> None:
    base = Revolute(name="base", parent="ground", child="hub", parent_quaternion=quaternion)
    scene = msgspec.structs.replace(SCENE, hinges=(base, *SCENE.hinges[1:]))
    assert "half-turn" in CATALOGUE["hinge_rotation"].idle(scene, "base")
    assert CATALOGUE["hinge_rotation"].idle(SCENE, "base") == ""


def test_strains_become_modes_of_small_deflection() -> None:
    """A beam of level exact loses what its level adds; of one that is curved, no other level could say anything."""
    boom = next(body for body in SCENE.bodies if isinstance(body, BeamBody))
    bent = msgspec.structs.replace(boom, level="exact", modes=Modes(count=6, families=("bending_y",), pieces=2))
    hub, _, tip = SCENE.bodies
    scene = msgspec.structs.replace(SCENE, bodies=(hub, bent, tip))
    for name, level in (("dropped_stiffening", "full"), ("dropped_deformation", "ruthless")):
        changed = mutate(scene, name, "boom").bodies[1]
        assert isinstance(changed, BeamBody) and changed.level == level
        assert changed.modes == Modes(count=6, families=("bending_y",)) and changed.elements == 12
        check_scene(mutate(scene, name, "boom"))
    stations = tuple(msgspec.structs.replace(station, curvature_1_m=(0.0, 0.5, 0.0)) for station in bent.stations)
    arc = msgspec.structs.replace(SCENE, bodies=(hub, msgspec.structs.replace(bent, stations=stations), tip))
    for name in ("dropped_stiffening", "dropped_deformation", "mode_sign"):
        with pytest.raises(CaseError):
            mutate(arc, name, "boom")
