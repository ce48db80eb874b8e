"""Counterparts give the same loads, motion and energies at one state, for every kind of hinge, body and load; what is
changed by half is noticed.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import msgspec
import numpy as np
import pytest

from crosscheck.engines.contract import Run
from crosscheck.engines.native import NativeEngine
from crosscheck.engines.trajectories import signals_of, stack
from crosscheck.library.channels import LINEAR_KINDS, is_judged, known_to
from crosscheck.library.find import resolve
from crosscheck.mutation.invariances import INVARIANCES, Counterpart, Invariance, NotApplicable
from crosscheck.mutation.invariances.counterpart import Channels
from crosscheck.mutation.invariances.later import LATER
from crosscheck.mutation.invariances.restated import RESTATED
from flexmb.run.channels import channels_of, distance, family, magnitude
from flexmb.scene.bodies import BeamBody, BeamStation
from flexmb.scene.build import SceneBuilder, linear
from flexmb.scene.files import load_scene
from flexmb.scene.functions import Pulse, Sine
from flexmb.scene.schema import Modes, Scene, Screw, StrainPolynomials
from flexmb.scene.sections import matrix
from flexmb.scene.shapes import beam_section
from flexmb.surrogate import modal_points
from tests.crosscheck.engines.random_scenes import LATER_KINDS
from tests.crosscheck.engines.random_scenes import random_scene as random_rigid
from tests.crosscheck.engines.test_couplings import machine
from tests.flexmb.modal.coupled_references import coupled_stiffness, section_mass, station
from tests.repo.project import ROOT
from tests.trees import random_scene as random_flexible

BY_NAME = {invariance.name: invariance for invariance in INVARIANCES}
AT = np.array([0.0])
BOUND = 1e-9  # of a family's size: rounding, times what a mass matrix of random bodies makes of it
KINDS = ("free", "revolute", "prismatic", "cylindrical", "universal", "gimbal2", "gimbal3", "spherical", "planar")


@cache
def rigid() -> Scene:
    """Every kind of hinge, on a body that flies, with wheels, point masses, loads and prescribed motion."""
    rng = np.random.default_rng(3)
    while True:
        scene = random_rigid(rng, KINDS, driven=True)
        if sum(hinge.parent == "ground" for hinge in scene.hinges) == 1:
            return scene


@cache
def flexible() -> Scene:
    return modal_points(random_flexible(5))


def seen(scene: Scene) -> Channels:
    """All channels (1, k) at the scene's initial state."""
    snapshot = NativeEngine().compile(scene).evaluate()
    return channels_of(stack(AT, [snapshot], message="", wall_s=0.0, evaluations=1))


def strangers(scene: Scene, counterpart: Counterpart) -> list[str]:
    """Channels in which a counterpart, told back, is another than the scene."""
    true, told = seen(scene), counterpart.back(AT, seen(counterpart.scene))
    sizes: dict[str, float] = {}
    for name, values in true.items():
        sizes[family(name)] = max(sizes.get(family(name), 0.0), magnitude(name, values))
    return [
        name for name, values in told.items() if distance(name, values, true[name])[0] > BOUND * sizes[family(name)]
    ]


# One is seen in runs alone: it begins at another time; one needs beams.
@pytest.mark.parametrize(
    "invariance",
    [invariance for invariance in INVARIANCES if invariance not in (LATER, RESTATED)],
    ids=lambda each: each.name,
)
def test_nothing_changes_in_a_scene_of_every_hinge(invariance: Invariance) -> None:
    counterpart = invariance.of(rigid())
    assert counterpart.scene != rigid()
    assert strangers(rigid(), counterpart) == []


@cache
def later_kinds() -> Scene:
    """Kinds of hinges that the random scenes above do not draw, free and driven, with springs."""
    return random_rigid(np.random.default_rng(9), ("free", *LATER_KINDS, "revolute", *LATER_KINDS), driven=True)


def test_a_screw_that_keeps_its_hand_in_a_mirror_is_noticed() -> None:
    counterpart = BY_NAME["mirrored"].of(later_kinds())
    kept = {hinge.name: hinge.pitch_m_rad for hinge in later_kinds().hinges if isinstance(hinge, Screw)}
    hinges = tuple(
        msgspec.structs.replace(hinge, pitch_m_rad=kept[hinge.name]) if isinstance(hinge, Screw) else hinge
        for hinge in counterpart.scene.hinges
    )
    wrong = msgspec.structs.replace(counterpart.scene, hinges=hinges)
    assert kept
    assert strangers(later_kinds(), replace(counterpart, scene=wrong))


@cache
def connected() -> Scene:
    """Every kind of connector, none of them at rest."""
    scene = load_scene(ROOT / "cases" / "connectors" / "sprung_platform" / "scene.toml")
    moved = msgspec.structs.replace(scene.hinges[1], position_m=(0.01, -0.02, 0.03), quaternion=(0.96, 0.0, 0.28, 0.0))
    return msgspec.structs.replace(scene, hinges=(scene.hinges[0], moved, *scene.hinges[2:]))


