"""Bodies whose mass centre stays at rest: without gravity their mass does not affect motion, loads or energies."""

from __future__ import annotations

from typing import assert_never

import numpy as np

from crosscheck.library.mutations.mirror import only_known
from flexmb.scene.bodies import IDENTITY, BeamBody, Body, RigidBody, SidBody
from flexmb.scene.freedoms import Ball, Floating, Freedom, ScalarFreedom
from flexmb.scene.hinges import Free, Hinge, Weld
from flexmb.scene.quaternions import rotation_matrix
from flexmb.scene.schema import Scene
from flexmb.scene.strains import families
from flexmb.scene.tree import GROUND, node_frame

EPS = 1e-12


def rests(scene: Scene, name: str) -> str:
    """Why the mass of body `name` is idle: its mass centre, or a bar's axis, rests without gravity. "" if it is not."""
    body = next(body for body in scene.bodies if body.name == name)
    hinge = next(hinge for hinge in scene.hinges if hinge.child == name)
    if any(scene.gravity_m_s2) or hinge.parent != GROUND or not only_known(scene):
        return ""
    if _held(body, hinge):
        return "the mass centre stays where it is, and there is no gravity"
    if isinstance(hinge, Free) and _free(scene, body, hinge):
        return "no force acts and the mass centre is at rest: the mass has no part in the rotation"
    return ""


def twists_only(body: Body) -> bool:
    """Whether a beam's only modes are those of torsion, so that its axis stays straight."""
    return isinstance(body, BeamBody) and set(families(body)) == {"torsion"}


def is_clamped_along_world(scene: Scene, name: str) -> bool:
    """Whether the body is welded to the ground with its axes, and those of its nodes, along World's."""
    body = next(body for body in scene.bodies if body.name == name)
    hinge = next(hinge for hinge in scene.hinges if hinge.child == name)
    nodes = [] if isinstance(body, SidBody) else [node.quaternion for node in body.nodes]
    turned = [*nodes, hinge.parent_quaternion, hinge.child_quaternion]
    return isinstance(hinge, Weld) and hinge.parent == GROUND and all(quaternion == IDENTITY for quaternion in turned)


def _held(body: Body, hinge: Hinge) -> bool:
    """By a hinge to the ground, in the mass centre or on an axis through it."""
    freedoms = hinge.freedoms
    if not freedoms:
        return isinstance(body, RigidBody) or twists_only(body)
    if not isinstance(body, RigidBody) or not all(map(_only_turns, freedoms)):
        return False
    node = node_frame(body, hinge.child_node)
    turned = rotation_matrix(node.quaternion)
    arm = np.asarray(body.com_m) - np.asarray(node.position) - turned @ np.asarray(hinge.child_position_m)
    if len(freedoms) == 1 and isinstance(freedoms[0], ScalarFreedom):
        arm = np.cross(turned @ rotation_matrix(hinge.child_quaternion) @ np.asarray(freedoms[0].axis), arm)
    return bool(np.max(np.abs(arm)) <= EPS)


def _only_turns(freedom: Freedom) -> bool:
    match freedom:
        case ScalarFreedom():
            return not freedom.shifts
        case Ball():
            return True
        case Floating():
            return False
        case _:
            assert_never(freedom)


def _free(scene: Scene, body: Body, hinge: Free) -> bool:
    """Alone and free, with all masses about its origin, which is at rest, and no forces on it."""
    if not isinstance(body, RigidBody) or len(scene.bodies) > 1 or scene.closures:
        return False
    places = [body.com_m, hinge.child_position_m, node_frame(body, hinge.child_node).position]
    places += [place for wheel in scene.wheels for place in (wheel.offset_m, node_frame(body, wheel.node).position)]
    forces = any(load.type == "force" for load in scene.loads)
    return not (forces or any(hinge.velocity_m_s) or any(any(place) for place in places))
