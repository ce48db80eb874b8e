"""Random scenes whose closures are as often superfluous as not: doubled, parallel to a hinge, between bodies that move
as one, across a driven hinge. Same seed, same scene."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import get_args, get_type_hints

import msgspec
import numpy as np
from numpy.random import Generator

from flexmb.dense import DenseSystem
from flexmb.scene import schema as s
from flexmb.scene.build import angular, linear
from flexmb.scene.hinges import WITH_AXIS
from tests import trees
from tests.flexmb.closure import chains

EVERY = get_args(get_type_hints(s.Closure)["type"])
LATER = ("in_line", "in_plane")
KINDS = tuple(kind for kind in EVERY if kind not in LATER)
"""Kinds that are drawn unless others are asked for, so that the random loops of a seed stay what they are."""
SUPERFLUOUS = ("null", "doubled", "parallel", "driven")
SITUATIONS = (*SUPERFLUOUS, "loop")
_HINGES = (*trees.KINDS, "weld", "weld")
_SMALL = {"bodies": 4, "wheels": 1, "point_masses": 1, "hinges": _HINGES}
RECIPES = (
    replace(trees.RIGID, **_SMALL),
    replace(trees.FULL, **_SMALL, deformation=0.01),
    replace(trees.RIGID, **_SMALL, prescribed=False, branching=False),
    replace(trees.MIXED, **_SMALL, deformation=0.01),
    replace(trees.FREE_FLYING, **_SMALL),
    replace(trees.LINEAR, **_SMALL, deformation=0.01, prescribed=False),
    replace(trees.STIFFENED, **_SMALL, deformation=0.01),
)

# Of the first 80 seeds those with a body between joints of a loop whose mass decides how near to singular the loop is:
# with the mass times 1e-8 the least pivot of the rows is 1.5e-5 to 1.4e-3 of its size. Of seed 42 the body is a leaf.
LIGHT = {11: "b3", 29: "b2", 42: "b2", 44: "b3", 72: "b2"}
RATIOS = (1.0, 1e-4, 1e-6, 1e-8)


@cache
def random_loops(seed: int, kinds: tuple[str, ...] = KINDS) -> s.Scene:
    """A tree of `RECIPES`, a group of three more bodies on it, and one to three closures of `SITUATIONS` and `kinds`.

    The group: "r0" welded to the tree or to the ground, "r1" welded to "r0", and "r2" driven against "r1".
    """
    rng = np.random.default_rng([seed, 11])
    scene = _with_group(trees.random_scene(seed, RECIPES[seed % len(RECIPES)]), rng)
    dense = DenseSystem(scene)
    closures: list[s.Closure] = []
    for i in range(1 + seed % 3):
        situation = SITUATIONS[(seed // 3 + i) % len(SITUATIONS)]
        closures.append(_closure(scene, dense, rng, f"c{i}", situation, kinds[(seed + i) % len(kinds)], closures))
    return msgspec.structs.replace(scene, closures=tuple(closures))


def lighter(scene: s.Scene, names: tuple[str, ...], ratio: float) -> s.Scene:
    """The scene with mass and inertia of rigid bodies times `ratio`."""

    def light(body: s.RigidBody) -> s.RigidBody:
        inertia = tuple(tuple(ratio * each for each in row) for row in body.inertia_kg_m2)
        return msgspec.structs.replace(body, mass_kg=ratio * body.mass_kg, inertia_kg_m2=inertia)

    assert set(names) <= {body.name for body in scene.bodies if isinstance(body, s.RigidBody)}
    bodies = tuple(light(body) if body.name in names else body for body in scene.bodies)
    return msgspec.structs.replace(scene, bodies=bodies)


def light_loops(seed: int, ratio: float) -> s.Scene:
    """`random_loops` of a seed of `LIGHT` with the mass of that body times `ratio`."""
    return lighter(random_loops(seed), (LIGHT[seed],), ratio)


def contradictory(seed: int) -> s.Scene:
    """The same tree with one closure, a weld across the driven hinge."""
    rng = np.random.default_rng([seed, 12])
    scene = _with_group(trees.random_scene(seed, RECIPES[seed % len(RECIPES)]), rng)
    guess = s.Closure(name="c0", type="weld", body_a="r1", body_b="r2")
    closure = chains.closed(scene, DenseSystem(scene), guess, np.eye(3), np.zeros(3))
    return msgspec.structs.replace(scene, closures=(closure,))


def _with_group(scene: s.Scene, rng: Generator) -> s.Scene:
    carrier = scene.bodies[int(rng.integers(len(scene.bodies)))].name
    parent, node = ("ground", "origin") if rng.random() < 0.4 else (carrier, str(rng.choice(_nodes(scene, carrier))))
    if rng.random() < 0.5:
        axis = tuple(trees.direction(rng))
        drive = s.Revolute(**_joint(rng, "turn", "r1", "r2"), axis=axis, rotation=angular(prescribed=_motion(rng)))
    else:
        axis = tuple(trees.direction(rng))
        drive = s.Prismatic(**_joint(rng, "push", "r1", "r2"), axis=axis, translation=linear(prescribed=_motion(rng)))
    hinges = (
        s.Weld(**_joint(rng, "g0", parent, "r0"), parent_node=node), s.Weld(**_joint(rng, "g1", "r0", "r1")), drive
    )  # fmt: skip
    bodies = tuple(_body(rng, f"r{i}") for i in range(3))
    return msgspec.structs.replace(scene, bodies=scene.bodies + bodies, hinges=scene.hinges + hinges)


def _body(rng: Generator, name: str) -> s.RigidBody:
    mass = float(rng.uniform(0.5, 2.0))
    tensor = trees.matrix(trees.inertia(rng, mass, 0.6))
    corner = s.Node(name="corner", position_m=tuple(trees.vector(rng, 0.5)), quaternion=tuple(trees.quaternion(rng)))
    com = tuple(trees.vector(rng, 0.2))
    return s.RigidBody(name=name, mass_kg=mass, com_m=com, inertia_kg_m2=tensor, nodes=(corner,))


def _joint(rng: Generator, name: str, parent: str, child: str) -> dict:
    place = {f"{side}_position_m": tuple(trees.vector(rng, 0.3)) for side in ("parent", "child")}
    turned = {f"{side}_quaternion": tuple(trees.quaternion(rng)) for side in ("parent", "child")}
    return {"name": name, "parent": parent, "child": child} | place | turned


def _motion(rng: Generator) -> s.Function:
    return s.Sine(amplitude=0.3, angular_frequency_rad_s=rng.uniform(1.0, 3.0), phase_rad=rng.uniform(-1.0, 1.0))


def _nodes(scene: s.Scene, name: str) -> list[str]:
    body = next(body for body in scene.bodies if body.name == name)
    return list(chains.rest_frames(body))


def _closure(
    scene: s.Scene, dense: DenseSystem, rng: Generator, name: str, situation: str, kind: str, before: list[s.Closure]
) -> s.Closure:
    if situation == "null":
        other = "ground" if scene.hinges[-3].parent == "ground" else "r0"
        return chains.random_closure(scene, dense, rng, name, kind, *map(str, rng.permutation([other, "r1"])))
    if situation == "doubled" and before:
        return msgspec.structs.replace(before[-1], name=name)
    if situation == "parallel":
        like = [hinge for hinge in scene.hinges[:-3] if type(hinge).__name__.lower() in KINDS]
        if like:
            hinge = like[int(rng.integers(len(like)))]
            return parallel(name, type(hinge).__name__.lower(), hinge, scene)
    if situation == "driven":
        hinge = scene.hinges[-1]
        return parallel(name, "revolute" if hinge.name == "turn" else "prismatic", hinge, scene)
    bodies = [body.name for body in scene.bodies if body.name.startswith("b")]
    body_a, body_b = rng.permutation(["ground", *bodies] if not before else bodies)[:2]
    return chains.random_closure(scene, dense, rng, name, kind, str(body_a), str(body_b))


def parallel(name: str, kind: str, hinge: s.Hinge, scene: s.Scene) -> s.Closure:
    """A closure between the frames of a hinge."""
    z = (0.0, 0.0, 1.0)
    return s.Closure(
        name=name, type=kind, body_a=hinge.parent, node_a=hinge.parent_node, position_a_m=hinge.parent_position_m,
        quaternion_a=hinge.parent_quaternion, body_b=hinge.child, node_b=hinge.child_node,
        position_b_m=hinge.child_position_m, quaternion_b=hinge.child_quaternion,
        axis=getattr(hinge, "axis", z) if kind in WITH_AXIS else z,
    )  # fmt: skip
