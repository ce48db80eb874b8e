"""Relative motion of contiguous bodies and wheels, (116)-(134), against the exact motion of their frames.

Transformation S and kinematic bias are read off truncated Taylor series of the frames of both bodies in World: nothing
of the hinges' maps or of the nodes' shapes enters the expected values. Every random tree has all kinds of hinges,
hinges of both bodies at nodes that deform, wheels, point masses and prescribed coordinates.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

import flexmb
from flexmb.dense import DenseSystem
from flexmb.dense.body_frames import Motions, member_frames, point_frames
from flexmb.dense.first_order_bodies import first_order_body
from flexmb.frisch.nested_system import RelativeMotion
from flexmb.scene.schema import PointMass
from tests.bounds import algebra, relative
from tests.flexmb.frisch import contiguous
from tests.flexmb.frisch.scenes import CLAMPED, SMALL, packed, random_scene

SCENES = [(recipe, seed) for recipe in (SMALL, CLAMPED) for seed in range(3)]


@dataclass(frozen=True)
class Case:
    """Both routes at a scene's random state, with random rates of the speeds."""

    dense: DenseSystem
    found: RelativeMotion
    q: np.ndarray
    u: np.ndarray
    rates: np.ndarray
    unit: contiguous.Expanded  # along u = e_j, configuration at rest
    still: contiguous.Expanded  # along u, its rates zero
    moving: contiguous.Expanded  # along u and its rates
    bound: float
    size: float  # of the terms that accelerations are summed from

    @property
    def bodies(self) -> int:
        return len(self.dense.tree.members)

    @property
    def point_masses(self) -> np.ndarray:
        return np.array([isinstance(member.hinge, PointMass) for member in self.dense.tree.members])

    def rotations(self, x: np.ndarray) -> np.ndarray:
        """(N,3,...) of the bodies."""
        return x[: 3 * self.bodies].reshape(self.bodies, 3, -1)

    def wheels(self, x: np.ndarray) -> np.ndarray:
        """(W,3,...)."""
        count = len(self.dense.tree.rotors)
        return x[3 * self.bodies : 3 * (self.bodies + count)].reshape(count, 3, -1)

    def modes(self, x: np.ndarray) -> np.ndarray:
        return x[3 * (self.bodies + len(self.dense.tree.rotors)) : -3 * self.bodies]

    def translations(self, x: np.ndarray) -> np.ndarray:
        """(N,3,...) of the hinge points."""
        return x[-3 * self.bodies :].reshape(self.bodies, 3, -1)


@pytest.fixture(scope="module", params=range(len(SCENES)), ids=str)
def case(request) -> Case:
    return build(request.param)


@cache
def build(number: int) -> Case:
    recipe, seed = SCENES[number]
    scene = random_scene(seed, recipe)
    system, dense = flexmb.compile(scene), DenseSystem(scene)
    state = system.initial_state
    found = system.nested().relative_motion(0.0, packed(state))
    q, u = dense.on_profile(state.q, state.u, 0.0)
    rates = np.random.default_rng(seed).uniform(-5.0, 5.0, dense.nu)
    none, one = np.zeros_like(u)[None], np.eye(dense.nu)
    unit, still, moving = (
        contiguous.expanded(dense.tree, Motions(q, *motion))
        for motion in ((one, np.zeros_like(one)), (u[None], none), (u[None], rates[None]))
    )
    bound = algebra(dense.nu, len(dense.tree.members))
    return Case(dense, found, q, u, rates, unit, still, moving, bound, _size(dense, Motions(q, u[None], rates[None])))


def _size(dense: DenseSystem, motion: Motions) -> float:
    """Centripetal terms of the frames in World, which cancel in relative motion: w^2 times distance, w^2 of wheels."""
    frames = contiguous.hinge_frames(dense.tree, motion)
    points = point_frames(dense.tree, member_frames(dense.tree, motion), motion)
    fastest = np.max(np.abs(points.angular_velocity()))
    farthest = max(1.0, *(np.max(np.abs(f.position.value)) for f in frames))
    return float(fastest**2 * farthest + max(np.max(np.abs(f.position.acceleration)) for f in frames))


