"""Random trees with random closures, and their equations as one dense system that shares nothing with the sweeps."""

from __future__ import annotations

from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.random import Generator
from scipy.spatial.transform import Rotation

import flexmb
from flexmb.dense import DenseSystem
from flexmb.dense.body_frames import Motions
from flexmb.dense.closures import relative_frame, rows, through_hinges
from flexmb.dense.jets import profile
from flexmb.scene import schema as s
from flexmb.scene.hinges import WITH_AXIS
from flexmb.scene.tree import rest_frames
from tests import trees

Array = np.ndarray


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
        case "in_line":
            return Rotation.random(random_state=rng).as_matrix(), distance[0] * axis
        case "in_plane":
            return Rotation.random(random_state=rng).as_matrix(), distance - distance @ axis * axis
    return np.eye(3), np.zeros(3)


def on_hinges(scene: s.Scene, q: Array, u: Array, rates: Array, closures: dict[str, Array]) -> dict[str, Array]:
    """Loads (6,) across the tree's hinges by Newton and Euler for everything outboard, which closures load too."""
    dense = DenseSystem(scene)
    found, taken = dense.hinge_loads(0.0, q, u, rates), through_hinges(dense, q, closures)
    return {name: load + taken.get(name, 0.0) for name, load in found.items()}
