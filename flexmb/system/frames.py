"""Poses of hinge frames, closure frames and nodes at the state that a workspace was last filled for, World axes."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np

from flexmb.building.links import Side, closure_sides
from flexmb.modal.flexible_model import FlexibleNode
from flexmb.modal.strain_field import StrainField
from flexmb.scene.bodies import SidBody
from flexmb.scene.quaternions import rotation_matrix
from flexmb.scene.tree import GROUND, node_names
from flexmb.system.moved_sections import moved_sections, rotation_along
from flexmb.system.scene_arrays import SceneArrays
from flexmb.typing import Real


class MotionTables(Protocol):
    """What is read here and in section loads of a workspace; its numbers may be complex."""

    @property
    def body(self) -> Any: ...
    @property
    def port(self) -> Any: ...
    @property
    def eta(self) -> Any: ...
    @property
    def etad(self) -> Any: ...
    @property
    def etadd(self) -> Any: ...
    @property
    def function(self) -> Any: ...


class Pose(NamedTuple):
    """rotation (3,3) R_World_frame, position (3,) m of the frame's origin."""

    rotation: Real
    position: Real


class HingeFrames(NamedTuple):
    """Axes (3,3) of the inboard and outboard hinge frames, R_World_frame, and the outboard hinge point (3,) m."""

    inboard: Real
    outboard: Real
    point: Real


AT_GROUND = Pose(np.eye(3), np.zeros(3))


def link_pose(w: MotionTables, k: int) -> Pose:
    """Pose of the link frame of body k; -1 is the ground."""
    if k < 0:
        return AT_GROUND
    return Pose(w.body["pose_rotation"][k].reshape(3, 3), w.body["pose_position"][k])


def body_pose(arrays: SceneArrays, w: MotionTables, k: int) -> Pose:
    """Pose of the frame of body k as the scene defines it, undeformed."""
    pose, at = link_pose(w, k), arrays.links[k].outboard
    if at.deforms:
        return pose
    rotation = pose.rotation @ at.frame.T
    return Pose(rotation, pose.position - rotation @ at.origin)


def node_pose(arrays: SceneArrays, w: MotionTables, body: str, node: str) -> Pose:
    """Pose of a node, which moves with the deformation; ValueError if there is no such body or node."""
    if body == GROUND:
        return AT_GROUND
    names = arrays.body_names
    if body not in names:
        raise ValueError(f'there is no body "{body}"; there are {", ".join([GROUND, *names])}')
    k = names.index(body)
    try:
        at = arrays.links[k].node(node)
    except (KeyError, ValueError) as error:
        raise ValueError(_without_node(arrays, body, node)) from error
    pose, field = link_pose(w, k), None if arrays.links[k].is_rigid else arrays.links[k].model.field
    turn, position = deformed(at, w.eta[k, : arrays.links[k].mode_count], field)
    return Pose(pose.rotation @ turn, pose.position + pose.rotation @ position)


def deformed(at: FlexibleNode, eta: Real, field: StrainField | None) -> tuple[Real, Real]:
    """Rotation (3,3) node -> link and position (3,) of a node of a link with modal coordinates eta (m,).

    `field`: the sections of the link, at level exact.
    """
    if field is not None and at.section >= 0:
        still = np.zeros_like(eta)
        sections = moved_sections(field, eta, still, still)
        return sections.R[at.section] @ at.rotation, sections.r[at.section]
    position, theta = at.position + at.translation @ eta, at.rotation_modes @ eta
    if at.second is not None:
        position = position + 0.5 * np.einsum("amn,m,n->a", at.second.translation, eta, eta)
        theta = theta + 0.5 * np.einsum("amn,m,n->a", at.second.rotation, eta, eta)
    return rotation_along(theta[None])[0] @ at.rotation, position


def hinge_frames(arrays: SceneArrays, w: MotionTables) -> dict[str, HingeFrames]:
    """The frames of every hinge and point mass, and of closures: frames A and B, and the origin of B."""
    frames = {link.hinge.name: hinge_frames_of(arrays, w, k) for k, link in enumerate(arrays.links)}
    frames |= {coupling.name: frames[coupling.hinge] for coupling in arrays.scene.couplings}
    closures = enumerate(arrays.scene.closures)
    return frames | {closure.name: closure_frames_of(arrays, w, i) for i, closure in closures}


def closure_frames_of(arrays: SceneArrays, w: MotionTables, i: int) -> HingeFrames:
    """Frames A and B of closure i, and the origin of B."""
    sides = closure_sides(arrays.scene.closures[i])
    a, b = (_of_side(w, sides[j], *arrays.closure_ports[2 * i + j]) for j in range(2))
    return HingeFrames(a.rotation, b.rotation, b.position)


def hinge_frames_of(arrays: SceneArrays, w: MotionTables, k: int) -> HingeFrames:
    """The frames of the hinge of body k. `BodyLink` turns both so that a hinge axis is z; here they are turned back."""
    body, back = arrays.constants.body[k], arrays.links[k].turn.T
    parent, own = link_pose(w, int(body["parent"])), link_pose(w, k)
    inward, outward = int(body["inboard_port"]), int(body["outboard_port"])
    placed = body["placement_rotation"].reshape(3, 3) if inward < 0 else _port(w, inward)[0]
    turn, arm = (np.eye(3), np.zeros(3)) if outward < 0 else _port(w, outward)
    return HingeFrames(parent.rotation @ placed @ back, own.rotation @ turn @ back, own.position + own.rotation @ arm)


def _of_side(w: MotionTables, side: Side, body: int, port: int) -> Pose:
    """Frame A or B of a closure; -1 for a body is the ground, whose side has no port."""
    if body < 0:
        return Pose(rotation_matrix(side.quaternion), np.array(side.offset, float))
    pose, (turn, arm) = link_pose(w, body), _port(w, port)
    return Pose(pose.rotation @ turn @ side.turn.T, pose.position + pose.rotation @ arm)


def _port(w: MotionTables, port: int) -> tuple[Real, Real]:
    """Rotation (3,3) port -> link and position (3,) of a port of a link."""
    return w.port["R"][port].reshape(3, 3), w.port["r"][port]


def _without_node(arrays: SceneArrays, body: str, node: str) -> str:
    found = next(
        (candidate for candidate in arrays.scene.bodies if candidate.name == body), None
    )  # none for a point mass
    nodes = "" if found is None or isinstance(found, SidBody) else f"; its nodes are {', '.join(node_names(found))}"
    return f'body "{body}" has no node "{node}"{nodes}'