def agree(found, expected, case: Case) -> bool:
    return relative(found, expected) <= case.bound


def agree_in_columns(found, expected, case: Case) -> bool:
    """Rows of S, in the size of the whole: those that vanish are rounded by the route that computes them."""
    return relative(found, expected, case.unit.velocities) <= case.bound


def agree_in_acceleration(found, expected, case: Case) -> bool:
    return bool(np.max(np.abs(found - expected)) <= case.bound * case.size)


def test_trees_have_every_modal_partition():
    """phiR_H, phiT_H, phiR_W of (126), and point masses on nodes that turn (117): none is null in all trees."""
    shares = []
    for case in map(build, range(len(SCENES))):
        modes = np.any(case.modes(case.found.S) != 0.0, axis=0)
        turning = case.rotations(case.found.S)[..., modes]
        rows = (turning, case.translations(case.found.S)[..., modes], case.wheels(case.found.S)[..., modes])
        shares.append([np.max(np.abs(x)) for x in (*rows, turning[case.point_masses])])
    assert np.all(np.max(shares, axis=0) > 1.0)


def test_hinge_points(case):
    """(2), (43): from the parent's hinge point to the body's, displaced by the parent's modes."""
    assert agree(case.found.beta, case.unit.beta, case)


def test_relative_angular_rates_of_bodies(case):
    """(116), (118), (126), (129), (133)."""
    turning = ~case.point_masses
    found, expected = case.rotations(case.found.S)[turning], case.rotations(case.unit.velocities.T)[turning]
    assert agree_in_columns(found, expected, case)


def test_frames_of_point_masses_turn_with_their_nodes(case):
    """(117), (118): no rate across the hinge; where the node does not deform, none at all."""
    chosen = case.point_masses
    found = case.rotations(case.found.S)[chosen]
    assert agree_in_columns(found, case.rotations(case.unit.velocities.T)[chosen], case)
    for member, S in zip(case.dense.tree.members, case.rotations(case.found.S), strict=True):
        assert not (isinstance(member.hinge, PointMass) and np.any(S[:, member.u_hinge]))


def test_rates_of_hinge_points(case):
    """(123), (124), (126), (133), and hinges that translate; of point masses (132)."""
    assert agree_in_columns(case.translations(case.found.S), case.translations(case.unit.velocities.T), case)


def test_relative_angular_rates_of_wheels(case):
    """(120), (121), (126), (131), (133)."""
    assert agree_in_columns(case.wheels(case.found.S), case.wheels(case.unit.velocities.T), case)


def test_modal_rates_are_speeds(case):
    """The rows of ones in (126), (133)."""
    assert np.array_equal(case.modes(case.found.S), case.modes(case.unit.velocities.T))
    assert not np.any(case.modes(case.found.bias))


def test_inertial_rates_of_relative_angular_rates(case):
    """(119), (127), (130), (134): the frame that the parent carries turns the vector with it."""
    found, expected = case.rotations(case.found.bias), case.rotations(case.still.rates[0])
    assert agree_in_acceleration(found, expected, case)


def test_accelerations_of_hinge_points(case):
    """(125), (127), (132): seen from the parent."""
    assert agree_in_acceleration(case.translations(case.found.bias), case.translations(case.still.rates[0]), case)


def test_rates_of_the_angular_rates_of_wheels(case):
    """(122), (131), (134): the axis turns with its node."""
    assert agree_in_acceleration(case.wheels(case.found.bias), case.wheels(case.still.rates[0]), case)


def test_expanded_accelerations(case):
    """(127), (134): S udot + bias for any rates of the speeds."""
    assert agree(case.found.S @ case.u, case.still.velocities[0], case)
    assert agree_in_acceleration(case.found.S @ case.rates + case.found.bias, case.moving.rates[0], case)


