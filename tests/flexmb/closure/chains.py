"""Random trees with random closures, and their equations as one dense system that shares nothing with the sweeps."""

from __future__ import annotations

from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.random import Generator
from scipy.spatial.transform import Rotation

import flexmb
from flexmb.dense import DenseSystem
from flexmb.dense.body_frames import Motions, member_frames, seat_frame
from flexmb.dense.function_jets import profile
from flexmb.dense.jets import MovingFrame
from flexmb.dense.members import Seat
from flexmb.modal.flexible_model import FlexibleNode
from flexmb.scene import schema as s
from flexmb.scene.hinges import WITH_AXIS
from flexmb.scene.tree import rest_frames
from tests import trees

Array = np.ndarray
NOWHERE = FlexibleNode(np.zeros(3), np.eye(3), np.zeros((3, 0)), np.zeros((3, 0)))


def seat(dense: DenseSystem, body: str, node: str, position: Array, quaternion: Array) -> tuple[int, Seat]:
    """A frame of a closure in the dense route's terms: member and seat."""
    k = dense.tree.index(body)
    model = None if k < 0 else dense.tree.members[k].model
    at, field = (NOWHERE, None) if model is None else (model.nodes[node], model.field)
    turn = Rotation.from_quat(quaternion, scalar_first=True).as_matrix()
    return k, Seat(at, np.array(position, float), turn, field)


def relative_frame(dense: DenseSystem, closure: s.Closure, motion: Motions) -> MovingFrame:
    """Frame B seen from frame A, as jets (B,1,...)."""
    frames = member_frames(dense.tree, motion)
    a = seat(dense, closure.body_a, closure.node_a, closure.position_a_m, closure.quaternion_a)
    b = seat(dense, closure.body_b, closure.node_b, closure.position_b_m, closure.quaternion_b)
    inboard, outboard = (seat_frame(dense.tree, frames, *side, motion) for side in (a, b))
    return inboard.inverse().carry(outboard)


def suppressed(closure: s.Closure) -> tuple[list[tuple[Array, Array]], list[Array]]:
    """Pairs of axes (of A, of B) that a closure keeps at right angles, and directions along which B stays at A."""
    z = np.array(closure.axis)
    x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
    x /= np.linalg.norm(x)
    y = np.cross(z, x)
    ex, ey, ez = np.eye(3)
    turns = {
        "weld": [(ey, ez), (ex, ez), (ex, ey)], "prismatic": [(ey, ez), (ex, ez), (ex, ey)],
        "revolute": [(x, z), (y, z)], "cylindrical": [(x, z), (y, z)], "planar": [(ex, ez), (ey, ez)],
        "universal": [(ex, ey)], "spherical": [],
    }[closure.type]  # fmt: skip
    return turns, {"prismatic": [x, y], "cylindrical": [x, y], "planar": [ez]}.get(closure.type, [ex, ey, ez])


def relation(dense: DenseSystem, coupling: s.Coupling) -> tuple[Array, Array]:
    """(nq,) and (nu,) factors of coordinates and speeds in a coupling of hinges with one scalar coordinate each."""
    at = {x.owner: x for x in dense.tree.scalars}
    of_q, of_u = np.zeros(dense.nq), np.zeros(dense.nu)
    for hinge, factor in [(coupling.hinge, 1.0), *((term.hinge, -term.ratio) for term in coupling.terms)]:
        of_q[at[hinge].q] = of_u[at[hinge].u] = factor
    return of_q, of_u


def rows(dense: DenseSystem, closure: s.Closure | s.Coupling, motion: Motions) -> Array:
    """(3,B,G) values, rates, accelerations of what a closure keeps zero: products of axes, components of position."""
    if isinstance(closure, s.Coupling):
        of_q, of_u = relation(dense, closure)
        value = np.full(len(motion.u), of_q @ motion.q - closure.offset)
        return np.array([value, motion.u @ of_u, motion.rates @ of_u])[:, :, None]
    B = relative_frame(dense, closure, motion)
    turns, steps = suppressed(closure)
    found = [
        [np.einsum("i,bnij,j->b", a, part, b) for part in (B.rotation.value, B.rotation.rate, B.rotation.acceleration)]
        for a, b in turns
    ]
    found += [
        [part[:, 0] @ axis for part in (B.position.value, B.position.rate, B.position.acceleration)] for axis in steps
    ]
    count = len(motion.u)
    return np.array([[np.broadcast_to(v, count) for v in row] for row in found]).transpose(1, 2, 0)