@pytest.mark.parametrize("name", ["rescaled", "mirrored"])
@pytest.mark.filterwarnings("ignore:.*the closures do not allow these values")
def test_ratios_that_stay_what_they_were_are_noticed(name: str) -> None:
    counterpart = BY_NAME[name].of(machine())
    wrong = msgspec.structs.replace(counterpart.scene, couplings=machine().couplings)
    assert strangers(machine(), replace(counterpart, scene=wrong))


@cache
def driven_masses() -> Scene:
    """Point masses along one to three directions, of which some are driven along a function of time."""
    ways = np.eye(3)
    moved, free = linear(prescribed=Sine(amplitude=0.2, angular_frequency_rad_s=3.0)), linear()
    builder = SceneBuilder("driven masses", gravity=(0.3, -0.5, -9.81)).rigid_body("hub", mass=5.0, inertia=(1, 2, 2.5))
    builder.free("joint", "ground", "hub", angular_velocity=(0.3, 0.4, -0.2))
    builder.rigid_body("arm", mass=1.0, com=(0.4, 0.0, 0.0), inertia=(0.1, 0.2, 0.2))
    builder.revolute("elbow", "hub", "arm", parent_position=(0.0, 0.3, 0.0), stiffness=5.0)  # loads to measure by
    for count, which in ((1, [moved]), (2, [free, moved]), (3, [moved, free, moved])):
        offset = (0.5, 0.1 * count, 0.3)
        builder.point_mass(f"mass {count}", "hub", mass=0.4, offset=offset, directions=ways[:count], coordinates=which)
    return builder.scene()


# One is seen in runs alone: it begins at another time; one needs beams.
@pytest.mark.parametrize(
    "invariance",
    [invariance for invariance in INVARIANCES if invariance not in (LATER, RESTATED)],
    ids=lambda each: each.name,
)
def test_nothing_changes_in_a_scene_of_driven_point_masses(invariance: Invariance) -> None:
    counterpart = invariance.of(driven_masses())
    assert sum(name.startswith("drive:") for name in seen(driven_masses())) == 3
    assert strangers(driven_masses(), counterpart) == []


@pytest.mark.parametrize("key", ["stiffening", "stiffness", "damping", "table_m", "free_length_m"])
def test_a_connector_left_in_its_units_is_noticed(key: str) -> None:
    whole = BY_NAME["rescaled"].of(connected())
    pairs = zip(whole.scene.connectors, connected().connectors, strict=True)
    spoilt = tuple(
        msgspec.structs.replace(new, **{key: getattr(old, key)}) if hasattr(old, key) else new for new, old in pairs
    )
    scene = msgspec.structs.replace(whole.scene, connectors=spoilt)
    assert strangers(connected(), Counterpart(scene, whole.back, whole.clock))


def _still_gravity(scene: Scene) -> Scene:
    return msgspec.structs.replace(scene, gravity_m_s2=rigid().gravity_m_s2)


def _still_loads(scene: Scene) -> Scene:
    return msgspec.structs.replace(scene, loads=rigid().loads)


def _still_hinges(scene: Scene) -> Scene:
    return msgspec.structs.replace(scene, hinges=rigid().hinges)


def _still_wheels(scene: Scene) -> Scene:
    return msgspec.structs.replace(scene, wheels=rigid().wheels)


def _still_inertia(scene: Scene) -> Scene:
    first = msgspec.structs.replace(scene.bodies[0], inertia_kg_m2=rigid().bodies[0].inertia_kg_m2)
    return msgspec.structs.replace(scene, bodies=(first, *scene.bodies[1:]))


@pytest.mark.parametrize(
    ("name", "spoil"),
    [
        ("turned", _still_gravity),
        ("turned", _still_loads),
        ("turned", _still_hinges),
        ("moved", _still_hinges),
        ("boosted", _still_hinges),
        ("mirrored", _still_gravity),
        ("mirrored", _still_loads),
        ("mirrored", _still_wheels),
        ("mirrored", _still_inertia),
        ("rescaled", _still_gravity),
        ("rescaled", _still_loads),
        ("rescaled", _still_inertia),
    ],
)
def test_what_is_changed_by_half_is_noticed(name: str, spoil: Callable[[Scene], Scene]) -> None:
    whole = BY_NAME[name].of(rigid())
    assert strangers(rigid(), Counterpart(spoil(whole.scene), whole.back, whole.clock))


@pytest.mark.parametrize("name", ["turned", "moved", "boosted", "rescaled", "mirrored"])
def test_channels_that_are_not_told_back_are_noticed(name: str) -> None:
    whole = BY_NAME[name].of(rigid())
    assert strangers(rigid(), Counterpart(whole.scene, lambda times, channels: channels))


