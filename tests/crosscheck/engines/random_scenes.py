"""Random scenes of rigid bodies: every hinge kind, turned frames, springs, dampers, motors, wheels, point masses."""

from collections.abc import Sequence

import numpy as np
from numpy.random import Generator

from crosscheck.engines.conventions import quaternion_of
from flexmb.scene.build import SceneBuilder, angular, linear
from flexmb.scene.collecting import make
from flexmb.scene.functions import Constant, Sine
from flexmb.scene.hinges import WITH_AXIS
from flexmb.scene.keys import split_unit
from flexmb.scene.schema import AngularCoordinate, Gimbal, Hinge, LinearCoordinate, Node, Scene, Spherical
from tests.crosscheck.engines.randomise import randomise
from tests.trees import LATER_KINDS as LATER_KINDS
from tests.trees import REQUIRED, STRUCTS, scalar_coordinates

# A new kind is none of these, so that the random scenes of a seed stay what they are; it is one of `LATER_KINDS`.
KINDS = (
    "weld", "revolute", "prismatic", "cylindrical", "universal", "gimbal2", "gimbal3", "spherical", "planar", "free",
)  # fmt: skip


def unit(rng: Generator) -> np.ndarray:
    v = rng.normal(size=3)
    return v / np.linalg.norm(v)


def rotation(rng: Generator) -> np.ndarray:
    Q, R = np.linalg.qr(rng.normal(size=(3, 3)))
    Q *= np.sign(np.diag(R))
    return Q * np.linalg.det(Q)


def inertia(rng: Generator, mass: float) -> np.ndarray:
    """A possible inertia tensor: trace(S) 1 - S of a positive second moment of mass S."""
    A = rng.normal(size=(3, 3))
    S = mass * (0.02 * A @ A.T + 0.01 * np.eye(3))
    return np.trace(S) * np.eye(3) - S


def random_scene(
    rng: Generator, kinds: Sequence[str], *, driven: bool = False, extras: bool = True, nodes: bool = True
) -> Scene:
    """A tree with one body per entry of `kinds`, at a random state.

    `driven` prescribes some coordinates; `extras` adds wheels, point masses and loads; `nodes` attaches hinges to nodes
    off the body frames.
    """
    builder = SceneBuilder("random tree", gravity=rng.uniform(-5.0, 5.0, 3))
    parents = ["ground"]
    for i, kind in enumerate(kinds):
        name, mass = f"b{i}", rng.uniform(0.5, 3.0)
        node = make(Node, name="n", position=rng.normal(size=3) * 0.5, quaternion=_quaternion(rng))
        builder.rigid_body(name, mass=mass, com=rng.normal(size=3) * 0.2, inertia=inertia(rng, mass), nodes=(node,))
        parent = str(rng.choice(parents[-3:]))
        builder.add(_hinge(rng, kind, f"h{i}", parent, name, driven and i % 2 == 1, nodes))
        builder.marker(f"m{i}", name, node="n", offset=rng.normal(size=3) * 0.2)
        parents.append(name)
        if extras:
            _add_extras(builder, rng, name, i, driven)
    return randomise(builder.scene(), rng)


def _hinge(rng: Generator, kind: str, name: str, parent: str, child: str, driven: bool, nodes: bool) -> Hinge:
    """A hinge of the kind with springs at a random place; `driven` prescribes its first coordinate."""
    values = {
        "name": name, "parent": parent, "child": child,
        "parent_node": "n" if nodes and parent != "ground" else "origin",
        "child_node": str(rng.choice(["n", "origin"])) if nodes else "origin",
        "parent_position": rng.normal(size=3) * 0.3, "parent_quaternion": _quaternion(rng),
        "child_position": rng.normal(size=3) * 0.3, "child_quaternion": _quaternion(rng),
    }  # fmt: skip

    def turn(drives: bool = False) -> AngularCoordinate:
        return angular(**_coordinate(rng, "torque", drives))

    def shift(drives: bool = False) -> LinearCoordinate:
        return linear(**_coordinate(rng, "force", drives))

    match kind:
        case "gimbal2":
            return make(Gimbal, sequence="zx", rotations=(turn(driven), turn()), **values)
        case "gimbal3":
            return make(Gimbal, sequence="zyx", rotations=(turn(driven), turn(), turn()), **values)
        case "spherical":
            return make(Spherical, stiffness=rng.uniform(1.0, 5.0), damping=rng.uniform(0.1, 0.5), **values)
    axis = {"axis": unit(rng)} if kind in WITH_AXIS else {}
    keys = STRUCTS[kind].__struct_fields__
    required = {split_unit(key)[0]: value for key, value in REQUIRED.items() if key in keys}
    drawn = {AngularCoordinate: turn, LinearCoordinate: shift}
    own = {key: drawn[type(c)](driven and i == 0) for i, (key, c) in enumerate(scalar_coordinates(STRUCTS[kind]))}
    return make(STRUCTS[kind], **axis, **own, **values, **required)


def _coordinate(rng: Generator, motor: str, driven: bool) -> dict:
    values = {"stiffness": rng.uniform(1.0, 5.0), "rest": rng.uniform(-0.3, 0.3), "damping": rng.uniform(0.1, 0.5)}
    if driven:
        values["prescribed"] = Sine(amplitude=0.4, angular_frequency_rad_s=rng.uniform(1.0, 3.0), phase_rad=0.3)
    else:
        values[motor] = Constant(value=rng.uniform(-2.0, 2.0))
    return values


def _add_extras(builder: SceneBuilder, rng: Generator, body: str, i: int, driven: bool) -> None:
    """By turns: a wheel, a moving point mass and a fixed one, a load."""
    wave = Sine(amplitude=1.0, angular_frequency_rad_s=2.0, phase_rad=0.5)
    offset = rng.normal(size=3) * 0.1
    match i % 4:
        case 0:
            motion = {"prescribed": wave} if driven else {"torque": Constant(value=0.3)}
            builder.wheel(
                f"wheel{i}", body, node="n", offset=offset, axis=unit(rng), mass=rng.uniform(0.1, 0.5),
                axial_inertia=0.02, transverse_inertia=0.013, friction=0.002, **motion,
            )  # fmt: skip
        case 1:
            directions = list(rotation(rng)[: rng.integers(1, 4)])
            springs = [linear(stiffness=rng.uniform(5.0, 20.0), damping=0.1) for _ in directions]
            builder.point_mass(
                f"point{i}", body, node="n", mass=0.2, offset=offset, directions=directions, coordinates=springs
            )  # fmt: skip
            builder.point_mass(f"fixed{i}", body, mass=0.1, offset=-offset)
        case 2:
            builder.force(f"force{i}", body, node="n", direction=unit(rng), function=wave)
            builder.force(f"follower{i}", body, node="n", direction=unit(rng), function=wave, frame="node")
        case 3:
            builder.torque(f"torque{i}", body, direction=unit(rng), function=wave)
            builder.torque(f"turning{i}", body, node="n", direction=unit(rng), function=wave, frame="node")


def _quaternion(rng: Generator) -> np.ndarray:
    return quaternion_of(rotation(rng))