def wrenches(scene: s.Scene, q: Array) -> dict[str, Array]:
    """(6,G) by closure: [torque about B; force] on its body_b, World axes, of unit loads of all rows."""
    dense = DenseSystem(scene)
    still = Motions(q, np.zeros((1, dense.nu)), np.zeros((1, dense.nu)))
    frames = member_frames(dense.tree, still)
    found, start = {}, 0
    count = sum(sum(map(len, suppressed(closure))) for closure in scene.closures)
    for closure in scene.closures:
        side = seat(dense, closure.body_a, closure.node_a, closure.position_a_m, closure.quaternion_a)
        world = seat_frame(dense.tree, frames, *side, still).rotation.value[0, 0]
        R = relative_frame(dense, closure, still).rotation.value[0, 0]
        turns, steps = suppressed(closure)
        found[closure.name] = np.zeros((6, count))
        for i, (a, b) in enumerate(turns):
            found[closure.name][:3, start + i] = world @ np.cross(R @ b, a)
        start += len(turns)
        for i, axis in enumerate(steps):
            found[closure.name][3:, start + i] = world @ axis
        start += len(steps)
    return found


@dataclass(frozen=True)
class Constrained:
    """M udot - J' f = right, J udot = -gamma, of the free speeds; prescribed ones have their rates."""

    M: Array
    J: Array
    right: Array
    gamma: Array
    value: Array
    rate: Array
    free: Array
    rates: Array  # (nu,) of prescribed speeds, 0 of the others

    def solve(self) -> tuple[Array, Array]:
        """udot (nu,) and f (G,), the least f where it is not unique."""
        n, g = len(self.M), len(self.J)
        whole = np.block([[self.M, -self.J.T], [self.J, np.zeros((g, g))]])
        found = np.linalg.lstsq(whole, np.concatenate([self.right, -self.gamma]), rcond=1e-13)[0]
        rates = self.rates.copy()
        rates[self.free] = found[:n]
        return rates, found[n:]


def constrained(scene: s.Scene, q: Array, u: Array, t: float = 0.0) -> Constrained:
    """The closed chain at a state, densely."""
    dense = DenseSystem(scene)
    q, u = dense.on_profile(q, u, t)
    unit = Motions(q, np.eye(dense.nu), np.zeros((dense.nu, dense.nu)))
    moving = Motions(q, u[None], np.zeros((1, dense.nu)))
    J = np.concatenate([rows(dense, closure, unit)[1] for closure in scene.constraints], axis=1).T
    value, rate, gamma = np.concatenate([rows(dense, c, moving)[:, 0] for c in scene.constraints], axis=1)
    free = np.ones(dense.nu, dtype=bool)
    free[[x.u for x in dense.tree.scalars if x.prescribed is not None]] = False
    rates = np.zeros(dense.nu)
    for x in dense.tree.scalars:
        if x.prescribed is not None:
            rates[x.u] = profile(x.prescribed, t).acceleration
    M = dense.mass_matrix(q)
    right = dense.applied(q, u, t) - dense.bias(q, u, t) - M @ rates
    return Constrained(
        M[np.ix_(free, free)], J[:, free], right[free], gamma + J @ rates, value, rate, free, rates
    )


def consistent_speeds(scene: s.Scene, q: Array, u: Array) -> Array:
    """The nearest speeds, in the metric of kinetic energy, at which the closures stay closed."""
    dense = constrained(scene, q, u)
    factor = np.linalg.cholesky(dense.M)
    B = np.linalg.solve(factor, dense.J.T)
    u = u.copy()
    u[dense.free] -= np.linalg.solve(factor.T, np.linalg.lstsq(B.T, dense.rate, rcond=1e-12)[0])
    return u


def with_closures(scene: s.Scene, rng: Generator, types: list[str]) -> s.Scene:
    """The scene with closures of these types between random nodes, closed at its initial coordinates."""
    dense = DenseSystem(scene)
    closures = []
    for i, kind in enumerate(types):
        names = ["ground", *(member.name for member in dense.tree.members if member.name.startswith("b"))]
        body_a, body_b = rng.permutation(names[1:] if i else names)[:2]
        closures.append(random_closure(scene, dense, rng, f"c{i}", kind, str(body_a), str(body_b)))
    return msgspec.structs.replace(scene, closures=tuple(closures))