def test_what_stands_on_the_ground_is_not_boosted() -> None:
    scene = random_rigid(np.random.default_rng(0), ("revolute",))
    with pytest.raises(NotApplicable, match="stands on the ground by h0"):
        BY_NAME["boosted"].of(scene)


def test_loads_that_no_motion_determines_are_not_told_in_other_units() -> None:
    """Of Bennett's linkage with four revolutes, all; of its determined twin, none."""
    (case,) = resolve(("bennett",))
    left_out = {}
    for variant in case.run.variants:
        scene = case.scene(variant)
        told = BY_NAME["rescaled"].of(scene).back(AT, channels := seen(scene))
        left_out[variant.name] = {name.partition(".")[0] for name in set(channels) - set(told)}
        assert strangers(scene, BY_NAME["rescaled"].of(scene)) == []
    assert left_out["slide and ball"] == set()
    assert len(left_out["four revolutes"]) == 5


def test_what_needs_a_start_time_has_no_other_clock() -> None:
    pulse = Pulse(value=1.0, start_s=0.0, duration_s=1.0)
    loads = tuple(msgspec.structs.replace(load, function=pulse) for load in rigid().loads)
    with pytest.raises(NotApplicable, match="pulse"):
        BY_NAME["clock"].of(msgspec.structs.replace(rigid(), loads=loads))


def test_one_of_each_thing_has_no_order() -> None:
    scene = random_rigid(np.random.default_rng(0), ("revolute",), extras=False)
    with pytest.raises(NotApplicable, match="one of each"):
        BY_NAME["reordered"].of(scene)


def linearised(scene: Scene) -> Channels:
    """Channels of the linearised motion at the scene's initial state."""
    engine, run = NativeEngine(), Run(np.array([0.0, 1e-6]), ("derivatives", "frequencies"))
    trajectory = engine.compile(scene).simulate(run, engine.efforts(scene)[0])
    channels = signals_of(trajectory).items()
    return {name: rows[:1] for name, rows in channels if name.partition(".")[0] in LINEAR_KINDS}


def linear_strangers(scene: Scene, counterpart: Counterpart) -> dict[str, float]:
    """Differences of linear channels that are more than both are known to."""
    assert counterpart.linear is not None
    true, told = linearised(scene), counterpart.linear.back(linearised(counterpart.scene))
    found = {}
    for name, values in told.items():
        if is_judged(name):
            known = true[known_to(name)] + told[known_to(name)]
            found[name] = float(np.linalg.norm(values - true[name]) / known[0, 0])
    return {name: ratio for name, ratio in found.items() if not ratio <= 1.0}


@pytest.mark.parametrize(("scene", "name"), [
    *((rigid, name) for name in ("turned", "moved", "reordered", "rescaled", "mirrored")),
    *((scene, name) for scene in (flexible, later_kinds) for name in ("reordered", "rescaled", "mirrored")),
])  # fmt: skip
def test_the_linearised_motion_does_not_change(scene: Callable[[], Scene], name: str) -> None:
    """Within what the engine says of itself. By other ratios of the coordinates it would."""
    counterpart = BY_NAME[name].of(scene())
    linear = counterpart.linear
    assert linear is not None and linear.scale is not None
    assert linear_strangers(scene(), counterpart) == {}
    wrong = linear.scale.copy()
    wrong[0] *= -2.0
    changed = linear_strangers(scene(), replace(counterpart, linear=replace(linear, scale=wrong)))
    assert {"derivatives.by_displacement", "derivatives.by_speed", "derivatives.by_force"} == set(changed)
    slower = linear_strangers(scene(), replace(counterpart, linear=replace(linear, time=3.0 * linear.time)))
    assert {"derivatives.by_speed", "frequencies"} <= set(slower)


def test_modes_that_are_made_anew_have_no_common_coordinates() -> None:
    beam = load_scene(ROOT / "cases" / "linearised" / "cantilever" / "scene.toml")
    mirrored, rescaled = BY_NAME["mirrored"].of(beam), BY_NAME["rescaled"].of(beam)
    assert mirrored.linear is not None and set(mirrored.linear.back(linearised(mirrored.scene))) == {
        "frequencies", "known_to.frequencies",
    }  # fmt: skip
    assert linear_strangers(beam, mirrored) == {}
    assert rescaled.linear is None


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
    assert (
        len({station.reference_point_m for station in stations}) == 6
    )  # root and tip of the blades and of two other beams
    assert all(station.stiffness is not None and station.inertia is not None for station in stations)
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


SCENES = {
    "flexible bodies": flexible, "later kinds of hinges": later_kinds, "connectors": connected, "couplings": machine,
    "coupled sections": _without_states,
}  # fmt: skip


@pytest.mark.parametrize("name", ["turned", "moved", "reordered", "rescaled", "mirrored"])
@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
def test_nothing_changes_in_scenes_of_other_kinds(scene: Callable[[], Scene], name: str) -> None:
    counterpart = BY_NAME[name].of(scene())
    assert counterpart.scene != scene()
    assert strangers(scene(), counterpart) == []
