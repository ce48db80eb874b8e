"""Outboard inertia of hinges: a freedom that moves no inertia has no defined acceleration.

A gimbal with aligned axes has such a freedom, whatever the gimbal carries, unless its coordinates have armatures. All
other hinges are checked only where no kinematics is needed: for the child and everything welded to it, unless further
massive bodies are connected to these by moving hinges.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import assert_never

import numpy as np
from msgspec.structs import replace

from flexmb.scene.bodies import RigidBody, SidBody
from flexmb.scene.check.inertia import reach
from flexmb.scene.check.profiles import start_of
from flexmb.scene.check.walk import entries
from flexmb.scene.columns import column
from flexmb.scene.freedoms import Ball, Coordinate, Floating, Freedom, ScalarFreedom
from flexmb.scene.hinges import Hinge
from flexmb.scene.problems import Defect
from flexmb.scene.quaternions import cross_matrix, rotation_by, rotation_matrix
from flexmb.scene.rigid_equivalent import Inertia, rest_inertia, wheel_inertia
from flexmb.scene.rounding import ROUNDING
from flexmb.scene.schema import PointMass, Scene, Wheel
from flexmb.scene.sections import inertia_matrices
from flexmb.scene.tree import GROUND, NodeFrame, ordered, rest_frames
from flexmb.typing import Real

# With a moment of inertia below this fraction of the largest, no digits of the acceleration are left.
NEGLIGIBLE = 1e-12
ABOUT, ALONG = "inertia about", "mass along"
LOCKED = (
    "the hinge starts where its axes align (gimbal lock): one of its freedoms is lost",
    "start elsewhere, choose another sequence, or use a spherical hinge",
)
ANGULAR_FIRST = [3, 4, 5, 0, 1, 2]


def moved_inertia(scene: Scene) -> Iterator[Defect]:
    """Every free coordinate of a hinge moves inertia. The scene's numbers and tree must be valid."""
    nodes = _Nodes(scene)
    all_freedoms = [hinge.freedoms for hinge in scene.hinges]
    free, armatures = _free_directions(all_freedoms), [_armatures(own) for own in all_freedoms]
    ends = _motions(*nodes.frames(scene.hinges, "child"))
    known, beyond, inertia, dust = _clusters(scene, nodes, ends)
    of_child = [nodes.number[hinge.child] for hinge in scene.hinges]
    faults: dict[int, tuple[str, str]] = {}
    for freedoms in set(map(len, free)) - {0}:
        hinges = np.array([i for i, H in enumerate(free) if len(H) == freedoms])
        H = np.swapaxes(np.array([free[i] for i in hinges]), 1, 2)
        armature = np.array([armatures[i] for i in hinges])
        resisted = np.concatenate([H, np.eye(freedoms) * (armature > 0.0)[:, None]], axis=1)
        locked = np.linalg.svd(resisted, compute_uv=False)[:, -1] <= np.sqrt(NEGLIGIBLE)  # it enters squared
        faults |= {int(i): LOCKED for i in hinges[locked]}
        tested = [
            n
            for n, (i, lock) in enumerate(zip(hinges, locked, strict=True))
            if not lock and known[of_child[i]] and not beyond[of_child[i]]
        ]
        bodies = [of_child[i] for i in hinges[tested]]
        seen = H[tested], ends[hinges[tested]], inertia[bodies], armature[tested]
        for n, noun in _unmoved(*seen, dust):
            i = int(hinges[tested[n]])
            along, own = np.linalg.svd(seen[0][n], full_matrices=False)[0], (seen[1][[n]], seen[2][[n]], seen[3][[n]])
            if noun == ABOUT and not any(_unmoved(along[None], *own, dust)):
                faults[i] = LOCKED  # what the hinge carries has inertia about all axes, and its own axes nearly align
                continue
            child = scene.hinges[i].child
            what = f'body "{child}" and what is welded to it have no {noun} a free direction of this hinge'
            remedy = f"give them {noun.split()[0]}, weld the hinge, or prescribe the coordinate or give it an armature"
            faults[i] = what, remedy
    for (place, _), i in zip(entries(scene, "hinges", faults), sorted(faults), strict=True):
        yield Defect(str(place), *faults[i])