def test_a_dropped_term_is_seen(case):
    """Negative control of (119), (125): the parent's turning left out or with the wrong sign, half the acceleration."""
    nothing = np.zeros(case.dense.nu)
    omega = [f.angular_velocity()[0, 0] for f in contiguous.hinge_frames(case.dense.tree, _along(case, nothing))]
    parents = np.array([member.parent for member in case.dense.tree.members])
    carried = np.array([omega[p] if p >= 0 else np.zeros(3) for p in parents])
    rates = case.rotations(case.still.velocities[0])[..., 0]
    bias = case.rotations(case.found.bias)[..., 0]
    exact = case.rotations(case.still.rates[0])[..., 0]
    assert not agree_in_acceleration(bias - np.cross(carried, rates), exact, case)
    assert not agree_in_acceleration(bias - 2.0 * np.cross(carried, rates), exact, case)
    half = case.translations(case.found.bias)
    assert not agree_in_acceleration(0.5 * half, case.translations(case.still.rates[0]), case)


def _along(case: Case, rates: np.ndarray) -> Motions:
    return Motions(case.q, case.u[None], rates[None])


def paths(case: Case) -> list[list[int]]:
    """S_{0,lambda-1}: every body's path from the ground, itself included."""
    found: list[list[int]] = []
    for k, member in enumerate(case.dense.tree.members):
        found.append([*(found[member.parent] if member.parent >= 0 else []), k])
    return found


@dataclass(frozen=True)
class PathSums:
    """Inertial motion of body lambda by (78), (79), (89), (90) from relative motion alone."""

    origin: np.ndarray
    omega: np.ndarray
    omega_rate: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


def path_sums(case: Case) -> list[PathSums]:
    """Sums over S_{0,lambda-1} of the compiled expanded velocities and accelerations."""
    beta = case.found.beta
    velocities, accelerations = case.found.S @ case.u, case.found.S @ case.rates + case.found.bias
    spin, spin_rate = case.rotations(velocities)[..., 0], case.rotations(accelerations)[..., 0]
    drift, drift_rate = case.translations(velocities)[..., 0], case.translations(accelerations)[..., 0]
    found = []
    for path in paths(case):
        omega, omega_rate = np.zeros(3), np.zeros(3)  # of J(i)
        velocity, acceleration = np.zeros(3), np.zeros(3)
        for i in path:
            velocity = velocity + np.cross(omega, beta[i]) + drift[i]
            acceleration = acceleration + np.cross(omega_rate, beta[i]) + np.cross(omega, np.cross(omega, beta[i]))
            acceleration = acceleration + 2.0 * np.cross(omega, drift[i]) + drift_rate[i]
            omega, omega_rate = omega + spin[i], omega_rate + spin_rate[i]
        found.append(PathSums(beta[path].sum(axis=0), omega, omega_rate, velocity, acceleration))
    return found


def test_inertial_motion_of_hinge_points_from_sums_over_the_path(case):
    """(78), (79), (89), (90): sums over S_{0,lambda-1} of relative motion give the frames' motion in World."""
    frames = contiguous.hinge_frames(case.dense.tree, _along(case, case.rates))
    sums = path_sums(case)
    exact = [
        PathSums(
            f.position.value[0, 0], f.angular_velocity()[0, 0], f.angular_acceleration()[0, 0],
            f.position.rate[0, 0], f.position.acceleration[0, 0],
        )
        for f in frames
    ]  # fmt: skip
    for name, close in (
        ("origin", agree), ("omega", agree), ("velocity", agree),
        ("omega_rate", agree_in_acceleration), ("acceleration", agree_in_acceleration),
    ):  # fmt: skip
        found, expected = (np.array([getattr(x, name) for x in motions]) for motions in (sums, exact))
        assert close(found, expected, case), name


def test_mass_centres(case):
    """(1), (47), (78), (79): alpha of every body with its wheels, first order in the deformation."""
    tree, motion, points = case.dense.tree, _along(case, case.rates), case.dense.points
    frames, origins = member_frames(tree, motion), contiguous.hinge_frames(tree, motion)
    at = point_frames(tree, frames, motion).first.position.value
    mass = np.bincount(points.member, points.mass)
    moments = np.array([points.mass * (points.member == k) @ at for k in range(case.bodies)])
    for k in tree.linear:
        moments[k] = first_order_body(tree, k, frames[k], motion).mass_moment()
    exact = moments / mass[:, None] - np.array([f.position.value[0, 0] for f in origins])
    assert agree(case.found.alpha, exact, case)
