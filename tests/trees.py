"""Random scenes: trees with every hinge kind, rigid and flexible bodies, wheels, point masses, springs and loads.

Same seed, same scene. Initial values are random too, so that the scene's own initial state is a random state in every
code.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, get_args

import msgspec
import numpy as np
from numpy.random import Generator
from scipy.spatial.transform import Rotation

from flexmb.modal.flexible import flexible_model
from flexmb.scene import schema as s
from flexmb.scene.build import SceneBuilder, angular, linear
from flexmb.scene.check import check_scene
from flexmb.scene.convert import plain
from flexmb.scene.hinges import WITH_AXIS
from flexmb.scene.modal_data import inertia_points
from flexmb.scene.sections import inertia_on_axis, restated, stiffness_on_axis, transport
from flexmb.scene.sections import matrix as section_matrix
from flexmb.scene.shapes import beam_section
from flexmb.scene.tree import coordinates, with_coordinates
from flexmb.system.system import System
from flexmb.system.watches import WAIVERS
from flexmb.tables.state import State

STRUCTS = {struct.__struct_config__.tag: struct for struct in get_args(s.Hinge)}
# A new kind is none of these, so that the random scenes of a seed stay what they are; it is drawn by `LATER_KINDS`.
KINDS = (
    "revolute", "spherical", "prismatic", "universal", "free", "cylindrical", "gimbal", "planar", "weld", "gimbal2",
)  # fmt: skip
LATER_KINDS = tuple(kind for kind in STRUCTS if kind not in KINDS)
REQUIRED = {"pitch_m_rad": 0.3}
"""Values of keys that have no default."""
CARRIERS = ("rigid", "modal", "beam", "floating")


@dataclass(frozen=True)
class Recipe:
    """What a random scene contains.

    `carriers`: kinds of bodies, drawn in turn: "rigid", "modal" (raw, clamped), "floating" (raw, free-free), "beam",
    "blade" (a beam whose sections couple everything), "masses" (raw, clamped, points without inertia). `at_clamps`:
    hinges sit where the modes of the outboard body are clamped, unless it floats. `conservative` leaves out dampers,
    motors, loads and prescribed motion.
    `hinges`: kinds drawn in turn. `armatures`: two of three coordinates of hinges and point masses have one, of the
    size of the bodies' inertia; they are drawn apart, so that all else of a scene is the same without them.
    """

    bodies: int = 10
    carriers: tuple[str, ...] = CARRIERS
    levels: tuple[s.Level, ...] = ("full",)
    hinges: tuple[str, ...] = KINDS
    branching: bool = True
    grounded: bool = True
    conservative: bool = False
    prescribed: bool = True
    wheels: int = 2
    point_masses: int = 2
    beam_points: tuple[str, ...] = ("section", "rotary", "line")
    deformation: float = 0.1
    at_clamps: bool = False
    armatures: bool = False


RIGID = Recipe(carriers=("rigid",))
SINGLE = Recipe(bodies=60, carriers=("rigid",), hinges=("revolute", "prismatic", "revolute"), conservative=True,
                prescribed=False, wheels=0, point_masses=0, armatures=True)  # fmt: skip
"""Rigid bodies on single axes alone, in branches longer than a base point serves."""
FULL = Recipe()
RUTHLESS = Recipe(levels=("ruthless",))
LINEAR = Recipe(levels=("linear",))
STIFFENED = Recipe(levels=("stiffened", "full", "stiffened"))
EXACT = Recipe(carriers=("beam", "modal", "beam", "rigid", "beam"), levels=("exact",))
"""Beams whose strains are polynomials, each kind of `_strains` in turn; modal bodies are of level full."""
MIXED = Recipe(levels=("full", "ruthless", "rigid"))
EVERY_LEVEL = Recipe(levels=("linear", "full", "linear", "ruthless", "rigid"))
ARMED = replace(EVERY_LEVEL, armatures=True, hinges=(*KINDS, *LATER_KINDS))
ARMED_RIGID = replace(RIGID, armatures=True, hinges=(*KINDS, *LATER_KINDS))
BLADES = Recipe(bodies=6, carriers=("blade", "rigid"), levels=("linear", "full", "stiffened", "ruthless", "rigid"))
LATER = Recipe(hinges=(*LATER_KINDS, "spherical", *LATER_KINDS, "prismatic"))
CONSERVATIVE = Recipe(conservative=True, prescribed=False)
FREE_FLYING = replace(CONSERVATIVE, grounded=False)


def random_scene(seed: int, recipe: Recipe = FULL) -> s.Scene:
    """A checked scene of `recipe`; bodies "b0", "b1" ..., their hinges "h0" ..., markers "m0" ... at random nodes."""
    rng = np.random.default_rng(seed)
    gravity = vector(rng, 5.0) if recipe.grounded else np.zeros(3)
    scene = SceneBuilder(f"random tree {seed}", gravity=gravity, allow=("uncut_beam", *WAIVERS))
    kinds = list(rng.permutation(recipe.hinges))
    carriers = list(rng.permutation(recipe.carriers))
    nodes: list[list[str]] = []
    for k in range(recipe.bodies):
        carrier = carriers[k % len(carriers)]
        level = recipe.levels[k % len(recipe.levels)]
        if level == "exact" and carrier != "beam":  # strains belong to beams
            level = "full"
        nodes.append(_body(scene, rng, f"b{k}", carrier, level, recipe))
        parent = int(rng.integers(-1 if recipe.grounded else 0, k)) if k > 1 and recipe.branching else k - 1
        kind = "free" if k == 0 and not recipe.grounded else kinds[k % len(kinds)]
        at = {} if parent < 0 else {"parent_node": str(rng.choice(nodes[parent]))}
        child_node = nodes[k][0] if recipe.at_clamps else str(rng.choice(nodes[k]))
        place = _placement(rng) | at | {"child_node": child_node}
        _hinge(scene, rng, kind, f"h{k}", "ground" if parent < 0 else f"b{parent}", f"b{k}", place, recipe)
        scene.marker(f"m{k}", f"b{k}", node=str(rng.choice(nodes[k])), offset=vector(rng, 0.2))
    _wheels(scene, rng, nodes, recipe)
    _point_masses(scene, rng, nodes, recipe)
    if not recipe.conservative:
        _loads(scene, rng, nodes)
    return with_armatures(scene.scene(), seed) if recipe.armatures else scene.scene()


def with_armatures(scene: s.Scene, seed: int) -> s.Scene:
    """The scene with armatures of two of three scalar coordinates."""
    rng = np.random.default_rng((seed, 27))

    def armed(item: Any) -> Any:
        drawn = [
            msgspec.structs.replace(each, **{each.ARMATURE: float(rng.uniform(0.05, 1.0) * (rng.random() < 2.0 / 3.0))})
            for _, each in coordinates(item)
        ]
        return with_coordinates(item, drawn)

    found = msgspec.structs.replace(
        scene, hinges=tuple(map(armed, scene.hinges)), point_masses=tuple(map(armed, scene.point_masses))
    )
    check_scene(found)
    return found


def vector(rng: Generator, size: float) -> np.ndarray:
    """Uniform in a cube of half edge `size`."""
    return rng.uniform(-size, size, 3)


def direction(rng: Generator) -> np.ndarray:
    """A random unit vector."""
    x = rng.normal(size=3)
    return x / np.linalg.norm(x)


def quaternion(rng: Generator) -> np.ndarray:
    """A random unit quaternion, scalar first."""
    return Rotation.random(random_state=rng).as_quat(scalar_first=True, canonical=True)


def inertia(rng: Generator, mass: float, size: float) -> np.ndarray:
    """Tensor (3,3) of a homogeneous cuboid of random edges and attitude: it fulfils the triangle inequality."""
    x, y, z = rng.uniform(0.3 * size, size, 3) ** 2
    R = Rotation.random(random_state=rng).as_matrix()
    tensor = R @ np.diag([y + z, x + z, x + y]) @ R.T * mass / 12.0
    return 0.5 * (tensor + tensor.T)


def _body(
    scene: SceneBuilder, rng: Generator, name: str, carrier: str, level: s.Level, recipe: Recipe
) -> list[str]:
    """Append a body; returns the nodes that hinges may use."""
    if carrier == "rigid":
        mass = rng.uniform(0.5, 2.0)
        corner = s.Node(name="corner", position_m=tuple(vector(rng, 0.5)), quaternion=tuple(quaternion(rng)))
        scene.rigid_body(name, mass=mass, com=vector(rng, 0.2), inertia=inertia(rng, mass, 0.6), nodes=[corner])
        return ["origin", "corner"]
    if carrier == "beam" and level == "exact":
        _exact_beam(scene, rng, name, recipe)
        return ["root", "tip", "middle"]
    if carrier in ("beam", "blade"):
        modes = _beam(scene, rng, name, level, recipe, coupled=carrier == "blade")
        nodes = ["root", "tip", "middle"]
    else:
        modes = 3
        _modal(
            scene, rng, name, level, modes, floating=carrier == "floating", lossless=recipe.conservative,
            rotary=carrier != "masses",
        )  # fmt: skip
        nodes = ["a", "b"] if carrier == "floating" else ["origin", "a", "b"]
    if level != "rigid":
        size = recipe.deformation if carrier not in ("beam", "blade") else 0.3 * recipe.deformation
        scene.modal_state(name, coordinates=rng.uniform(-size, size, modes), rates=rng.uniform(-size, size, modes))
    return nodes


def _beam(
    scene: SceneBuilder, rng: Generator, name: str, level: s.Level, recipe: Recipe, *, coupled: bool
) -> int:  # fmt: skip
    length = rng.uniform(0.8, 1.5)
    root = beam_section(E=2e9, G=8e8, A=9e-4, Iy=8e-8, Iz=5e-8, rho=1500.0)
    tip = beam_section(E=2e9, G=8e8, A=6e-4, Iy=5e-8, Iz=3e-8, rho=1500.0, x=length)
    theory = "euler-bernoulli"
    if coupled:
        theory, root, tip = "timoshenko", _coupled(root, rng), _coupled(tip, rng)
    lump = s.TipMass(
        x_m=length, mass_kg=0.2, com_m=tuple(vector(rng, 0.05)), inertia_kg_m2=matrix(inertia(rng, 0.2, 0.1))
    )
    middle = s.BeamNode(name="middle", x_m=0.55 * length, quaternion=tuple(quaternion(rng)))
    scene.beam(
        name, length=length, elements=3, section=[root, tip], level=level, tip_masses=[lump], nodes=[middle],
        modes=s.Modes(count=4, damping_ratio=0.0 if recipe.conservative else 0.02),
        points=str(rng.choice(recipe.beam_points)), theory=theory,
    )  # fmt: skip
    return 4


def _exact_beam(scene: SceneBuilder, rng: Generator, name: str, recipe: Recipe) -> None:
    """A beam of level exact, with a tip mass and a lump along it, bent by some 4 recipe.deformation radians."""
    length, (modes, curvature, theory) = rng.uniform(0.8, 1.5), _strains(int(name.removeprefix("b")))
    shear = {"GAy_N": 4e4, "GAz_N": 3e4}
    root, tip = (
        msgspec.structs.replace(
            beam_section(E=2e9, G=8e8, A=A, Iy=Iy, Iz=Iz, rho=1500.0, x=x), EA_N=5e4, rotary_y_kg_m=rotary,
            rotary_z_kg_m=0.8 * rotary, curvature_1_m=tuple(share * np.array(curvature)), **shear,
        )
        for A, Iy, Iz, x, rotary, share in (
            (9e-4, 8e-8, 5e-8, 0.0, 2e-3, 1.0), (6e-4, 5e-8, 3e-8, length, 1e-3, 0.6),
        )
    )  # fmt: skip
    lumps = [
        s.TipMass(x_m=x, mass_kg=0.2, com_m=tuple(vector(rng, 0.05)), inertia_kg_m2=matrix(inertia(rng, 0.2, 0.1)))
        for x in (length, 0.4 * length)
    ]
    middle = s.BeamNode(name="middle", x_m=0.55 * length, quaternion=tuple(quaternion(rng)))
    damping = {} if recipe.conservative else {"damping_ratio": 0.01, "viscosity_s": 1e-3}
    beam: dict[str, Any] = {
        "length": length, "elements": 3, "section": [root, tip], "level": "exact", "tip_masses": lumps,
        "nodes": [middle], "modes": msgspec.structs.replace(modes, cuts=(), **damping),
        "points": "section", "theory": theory,
    }  # fmt: skip
    scene.beam(name, **beam)
    alone = SceneBuilder("alone").beam(name, **beam).weld("clamp", "ground", name).scene()
    frequency = np.sqrt(np.diag(flexible_model(alone.bodies[0]).stiffness))
    size = 40.0 * recipe.deformation / frequency
    coordinates, rates = (rng.uniform(-size, size) for _ in range(2))
    scene.modal_state(name, coordinates=coordinates, rates=rates)


def _strains(kind: int) -> tuple[s.Modes, tuple[float, float, float], str]:
    """Strains, curvature at rest (1/m) and theory of one of six kinds of beams of level exact."""
    euler, timoshenko = "euler-bernoulli", "timoshenko"
    one_plane, planes = ("bending_z",), ("bending_z", "bending_y")
    six = s.StrainPolynomials(axial=1, shear_y=1, shear_z=2, torsion=2, bending_y=3, bending_z=3)
    return (
        (s.Modes(count=3, families=one_plane), (0.0, 0.0, 0.0), euler),
        (s.Modes(count=2, families=("torsion", *planes)), (0.0, 0.0, 0.0), euler),
        (s.Modes(count=3, polynomials=six), (0.4, 0.3, -0.5), timoshenko),
        (s.Modes(count=2, pieces=2, families=("torsion", *planes)), (0.0, 0.6, 0.4), euler),
        (s.Modes(count=3, families=("bending_y",)), (0.0, 0.0, 0.7), timoshenko),
        (s.Modes(count=2, families=planes, points=5), (1.0, 0.0, 0.0), euler),
    )[kind % 6]


def _coupled(section: s.BeamStation, rng: Generator) -> s.BeamStation:
    """The section with correlations of all strains and its mass centre off the axis, stated at a random point."""
    stiffness, inertia = stiffness_on_axis(section), inertia_on_axis(section)
    size, random = np.sqrt(np.diag(stiffness)), np.triu(rng.uniform(-0.15, 0.15, (6, 6)), 1)
    stiffness += (random + random.T) * np.outer(size, size)
    T = transport(rng.uniform(-0.02, 0.02, 2))
    on_axis = s.BeamStation(
        x_m=section.x_m, stiffness=section_matrix(stiffness), inertia=section_matrix(T.T @ inertia @ T)
    )
    return restated(on_axis, tuple(rng.uniform(-0.02, 0.02, 2)))


def _modal(
    scene: SceneBuilder, rng: Generator, name: str, level: s.Level, modes: int, *, floating: bool, lossless: bool,
    rotary: bool,
) -> None:  # fmt: skip
    """Points with mass and, if `rotary`, offset mass centres and turning tensors, moved by arbitrary assumed modes."""
    n = 5
    masses = rng.uniform(0.1, 0.4, n)
    # drawn apart, so that a scene is the same at every level
    curving = np.random.default_rng(sum(name.encode())) if level == "stiffened" else None
    points = inertia_points(
        masses, rng.uniform(-0.6, 0.6, (n, 3)), rng.uniform(-1.0, 1.0, (n, 3, modes)),
        rotation_modes=rng.uniform(-2.0, 2.0, (n, 3, modes)),
        inertia=rotary * np.array([inertia(rng, m, 0.3) for m in masses]),
        com_offset=rotary * rng.uniform(-0.1, 0.1, (n, 3)),
        **({} if curving is None else _curved(curving, (n,), modes)),
    )  # fmt: skip
    root = rng.normal(size=(modes, modes))
    loss = rng.normal(size=(modes, modes)) * (not lossless)
    nodes = [
        s.ModalNode(
            name=node, position_m=tuple(vector(rng, 0.5)), quaternion=tuple(quaternion(rng)),
            translation_modes=matrix(rng.uniform(-1.0, 1.0, (modes, 3))),
            rotation_modes=matrix(rng.uniform(-2.0, 2.0, (modes, 3))),
            **({} if curving is None else {key: plain(np.moveaxis(G, 0, -1))
                                           for key, G in _curved(curving, (), modes).items()}),
        )
        for node in ("a", "b")
    ]  # fmt: skip
    scene.modal_body(
        name, points=points, stiffness=300.0 * (root @ root.T + np.eye(modes)), damping=0.2 * loss @ loss.T,
        boundary="free-free" if floating else "clamped-free", level=level, nodes=nodes,
    )  # fmt: skip


def _curved(rng: Generator, points: tuple[int, ...], modes: int) -> dict[str, np.ndarray]:
    """A second-order field (points,3,m,m) of no symmetry but its own; only the symmetric part acts."""
    shape = (*points, 3, modes, modes)
    return {"second_translation": rng.uniform(-0.5, 0.5, shape), "second_rotation": rng.uniform(-0.5, 0.5, shape)}


def matrix(rows: np.ndarray) -> tuple[tuple[float, ...], ...]:
    """Rows of an array as the schema's tuples."""
    return tuple(tuple(map(float, row)) for row in rows)