def _unmoved(H: Real, end: Real, cluster: Real, armature: Real, dust: Real) -> Iterator[tuple[int, str]]:
    """Numbers of the hinges among n with a free direction in H (n,6,f) that moves no inertia, and what is missing.

    `end` (n,6,6): motion of the body's frame to that of the hinge's; `cluster` (n,6,6): inertia in the body's frame;
    `armature` (n,f): inertia of the coordinates alone. `dust` (6,): what rounding leaves of moments and masses.
    """
    X = np.linalg.inv(end)
    inertia = np.swapaxes(X, 1, 2) @ cluster @ X
    D = np.swapaxes(H, 1, 2) @ inertia @ H
    rounded = (np.diagonal(D, axis1=1, axis2=2) <= np.max(dust[:, None] * (H != 0.0), axis=1)) & (armature == 0.0)
    D = D + armature[:, None] * np.eye(H.shape[2])
    diagonal = np.diagonal(D, axis1=1, axis2=2)
    mass, moment = inertia[:, 5, 5], np.trace(inertia[:, :3, :3], axis1=1, axis2=2)
    angular = np.any(H[:, :3] != 0.0, axis=1)
    still = rounded | (diagonal <= NEGLIGIBLE * np.where(angular, moment[:, None], mass[:, None]))
    size = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    coupled = np.linalg.eigvalsh(D / (size[:, :, None] * size[:, None, :]))[:, 0] <= NEGLIGIBLE
    for n in np.flatnonzero(np.any(still, axis=1) | coupled):
        along = bool(np.any(still[n])) and not np.any(angular[n, still[n]])
        yield int(n), ALONG if along else ABOUT


class _Nodes:
    """The bodies of a scene by number, and the rest frames of their nodes, found when first asked for."""

    def __init__(self, scene: Scene) -> None:
        self.bodies = scene.bodies
        self.number = {body.name: i for i, body in enumerate(scene.bodies)}
        self._frames: dict[str, dict[str, NodeFrame]] = {}

    def frame(self, body: str, node: str) -> NodeFrame:
        """Rest frame of a node."""
        if body not in self._frames:
            self._frames[body] = rest_frames(self.bodies[self.number[body]])
        return self._frames[body][node]

    def frames(self, hinges: Sequence[Hinge], side: str) -> tuple[Real, Real]:
        """Rotations (n,3,3) and origins (n,3), body axes, of the frames of hinges on their `side`, parent or child.

        Not on SID bodies, whose nodes are in their files.
        """
        R = rotation_matrix(column(hinges, f"{side}_quaternion", 4))
        p = column(hinges, f"{side}_position_m", 3)
        for i, hinge in enumerate(hinges):
            name, node = getattr(hinge, side), getattr(hinge, f"{side}_node")
            body = None if name == GROUND else self.bodies[self.number[name]]
            if not (body is None or isinstance(body, SidBody) or (isinstance(body, RigidBody) and node == "origin")):
                R[i], p[i] = _beside(self.frame(name, node), R[i], p[i])
        return R, p


def _beside(node: NodeFrame, R: Real, p: Real) -> tuple[Real, Real]:
    """Pose in the body frame of a frame at R, p relative to a node."""
    turn = rotation_matrix(node.quaternion)
    return turn @ R, node.position + turn @ p


def _clusters(scene: Scene, nodes: _Nodes, ends: Real) -> tuple[list[bool], list[bool], Real, Real]:
    """For every body with all bodies welded to it: whether its inertia is known, whether further massive bodies are
    connected by moving hinges, and the inertia (N,6,6) in the body's frame; and what rounding leaves (6,) of it."""
    known, total = _spatial_inertias(scene, nodes)
    beyond = [False] * len(known)
    lightest = np.min(total[:, 5, 5], where=total[:, 5, 5] > 0.0, initial=np.inf)
    dust = ROUNDING * (lightest if np.isfinite(lightest) else 0.0) * np.array([reach(scene) ** 2] * 3 + [1.0] * 3)
    massive = np.any(np.diagonal(total, axis1=1, axis2=2) > dust, axis=1).tolist()
    number = {hinge.name: i for i, hinge in enumerate(scene.hinges)}
    for body, hinge in reversed(ordered(scene)):
        if hinge.parent == GROUND:
            continue
        parent, k = nodes.number[hinge.parent], nodes.number[body.name]
        beyond[parent] = beyond[parent] or beyond[k]
        if hinge.freedoms:
            beyond[parent] = beyond[parent] or massive[k] or not known[k]
        elif known[parent] and known[k]:
            to_parent = _motions(*nodes.frames([hinge], "parent"))[0]
            X = np.linalg.solve(ends[number[hinge.name]], to_parent)
            total[parent] += X.T @ total[k] @ X
            massive[parent] = massive[parent] or massive[k]
        else:
            known[parent] = False
    return known, beyond, total, dust


def _spatial_inertias(scene: Scene, nodes: _Nodes) -> tuple[list[bool], Real]:
    """Whether the inertia of each body is known, which it is not for SID bodies; and the inertia (N,6,6) at rest in the
    body frame, wheels and point masses included."""
    rigid = [i for i, body in enumerate(scene.bodies) if isinstance(body, RigidBody)]
    bodies = [scene.bodies[i] for i in rigid]
    total = np.zeros((len(scene.bodies), 6, 6))
    total[rigid] = _lumps(column(bodies, "mass_kg"), column(bodies, "com_m", 3), column(bodies, "inertia_kg_m2", 3, 3))
    known = [not isinstance(body, SidBody) for body in scene.bodies]
    for i, body in enumerate(scene.bodies):
        if known[i] and not isinstance(body, RigidBody):  # rigid ones are done above, all at once
            total[i] = _lump(rest_inertia(body))
    items: tuple[Wheel | PointMass, ...] = (*scene.wheels, *scene.point_masses)
    for item in items:
        i = nodes.number[item.body]
        if known[i]:
            R, p = _beside(nodes.frame(item.body, item.node), np.eye(3), np.array(item.offset_m, float))
            total[i] += _lump(Inertia(item.mass_kg, p, R @ _resisting(item) @ R.T))
    return known, total


