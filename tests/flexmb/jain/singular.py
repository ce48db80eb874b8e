"""Families of scenes whose mass matrix is singular, or misses it by a given share of an inertia.

Bodies have random places, masses and speeds, so that no zero comes out as an exact zero. `share` 0 makes the mass
matrix singular; else it is definite with a condition of about 1/share.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.random import Generator
from scipy.spatial.transform import Rotation

from flexmb import State, System
from flexmb.scene import schema as s
from flexmb.scene.build import SceneBuilder, angular, linear
from flexmb.scene.modal_data import inertia_points
from tests.trees import direction, inertia, matrix, quaternion, vector


def _builder(name: str, rng: Generator) -> SceneBuilder:
    """With a massive body "base" that a ball holds to the ground."""
    scene = SceneBuilder(name, gravity=vector(rng, 5.0))
    _massive(scene, rng, "base")
    place, spin = vector(rng, 0.5), vector(rng, 1.0)
    return scene.spherical("mount", "ground", "base", child_position=place, angular_velocity=spin)


def _massive(scene: SceneBuilder, rng: Generator, name: str) -> None:
    mass = rng.uniform(0.5, 2.0)
    scene.rigid_body(name, mass=mass, com=vector(rng, 0.4), inertia=inertia(rng, mass, 0.6))


def _tiny(scene: SceneBuilder, rng: Generator, name: str, share: float) -> None:
    scene.rigid_body(name, mass=share, com=vector(rng, 0.4), inertia=share * inertia(rng, 1.0, 0.6))


def two_points(seed: int, share: float) -> s.Scene:
    """Six modes move two massy points in every way there is: a turn about the hinge is one of them.

    A third point, of a share of their mass, is moved by the hinge alone.
    """
    rng = np.random.default_rng(seed)
    scene = _builder(f"two points {seed}", rng)
    masses, shapes = np.append(rng.uniform(0.3, 2.0, 2), share), rng.uniform(-1.0, 1.0, (3, 3, 6))
    shapes[2] = 0.0
    points = inertia_points(masses, np.vstack([rng.uniform(-1.0, 1.0, (2, 3)), vector(rng, 1.0)]), shapes)
    root = rng.normal(size=(6, 6))
    scene.modal_body("flexible", points=points if share else points[:2], stiffness=50.0 * (root @ root.T + np.eye(6)))
    scene.modal_state("flexible", coordinates=rng.uniform(-0.1, 0.1, 6), rates=rng.uniform(-0.1, 0.1, 6))
    return scene.revolute(
        "pin", "base", "flexible", axis=direction(rng), parent_position=vector(rng, 0.5), **_angle(rng)
    ).scene()


def coincident_axes(seed: int, share: float) -> s.Scene:
    """A body without mass between two revolutes about the same axis."""
    rng = np.random.default_rng(seed)
    scene = _builder(f"coincident axes {seed}", rng)
    _tiny(scene, rng, "between", share)
    _massive(scene, rng, "outer")
    axis, turn = direction(rng), Rotation.random(random_state=rng)
    place, along = vector(rng, 0.5), rng.uniform(-0.5, 0.5)
    scene.revolute("first", "base", "between", axis=axis, parent_position=vector(rng, 0.5), child_position=place,
                   child_quaternion=turn.as_quat(scalar_first=True), **_angle(rng))  # fmt: skip
    return scene.revolute(
        "second", "between", "outer", axis=axis, parent_position=place + along * turn.apply(axis),
        parent_quaternion=turn.as_quat(scalar_first=True), child_position=vector(rng, 0.5), **_angle(rng),
    ).scene()  # fmt: skip


def locked_gimbal(seed: int, share: float) -> s.Scene:
    """A gimbal whose first and last axis `state` aligns but for the root of `share`, with a revolute beyond."""
    rng = np.random.default_rng(seed)
    scene = _builder(f"locked gimbal {seed}", rng)
    _massive(scene, rng, "inner")
    _massive(scene, rng, "outer")
    middle = angular(angle=0.5 * np.pi - np.sqrt(max(share, 0.1)), rate=rng.uniform(-0.1, 0.1))
    rotations = (angular(**_angle(rng)), middle, angular(**_angle(rng)))
    scene.gimbal("gimbal", "base", "inner", sequence="xyz", rotations=rotations,
                 parent_quaternion=quaternion(rng), child_position=vector(rng, 0.5))  # fmt: skip
    return scene.revolute(
        "pin", "inner", "outer", axis=direction(rng), parent_position=vector(rng, 0.5), child_position=vector(rng, 0.5),
        **_angle(rng),
    ).scene()  # fmt: skip


def one_line(seed: int, share: float) -> s.Scene:
    """A point mass slides on a body without mass along the line on which that slides itself."""
    rng = np.random.default_rng(seed)
    scene = _builder(f"one line {seed}", rng)
    _tiny(scene, rng, "slider", share)
    axis = direction(rng)
    scene.prismatic("slide", "base", "slider", axis=axis, parent_position=vector(rng, 0.5),
                    parent_quaternion=quaternion(rng), **_displacement(rng))  # fmt: skip
    return scene.point_mass(
        "bead", "slider", mass=rng.uniform(0.5, 2.0), offset=vector(rng, 0.5), directions=[tuple(axis)],
        coordinates=[linear(**_displacement(rng))],
    ).scene()  # fmt: skip


def in_all_directions(seed: int, share: float) -> s.Scene:
    """A point mass free in space in a body without mass, which slides: of the mass nothing is left to slide."""
    rng = np.random.default_rng(seed)
    scene = _builder(f"in all directions {seed}", rng)
    _tiny(scene, rng, "slider", share)
    scene.prismatic("slide", "base", "slider", axis=direction(rng), parent_position=vector(rng, 0.5),
                    parent_quaternion=quaternion(rng), **_displacement(rng))  # fmt: skip
    return scene.point_mass(
        "bead", "slider", mass=rng.uniform(0.5, 2.0), offset=vector(rng, 0.5),
        directions=matrix(Rotation.random(random_state=rng).as_matrix()),
        coordinates=[linear(**_displacement(rng))] * 3,
    ).scene()  # fmt: skip


def _angle(rng: Generator) -> dict[str, Any]:
    return {"angle": rng.uniform(-1.0, 1.0), "rate": rng.uniform(-1.0, 1.0), "stiffness": rng.uniform(1.0, 9.0)}


def _displacement(rng: Generator) -> dict[str, Any]:
    return {"position": rng.uniform(-0.3, 0.3), "rate": rng.uniform(-1.0, 1.0), "stiffness": rng.uniform(20.0, 90.0)}


def state(system: System, share: float) -> State:
    """The system's start; a gimbal is turned to its lock, where no scene may start."""
    q = system.initial_state.q
    if system.scene.hinges[1].name == "gimbal":
        q[system.coordinate("gimbal")][1] = 0.5 * np.pi - np.sqrt(share)
    return system.state(q, system.initial_state.u)


FAMILIES: dict[str, Callable[[int, float], s.Scene]] = {
    each.__name__: each for each in (two_points, coincident_axes, locked_gimbal, one_line, in_all_directions)
}