def _placement(rng: Generator) -> dict:
    return {
        "parent_position": vector(rng, 0.3), "parent_quaternion": quaternion(rng),
        "child_position": vector(rng, 0.2), "child_quaternion": quaternion(rng),
    }  # fmt: skip


def _profile(rng: Generator, size: float) -> s.Function:
    sine = s.Sine(amplitude=size, angular_frequency_rad_s=rng.uniform(1.0, 3.0), phase_rad=rng.uniform(-1.0, 1.0))
    times = np.linspace(0.0, 4.0, 9)
    table = s.Table(times_s=tuple(times), values=tuple(rng.uniform(-0.3 * size, 0.3 * size, len(times))))
    step = s.SmoothStep(start_value=0.0, end_value=size, start_s=-0.5, duration_s=2.0)
    return (sine, table, step, s.SpinUp(rate=size, duration_s=2.0))[rng.integers(4)]


def _angle(rng: Generator, recipe: Recipe) -> s.AngularCoordinate:
    """A random state with a spring; unless conservative a damper and a motor, or prescribed motion."""
    if recipe.prescribed and rng.random() < 0.25:
        return angular(prescribed=_profile(rng, 1.0))
    lossy = {} if recipe.conservative else {"damping": rng.uniform(0.1, 1.0), "torque": _profile(rng, 2.0)}
    return angular(
        angle=rng.uniform(-1.2, 1.2), rate=rng.uniform(-2, 2), stiffness=rng.uniform(1, 20), rest=0.2, **lossy
    )