def _resisting(item: Wheel | PointMass) -> Real:
    """Inertia (3,3) of a wheel or point mass in its node; a wheel that spins freely resists no turn about its axis."""
    match item:
        case PointMass():
            return np.zeros((3, 3))
        case Wheel():
            return wheel_inertia(item if item.prescribed_rad is not None else replace(item, axial_inertia_kg_m2=0.0))
        case _:
            assert_never(item)


def _lumps(mass: Real, com: Real, inertia: Real) -> Real:
    """Spatial inertias (n,6,6), angular first, of lumps with mass centres `com` (n,3) and `inertia` about them."""
    return inertia_matrices(mass, com, inertia)[:, ANGULAR_FIRST][:, :, ANGULAR_FIRST]


def _lump(of: Inertia) -> Real:
    """Spatial inertia (6,6) of one lump."""
    lump: Real = _lumps(np.array([of.mass]), of.com[None], of.inertia[None])[0]
    return lump


def _motions(R: Real, p: Real) -> Real:
    """X (n,6,6): spatial velocity [w; v] of the body frame to that of the frame at R, p in it, in that frame's axes."""
    out = np.zeros((len(R), 6, 6))
    out[:, :3, :3] = out[:, 3:, 3:] = turn = np.swapaxes(R, 1, 2)
    out[:, 3:, :3] = -turn @ cross_matrix(p)
    return out


def _free_directions(freedoms: Sequence[tuple[Freedom, ...]]) -> list[Real]:
    """For each hinge the rows (n,6) of its map at the start, outboard hinge axes, without prescribed coordinates."""
    # a single free coordinate, as most hinges have
    single = [
        i
        for i, own in enumerate(freedoms)
        if len(own) == 1 and isinstance(own[0], ScalarFreedom) and own[0].coordinate.prescribed is None
    ]
    lines = [own for i in single for own in freedoms[i] if isinstance(own, ScalarFreedom)]
    axis = column(lines, "axis", 3)
    rows = np.concatenate([column(lines, size)[:, None] * axis for size in ("turns", "shifts")], axis=1)
    by_number = dict(zip(single, rows[:, None], strict=True))
    return [by_number[i] if i in by_number else _directions_of(own) for i, own in enumerate(freedoms)]


def _armatures(freedoms: Sequence[Freedom]) -> list[float]:
    """Armatures of the freedoms of one hinge, by the rows of `_free_directions`."""
    armatures: list[float] = []
    for freedom in freedoms:
        match freedom:
            case ScalarFreedom(coordinate=coordinate):
                armatures += [coordinate.armature] if coordinate.prescribed is None else []
            case Ball() | Floating():
                armatures += [0.0] * freedom.sizes[1]
            case _:
                assert_never(freedom)
    return armatures


def _directions_of(freedoms: Sequence[Freedom]) -> Real:
    """Free rows of several freedoms; each is transformed to the outboard frame by the freedoms that follow it."""
    directions = [np.zeros((0, 6))]
    R, p = np.eye(3), np.zeros(3)  # of the outboard frame, seen from where the freedom leads
    for freedom in reversed(freedoms):
        own, turned, moved = _across(freedom)
        directions.append(own @ _motions(R[None], p[None])[0].T)
        R, p = turned @ R, moved + turned @ p
    return np.concatenate(directions[::-1])


def _across(freedom: Freedom) -> tuple[Real, Real, Real]:
    """Free rows (n,6) of one freedom at the start, in the axes to which it leads; their rotation and position."""
    match freedom:
        case ScalarFreedom(axis=axis, coordinate=coordinate):
            row, start = np.outer((freedom.turns, freedom.shifts), axis).reshape(1, 6), _start(coordinate)
            free = row if coordinate.prescribed is None else row[:0]
            return free, rotation_by(start * row[0, :3]), start * row[0, 3:]
        case Ball(quaternion=quaternion):
            return np.eye(6)[:3], rotation_matrix(quaternion), np.zeros(3)
        case Floating(position=position, quaternion=quaternion):
            return np.eye(6), rotation_matrix(quaternion), np.array(position)
        case _:
            assert_never(freedom)


def _start(coordinate: Coordinate) -> float:
    """Initial value (rad or m), that of the prescribed motion if there is one."""
    start = None if coordinate.prescribed is None else start_of(coordinate.prescribed)
    return coordinate.value if start is None else start[0]
