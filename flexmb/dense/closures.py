"""What closures and couplings keep zero, as jets along a motion, and the loads that do so.

A load f of the rows acts on the tree as the generalised forces J'f. Loads in the null space of J' of the free speeds
cause no acceleration: the motion does not tell how large they are.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexmb.dense.body_frames import Motions, member_frames, seat_frame
from flexmb.dense.dense_system import DenseSystem
from flexmb.dense.hinge_frames import rotation_of
from flexmb.dense.jets import MovingFrame
from flexmb.dense.members import Seat, rigid_model
from flexmb.scene import schema as s
from flexmb.scene.bodies import IDENTITY, ZERO
from flexmb.scene.tree import coupled, joined_bodies
from flexmb.typing import Real

NOWHERE = rigid_model(0.0, np.zeros(3), np.zeros((3, 3)), {"origin": (ZERO, IDENTITY)})
DEPENDENT = 1e-9
"""Singular values of normalised rows that count as zero; those of redundant rows are rounding, and the gap of closures
that assembly leaves, 1e-12 or less."""
UNCHANGED = 1e-7
"""Relative to the largest change by null loads: smaller ones are components that these do not reach, and rounding."""


def seat(dense: DenseSystem, body: str, node: str, position: s.Vector, quaternion: s.Quaternion) -> tuple[int, Seat]:
    """A frame of a closure in the dense route's terms: member and seat."""
    k = dense.tree.index(body)
    model = NOWHERE if k < 0 else dense.tree.members[k].model
    return k, Seat(model.nodes[node], np.array(position, float), rotation_of(quaternion), model.field)


def relative_frame(dense: DenseSystem, closure: s.Closure, motion: Motions) -> MovingFrame:
    """Frame B seen from frame A, as jets (B,1,...)."""
    frames = member_frames(dense.tree, motion)
    inboard, outboard = (seat_frame(dense.tree, frames, *side, motion) for side in _sides(dense, closure))
    return inboard.inverse().carry(outboard)


def _sides(dense: DenseSystem, closure: s.Closure) -> tuple[tuple[int, Seat], tuple[int, Seat]]:
    a = seat(dense, closure.body_a, closure.node_a, closure.position_a_m, closure.quaternion_a)
    return a, seat(dense, closure.body_b, closure.node_b, closure.position_b_m, closure.quaternion_b)


def suppressed(closure: s.Closure) -> tuple[list[tuple[Real, Real]], list[Real]]:
    """Pairs of axes (of A, of B) that a closure keeps at right angles, and directions along which B stays at A; none
    while it is open."""
    if not closure.closed:
        return [], []
    z = np.array(closure.axis)
    x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
    x /= np.linalg.norm(x)
    y = np.cross(z, x)
    ex, ey, ez = np.eye(3)
    turns = {
        "weld": [(ey, ez), (ex, ez), (ex, ey)], "prismatic": [(ey, ez), (ex, ez), (ex, ey)],
        "revolute": [(x, z), (y, z)], "cylindrical": [(x, z), (y, z)], "planar": [(ex, ez), (ey, ez)],
        "universal": [(ex, ey)], "spherical": [], "in_line": [], "in_plane": [],
    }[closure.type]  # fmt: skip
    across = {"prismatic": [x, y], "cylindrical": [x, y], "planar": [ez], "in_line": [x, y], "in_plane": [z]}
    return turns, across.get(closure.type, [ex, ey, ez])


def relation(dense: DenseSystem, coupling: s.Coupling) -> tuple[Real, Real]:
    """(nq,) and (nu,) factors of coordinates and speeds in a coupling."""
    of_q, of_u = np.zeros(dense.nq), np.zeros(dense.nu)
    for member in coupled(dense.scene, coupling):
        at = [x for x in dense.tree.scalars if x.owner == member.hinge.name][member.place]
        of_q[at.q] = of_u[at.u] = member.factor
    return of_q, of_u


def rows(dense: DenseSystem, closure: s.Closure | s.Coupling, motion: Motions) -> Real:
    """(3,B,G) values, rates, accelerations of what a closure keeps zero: products of axes, components of position."""
    if isinstance(closure, s.Coupling):
        of_q, of_u = relation(dense, closure)
        value = np.full(len(motion.u), of_q @ motion.q - closure.offset)
        return np.array([value, motion.u @ of_u, motion.rates @ of_u])[:, :, None]
    B = relative_frame(dense, closure, motion)
    turns, steps = suppressed(closure)
    rows = [
        [np.einsum("i,bnij,j->b", a, part, b) for part in (B.rotation.value, B.rotation.rate, B.rotation.acceleration)]
        for a, b in turns
    ]
    rows += [
        [part[:, 0] @ axis for part in (B.position.value, B.position.rate, B.position.acceleration)] for axis in steps
    ]
    count = len(motion.u)
    values = np.array([[np.broadcast_to(v, count) for v in row] for row in rows])
    return values.reshape(len(rows), 3, count).transpose(1, 2, 0)


def wrenches(dense: DenseSystem, q: Real) -> dict[str, Real]:
    """(6,G) by closure: [torque about B; force] on its body_b, World axes, of unit loads of all rows of closures."""
    still = Motions(q, np.zeros((1, dense.nu)), np.zeros((1, dense.nu)))
    frames = member_frames(dense.tree, still)
    found, start = {}, 0
    count = sum(len(axes) for closure in dense.scene.closures for axes in suppressed(closure))
    for closure in dense.scene.closures:
        seats = (seat_frame(dense.tree, frames, *side, still) for side in _sides(dense, closure))
        world, R_B = (frame.rotation.value[0, 0] for frame in seats)
        turns, steps = suppressed(closure)
        found[closure.name] = np.zeros((6, count))
        for i, (a, b) in enumerate(turns):
            found[closure.name][:3, start + i] = np.cross(R_B @ b, world @ a)
        start += len(turns)
        for i, axis in enumerate(steps):
            found[closure.name][3:, start + i] = world @ axis
        start += len(steps)
    return found