def _displacement(rng: Generator, recipe: Recipe) -> s.LinearCoordinate:
    if recipe.prescribed and rng.random() < 0.25:
        return linear(prescribed=_profile(rng, 0.3))
    lossy = {} if recipe.conservative else {"damping": rng.uniform(0.1, 1.0), "force": _profile(rng, 2.0)}
    return linear(
        position=rng.uniform(-0.3, 0.3), rate=rng.uniform(-1, 1), stiffness=rng.uniform(20, 90), rest=0.1, **lossy
    )


def _hinge(
    scene: SceneBuilder, rng: Generator, kind: str, name: str, parent: str, child: str, place: dict, recipe: Recipe
) -> None:
    def angle() -> s.AngularCoordinate:
        return _angle(rng, recipe)

    def displacement() -> s.LinearCoordinate:
        return _displacement(rng, recipe)

    joint = {"name": name, "parent": parent, "child": child} | _struct_placement(place)
    axis = tuple(direction(rng))
    loss = 0.0 if recipe.conservative else 0.3
    match kind:
        case "gimbal":
            sequence = str(rng.choice(["xyz", "zxz", "yzx"]))
            # the middle angle of zxz stays away from zero, that of xyz from a right angle
            middle = angular(angle=rng.uniform(0.5, 1.0), rate=rng.uniform(-1, 1), stiffness=5.0)
            scene.add(s.Gimbal(**joint, sequence=sequence, rotations=(angle(), middle, angle())))
        case "gimbal2":
            scene.add(s.Gimbal(**joint, sequence="zy", rotations=(angle(), angle())))
        case "spherical":
            scene.spherical(
                name, parent, child, **place, quaternion=quaternion(rng), angular_velocity=vector(rng, 2.0),
                stiffness=5.0, damping=loss,
            )  # fmt: skip
        case "free":
            scene.free(
                name, parent, child, **place, position=vector(rng, 1.0), quaternion=quaternion(rng),
                angular_velocity=vector(rng, 2.0), velocity=vector(rng, 1.0),
            )  # fmt: skip
        case _:
            drawn = {s.AngularCoordinate: angle, s.LinearCoordinate: displacement}
            own = {key: drawn[type(c)]() for key, c in scalar_coordinates(STRUCTS[kind])}
            axes = {"axis": axis} if kind in WITH_AXIS else {}
            scene.add(bare(STRUCTS[kind], **joint, **axes, **own))