def random_closure(
    scene: s.Scene, dense: DenseSystem, rng: Generator, name: str, kind: str, body_a: str, body_b: str
) -> s.Closure:
    """A closure between random nodes of two bodies, closed at the scene's initial coordinates."""
    bodies = {body.name: list(rest_frames(body)) for body in scene.bodies} | {"ground": ["origin"]}
    node = {body: str(rng.choice(bodies[body])) for body in (body_a, body_b)}
    axis = trees.direction(rng) if kind in WITH_AXIS else (0.0, 0.0, 1.0)
    guess = s.Closure(
        name=name, type=kind, body_a=body_a, node_a=node[body_a], body_b=body_b, node_b=node[body_b],
        position_a_m=tuple(trees.vector(rng, 0.3)), quaternion_a=tuple(trees.quaternion(rng)), axis=tuple(axis),
    )  # fmt: skip
    return closed(scene, dense, guess, *_pose(rng, kind, np.array(guess.axis)))


def closed(scene: s.Scene, dense: DenseSystem, guess: s.Closure, R_hinge: Array, p_hinge: Array) -> s.Closure:
    """The closure with its frame B where its hinge puts it: R R_b = R_hinge, p + R p_b = p_hinge."""
    state = flexmb.System(scene).initial_state
    B = relative_frame(dense, guess, Motions(state.q, np.zeros((1, dense.nu)), np.zeros((1, dense.nu))))
    R, p = B.rotation.value[0, 0], B.position.value[0, 0]
    turn = Rotation.from_matrix(R.T @ R_hinge).as_quat(scalar_first=True)
    return msgspec.structs.replace(
        guess, quaternion_b=tuple(turn / np.linalg.norm(turn)), position_b_m=tuple(R.T @ (p_hinge - p))
    )


def _pose(rng: Generator, kind: str, axis: Array) -> tuple[Array, Array]:
    """A relative pose that the hinge of a kind can have."""
    angle, distance = rng.uniform(-1.0, 1.0), trees.vector(rng, 0.4)
    about = Rotation.from_rotvec(angle * axis).as_matrix()
    match kind:
        case "revolute":
            return about, np.zeros(3)
        case "prismatic":
            return np.eye(3), distance[0] * axis
        case "cylindrical":
            return about, distance[0] * axis
        case "universal":
            return Rotation.from_euler("XY", [angle, rng.uniform(-1.0, 1.0)]).as_matrix(), np.zeros(3)
        case "spherical":
            return Rotation.random(random_state=rng).as_matrix(), np.zeros(3)
        case "planar":
            return Rotation.from_rotvec([0.0, 0.0, angle]).as_matrix(), distance * (1.0, 1.0, 0.0)
    return np.eye(3), np.zeros(3)


def on_hinges(scene: s.Scene, q: Array, u: Array, rates: Array, closures: dict[str, Array]) -> dict[str, Array]:
    """Loads (6,) across the tree's hinges by Newton and Euler for everything outboard, which closures load too.

    Closures join nodes where they truly are. Where bodies are ruthless, hinges transmit their loads with the same
    components in the axes of the hinge at rest shape.
    """
    dense = DenseSystem(scene)
    found = dense.hinge_loads(0.0, q, u, rates)
    still = Motions(q, np.zeros((1, dense.nu)), np.zeros((1, dense.nu)))
    at_rest = Motions(dense._undeformed(q), still.u, still.rates)
    frames, rest = member_frames(dense.tree, still), member_frames(dense.tree, at_rest)
    for closure in scene.closures:
        side = seat(dense, closure.body_b, closure.node_b, closure.position_b_m, closure.quaternion_b)
        point = seat_frame(dense.tree, frames, *side, still).position.value[0, 0]
        load = closures[closure.name]
        for k, member in enumerate(dense.tree.members):
            hinge = seat_frame(dense.tree, frames, k, member.outboard, still)
            hinge_at_rest = seat_frame(dense.tree, rest, k, member.outboard, at_rest)
            turn = hinge_at_rest.rotation.value[0, 0] @ hinge.rotation.value[0, 0].T
            torque = load[:3] + np.cross(point - hinge.position.value[0, 0], load[3:])
            moved = np.concatenate([turn @ torque, turn @ load[3:]])
            outboard = _outboard(dense, k)
            sign = (dense.tree.index(closure.body_b) in outboard) - (dense.tree.index(closure.body_a) in outboard)
            found[member.hinge.name] = found[member.hinge.name] - sign * moved
    return found


def _outboard(dense: DenseSystem, k: int) -> set[int]:
    found = {k}
    for i, member in enumerate(dense.tree.members):
        if member.parent in found:
            found.add(i)
    return found