def through_hinges(dense: DenseSystem, q: Real, loads: Mapping[str, Real]) -> dict[str, Real]:
    """(6,...) by hinge: what loads of closures (6,...) take from the load on its outboard body, World axes.

    Closures join nodes where they truly are. Where bodies are ruthless, hinges transmit their loads with the same
    components in the axes of the hinge at rest shape.
    """
    still = Motions(q, np.zeros((1, dense.nu)), np.zeros((1, dense.nu)))
    at_rest = Motions(dense.undeformed(q), still.u, still.rates)
    frames, rest = member_frames(dense.tree, still), member_frames(dense.tree, at_rest)
    points: dict[str, Real] = {}
    ends: dict[str, tuple[int, int]] = {}
    for closure in dense.scene.closures:
        points[closure.name] = seat_frame(dense.tree, frames, *_sides(dense, closure)[1], still).position.value[0, 0]
        ends[closure.name] = dense.tree.index(closure.body_a), dense.tree.index(closure.body_b)
    found: dict[str, Real] = {}
    for k, member in enumerate(dense.tree.members):
        name, outboard = member.hinge.name, dense.outboard(k)
        hinge = seat_frame(dense.tree, frames, k, member.outboard, still)
        turn = seat_frame(dense.tree, rest, k, member.outboard, at_rest).rotation.value[0, 0]
        turn = turn @ hinge.rotation.value[0, 0].T
        for joint, (a, b) in ends.items():
            load = loads[joint]
            torque = load[:3] + np.cross(points[joint] - hinge.position.value[0, 0], load[3:], axisb=0, axisc=0)
            sign = (b in outboard) - (a in outboard)
            found[name] = found.get(name, 0.0) - sign * np.concatenate([turn @ torque, turn @ load[3:]])
    return found


class OpenLoads(NamedTuple):
    """Which loads the motion leaves open: components (6,) of those of hinges, closures and couplings, and of the
    scene's total loads, World axes, and the drive loads (k,) of hinges, point masses and wheels for each of their
    coordinates that is held."""

    loads: dict[str, NDArray[np.bool_]]
    total_loads: dict[str, NDArray[np.bool_]]
    drives: dict[str, NDArray[np.bool_]]


def _total_changes(dense: DenseSystem, q: Real, changes: Mapping[str, Real]) -> dict[str, Real]:
    """(6,...) by total load: what changes (6,...) of the loads of joints do to their sum about its node."""
    still = Motions(q, np.zeros((1, dense.nu)), np.zeros((1, dense.nu)))
    frames = member_frames(dense.tree, still)
    points = {
        closure.name: seat_frame(dense.tree, frames, *_sides(dense, closure)[1], still).position.value[0, 0]
        for closure in dense.scene.closures
    }
    for k, member in enumerate(dense.tree.members):
        points[member.hinge.name] = seat_frame(dense.tree, frames, k, member.outboard, still).position.value[0, 0]
    found, joined = {}, joined_bodies(dense.scene)
    for total in dense.scene.total_loads:
        at = seat(dense, total.body, total.node, ZERO, IDENTITY)
        about = seat_frame(dense.tree, frames, *at, still).position.value[0, 0]
        found[total.name] = np.zeros_like(next(iter(changes.values())))
        for name in total.joints:
            sign = 1.0 if joined[name][1] == total.body else -1.0
            torque = changes[name][:3] + np.cross(points[name] - about, changes[name][3:], axisb=0, axisc=0)
            found[total.name] += sign * np.concatenate([torque, changes[name][3:]])
    return found


def open_loads(dense: DenseSystem, q: Real, held: NDArray[np.bool_]) -> OpenLoads:
    """What null loads of the rows change at q (nq,), where the speeds `held` (nu,) are prescribed or latched."""
    scene = dense.scene
    motion = Motions(q, np.eye(dense.nu), np.zeros((dense.nu, dense.nu)))
    J = np.concatenate([rows(dense, constraint, motion)[1] for constraint in scene.constraints], axis=1).T
    size = np.linalg.norm(J, axis=1, keepdims=True)
    size[size <= DEPENDENT] = 1.0
    left, values, _ = np.linalg.svd(J[:, ~held] / size)
    null = left[:, np.count_nonzero(values > DEPENDENT) :] / size
    count = len(null) - len(scene.couplings)
    of_closures = {name: wrench @ null[:count] for name, wrench in wrenches(dense, q).items()}
    changes = of_closures | through_hinges(dense, q, of_closures)
    for coupling, load in zip(scene.couplings, null[count:], strict=True):
        angular = coupled(scene, coupling)[0].named.coordinate.ANGULAR
        changes[coupling.name] = np.outer(np.repeat([angular, not angular], 3), load)
    drives = np.abs(J.T @ null)
    least = UNCHANGED * max(
        (np.max(np.abs(change), initial=0.0) for change in (*changes.values(), drives)), default=0.0
    )
    reached = np.any(drives > least, axis=1)
    places: dict[str, list[int]] = {}
    for x in dense.tree.scalars:
        if held[x.u]:
            places.setdefault(x.owner, []).append(x.u)
    totals = _total_changes(dense, q, changes)
    return OpenLoads(
        {name: np.any(np.abs(change) > least, axis=1) for name, change in changes.items()},
        {name: np.any(np.abs(change) > least, axis=1) for name, change in totals.items()},
        {name: reached[at] for name, at in places.items()},
    )