def bare(struct: type, **values: Any) -> Any:
    """A hinge of some kind with nothing but these values, and what it requires."""
    return struct(**{key: value for key, value in REQUIRED.items() if key in struct.__struct_fields__}, **values)


def scalar_coordinates(struct: type) -> list[tuple[str, s.AngularCoordinate | s.LinearCoordinate]]:
    """(key, default) of every field of a hinge's struct that is a scalar coordinate."""
    defaults = [(field.name, field.default) for field in msgspec.structs.fields(struct)]
    return [(key, c) for key, c in defaults if isinstance(c, s.AngularCoordinate | s.LinearCoordinate)]


def _struct_placement(place: dict) -> dict:
    """Builder keywords as schema keys."""
    units = {"parent_position": "parent_position_m", "child_position": "child_position_m"}
    return {units.get(key, key): value if isinstance(value, str) else tuple(value) for key, value in place.items()}


def _seat(rng: Generator, nodes: list[list[str]]) -> dict:
    k = int(rng.integers(len(nodes)))
    return {"body": f"b{k}", "node": str(rng.choice(nodes[k])), "offset": vector(rng, 0.1)}


def _wheels(scene: SceneBuilder, rng: Generator, nodes: list[list[str]], recipe: Recipe) -> None:
    for i in range(recipe.wheels):
        motion = {"angle": rng.uniform(-1, 1), "speed": rng.uniform(-20, 20)}
        if recipe.prescribed and i == 0:
            motion = {"prescribed": _profile(rng, 5.0)}
        elif not recipe.conservative:
            motion |= {"friction": 0.01, "torque": _profile(rng, 0.5)}
        scene.wheel(
            f"w{i}", **_seat(rng, nodes), axis=direction(rng), mass=0.3, axial_inertia=0.02, transverse_inertia=0.012,
            **motion,
        )  # fmt: skip


def _point_masses(scene: SceneBuilder, rng: Generator, nodes: list[list[str]], recipe: Recipe) -> None:
    for i in range(recipe.point_masses):
        free = 1 + i % 3
        directions = Rotation.random(random_state=rng).as_matrix()[:free]
        scene.point_mass(
            f"p{i}", **_seat(rng, nodes), mass=0.2, directions=directions,
            coordinates=[_displacement(rng, recipe) for _ in range(free)],
        )  # fmt: skip


def _loads(scene: SceneBuilder, rng: Generator, nodes: list[list[str]]) -> None:
    for i, (add, frame) in enumerate([(scene.force, "world"), (scene.force, "node"), (scene.torque, "node")]):
        seat = _seat(rng, nodes)
        del seat["offset"]
        add(f"l{i}", **seat, direction=direction(rng), frame=frame, function=_profile(rng, 3.0))


def deformed(system: System, scale: float) -> State:
    """The initial state with modal coordinates and rates times `scale`."""
    state = system.initial_state
    for body in system.scene.bodies:
        if not isinstance(body, s.RigidBody):
            state.q[system.coordinate(f"{body.name}.modes")] *= scale
            state.u[system.speed(f"{body.name}.modes")] *= scale
    return state
