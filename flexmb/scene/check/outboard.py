"""Inertia beyond hinges: a freedom that moves nothing has no acceleration.

A gimbal with aligned axes has a freedom that moves nothing, whatever the gimbal carries. Everything else is checked
where no kinematics is needed: for the child and everything welded to it, unless more mass hangs from these by moving
hinges.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from flexmb.scene.bodies import BeamBody, Body, ModalBody, Quaternion, RigidBody, Vector
from flexmb.scene.check.profiles import start_of
from flexmb.scene.check.walk import entries
from flexmb.scene.functions import Function
from flexmb.scene.hinges import (
    AngularCoordinate,
    Cylindrical,
    Free,
    Gimbal,
    Hinge,
    Planar,
    Prismatic,
    Revolute,
    Spherical,
    Universal,
    Weld,
)
from flexmb.scene.modal_data import modal_arrays
from flexmb.scene.problems import Defect
from flexmb.scene.quaternions import about, rotation_matrix
from flexmb.scene.schema import PointMass, Scene, Wheel
from flexmb.scene.tree import GROUND, Coordinate, coordinates, node_frame, ordered
from flexmb.typing import Real

Pose = tuple[Real, Real]


class Cluster(NamedTuple):
    """A body and all that is welded to it: `inertia` (6,6) in the body's frame, None where it is not known.

    `beyond`: whether mass hangs from these by moving hinges.
    """

    inertia: Real | None
    beyond: bool


# A moment below this share of the largest leaves no digits of the acceleration.
NEGLIGIBLE = 1e-12
GAUSS = np.polynomial.legendre.leggauss(2)  # exact for a linear section times x^2


def moved_inertia(scene: Scene) -> Iterator[Defect]:
    """Every free coordinate of a hinge moves inertia. The scene's numbers and tree must be sound."""
    bodies = {body.name: body for body in scene.bodies}
    clusters = _clusters(scene)
    for place, hinge in entries(scene, "hinges"):
        H = _free_directions(hinge)
        if H.shape[1] == 0:
            continue
        if np.linalg.svd(H, compute_uv=False)[-1] <= NEGLIGIBLE:
            what = "the hinge starts where its axes align (gimbal lock): one of its freedoms is lost"
            yield Defect(str(place), what, "start elsewhere, choose another sequence, or use a spherical hinge")
            continue
        cluster, beyond = clusters[hinge.child]
        if cluster is None or beyond:
            continue
        end = _end(bodies[hinge.child], hinge.child_node, hinge.child_position_m, hinge.child_quaternion)
        X = np.linalg.inv(_motion(end))
        inertia = X.T @ cluster @ X
        D = H.T @ inertia @ H
        mass, moment = float(inertia[5, 5]), float(np.trace(inertia[:3, :3]))
        reference = np.where(np.any(H[:3] != 0.0, axis=0), moment, mass)
        still = np.diag(D) <= NEGLIGIBLE * reference
        if np.any(still) or np.linalg.eigvalsh(D / np.sqrt(np.outer(np.diag(D), np.diag(D))))[0] <= NEGLIGIBLE:
            noun = "mass along" if np.any(still) and not np.any(H[:3, still]) else "inertia about"
            what = f'body "{hinge.child}" and what is welded to it have no {noun} a free direction of this hinge'
            remedy = f"give them {noun.split()[0]}, weld the hinge, or prescribe the coordinate"
            yield Defect(str(place), what, remedy)


def _clusters(scene: Scene) -> dict[str, Cluster]:
    """Of every body: what is welded to it and what hangs from these, gathered tip to base."""
    bodies = {body.name: body for body in scene.bodies}
    clusters = {name: Cluster(_spatial_inertia(scene, body), False) for name, body in bodies.items()}
    for body, hinge in reversed(ordered(scene)):
        if hinge.parent == GROUND:
            continue
        total, beyond = clusters[hinge.parent]
        welded, further = clusters[body.name]
        if not isinstance(hinge, Weld):
            beyond = beyond or further or welded is None or bool(np.any(welded))
        elif total is None or welded is None:
            total, beyond = None, beyond or further
        else:
            parent = bodies[hinge.parent]
            to_parent = _end(parent, hinge.parent_node, hinge.parent_position_m, hinge.parent_quaternion)
            to_child = _end(body, hinge.child_node, hinge.child_position_m, hinge.child_quaternion)
            X = np.linalg.solve(_motion(to_child), _motion(to_parent))
            total, beyond = total + X.T @ welded @ X, beyond or further
        clusters[hinge.parent] = Cluster(total, beyond)
    return clusters


def _spatial_inertia(scene: Scene, body: Body) -> Real | None:
    """Inertia (6,6) at rest in the body frame, wheels and point masses included; None for a SID body."""
    match body:
        case RigidBody():
            total = _lump(body.mass_kg, body.com_m, body.inertia_kg_m2)
        case BeamBody():
            total = _beam(body)
        case ModalBody():
            a = modal_arrays(body)
            points = zip(a.mass, a.position + a.com_offset, a.inertia, strict=True)
            total = _sum(_lump(*point) for point in points)
        case _:
            return None
    items: tuple[Wheel | PointMass, ...] = (*scene.wheels, *scene.point_masses)
    for item in items:
        if item.body == body.name:
            X = _motion(_end(body, item.node, item.offset_m, (1.0, 0.0, 0.0, 0.0)))
            total = total + X.T @ _attached(item) @ X
    return total


def _attached(item: Wheel | PointMass) -> Real:
    """A wheel that spins freely resists no rotation about its axis."""
    if isinstance(item, PointMass):
        return _lump(item.mass_kg, np.zeros(3), np.zeros((3, 3)))
    along = np.outer(item.axis, item.axis)
    inertia = item.transverse_inertia_kg_m2 * (np.eye(3) - along)
    if item.prescribed_rad is not None:
        inertia = inertia + item.axial_inertia_kg_m2 * along
    return _lump(item.mass_kg, np.zeros(3), inertia)


def _beam(body: BeamBody) -> Real:
    total = _sum(_lump(t.mass_kg, np.add((t.x_m, 0.0, 0.0), t.com_m), t.inertia_kg_m2) for t in body.tip_masses)
    keys = ("mass_per_length_kg_m", "rotary_y_kg_m", "rotary_z_kg_m")
    for left, right in zip(body.stations, body.stations[1:], strict=False):
        half = (right.x_m - left.x_m) / 2.0
        for s, weight in zip(*GAUSS, strict=True):
            share = (1.0 + s) / 2.0
            mass, jy, jz = (
                half * weight * ((1.0 - share) * getattr(left, key) + share * getattr(right, key)) for key in keys
            )
            section = np.zeros((3, 3)) if body.points == "line" else np.diag([jy + jz, jy, jz])
            total = total + _lump(mass, (left.x_m + half * (1.0 + s), 0.0, 0.0), section)
    return total


def _lump(mass: float, com: Vector | Real, inertia: object) -> Real:
    """Spatial inertia (6,6), angular first, of a lump with mass centre `com` and `inertia` (3,3) about it."""
    c = np.cross(np.eye(3), np.asarray(com, dtype=float))  # c @ v = com x v
    return np.block([[np.asarray(inertia, dtype=float) - mass * c @ c, mass * c], [-mass * c, mass * np.eye(3)]])


def _sum(inertias: Iterable[Real]) -> Real:
    return sum(inertias, np.zeros((6, 6)))


def _end(body: Body, node: str, position: Vector, quaternion: Quaternion) -> Pose:
    """Rotation (3,3) and origin, in the body frame, of the frame offset from a node."""
    frame = node_frame(body, node)
    turn = rotation_matrix(frame.quaternion)
    return turn @ rotation_matrix(quaternion), np.add(frame.position, turn @ np.asarray(position, dtype=float))


def _motion(pose: Pose) -> Real:
    """X (6,6): spatial velocity [w; v] of the body frame to that of the frame at `pose`, in that frame's axes."""
    turn, position = pose
    R = turn.T
    return np.block([[R, np.zeros((3, 3))], [-R @ np.cross(np.eye(3), position), R]])


def _free_directions(hinge: Hinge) -> Real:
    """Free columns of the hinge map at the start (6,n), outboard hinge axes; prescribed coordinates are left out."""
    angular = np.eye(6)[:3]
    directions: Sequence[ArrayLike]
    match hinge:
        case Spherical():
            return angular.T
        case Free():
            return np.eye(6)
        case Revolute() | Prismatic() | Cylindrical():
            columns = {"rotation": (*hinge.axis, 0.0, 0.0, 0.0), "translation": (0.0, 0.0, 0.0, *hinge.axis)}
            directions = [columns[name] for name, _ in coordinates(hinge)]
        case Planar():
            back = about("z", -_start(hinge.rotation))
            directions = [(0.0, 0.0, 0.0, *axis) for axis in back.T[:2]] + [angular[2]]
        case Universal():
            directions = _carried("xy", hinge)
        case Gimbal():
            directions = _carried(hinge.sequence, hinge)
        case _:
            return np.zeros((6, 0))
    kept = [
        np.asarray(direction, dtype=float)
        for direction, (_, coordinate) in zip(directions, coordinates(hinge), strict=True)
        if _profile(coordinate) is None
    ]
    return np.array(kept).reshape(-1, 6).T


def _carried(sequence: str, hinge: Universal | Gimbal) -> list[Real]:
    """Axes of successive rotations seen from the outboard frame: turned back by the rotations that follow."""
    angles = [_start(coordinate) for _, coordinate in coordinates(hinge)]
    directions = []
    for k, letter in enumerate(sequence):
        after = np.eye(3)
        for axis, angle in zip(sequence[k + 1 :], angles[k + 1 :], strict=True):
            after = after @ about(axis, angle)
        directions.append(np.concatenate([after["xyz".index(letter)], np.zeros(3)]))
    return directions


def _profile(coordinate: Coordinate) -> Function | None:
    return coordinate.prescribed_rad if isinstance(coordinate, AngularCoordinate) else coordinate.prescribed_m


def _start(coordinate: Coordinate) -> float:
    """Initial value (rad or m): the profile's where there is one."""
    profile = _profile(coordinate)
    start = start_of(profile) if profile is not None else None
    if start is not None:
        return start[0]
    return coordinate.angle_rad if isinstance(coordinate, AngularCoordinate) else coordinate.position_m
