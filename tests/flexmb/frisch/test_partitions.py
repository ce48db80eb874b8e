"""Partitions of (111) against the explicit double sums of the paper, nest by nest and body by body.

The compiled route sums over nests in one pass from the tips; `nested_reference` has the sums over sets of labels as
printed, corrected where docs/errata.md says so. Trees branch, carry flexible bodies with others outboard, wheels and
point masses, and loads at nodes that deform.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

import flexmb
from flexmb.dense import DenseSystem
from flexmb.dense.body_frames import Motions, member_frames, point_frames
from flexmb.dense.first_order_bodies import first_order_body
from flexmb.frisch.nested_system import Partitions
from tests.bounds import algebra, relative
from tests.flexmb.frisch import contiguous, labels
from tests.flexmb.frisch.nested_reference import Blocks, Expansion, Nests, partitions
from tests.flexmb.frisch.scenes import CLAMPED, SMALL, packed, random_scene

CHAIN = replace(SMALL, branching=False, wheels=3, point_masses=3)
FREE = replace(SMALL, grounded=False)
SCENES = [(recipe, seed) for recipe in (SMALL, CLAMPED, CHAIN, FREE) for seed in range(2)]
NAMES = ("X", "I_c", "F", "Gamma", "I_s", "M1", "A", "M2")


@dataclass(frozen=True)
class Case:
    """Both routes at a scene's random state."""

    system: flexmb.System
    dense: DenseSystem
    state: flexmb.State
    nests: Nests
    found: Partitions
    expected: Blocks
    bound: float


@pytest.fixture(scope="module", params=range(len(SCENES)), ids=str)
def case(request) -> Case:
    recipe, seed = SCENES[request.param]
    scene = random_scene(seed, recipe)
    system, dense = flexmb.compile(scene), DenseSystem(scene)
    state = system.initial_state
    q, u = dense.on_profile(state.q, state.u, 0.0)
    nests = Nests(*labels.at(dense, q, u, 0.0))
    found = system.nested().partitions(0.0, packed(state))
    largest = max(len(member.model.mass) for member in dense.tree.members)
    bound = algebra(dense.nu, len(dense.tree.members), largest)
    return Case(system, dense, replace(state, q=q, u=u), nests, found, partitions(nests), bound)


def agree(case: Case, *names: str) -> bool:
    return all(relative(getattr(case.found, n), getattr(case.expected, n)) <= case.bound for n in names)


def right_sides_agree(case: Case, number: int) -> bool:
    return relative(case.found.eta[number - 1], case.expected.eta[number - 1]) <= case.bound


def test_rotation_and_translation_of_nests(case):
    """(98), (107), (108), (112): X has Phi + G of all bodies common to two nests, wheels' tensors in it (26)."""
    assert agree(case, "X")


def test_wheels(case):
    """(26), (107), (109), (113): I_W in the rows of every nest that holds its body, and in its own."""
    assert agree(case, "I_c", "I_s")


def test_modes(case):
    """(53), (106)-(108), (110), (114): F and A of mode n in the rows of nests are those of its own equation; M^1."""
    assert agree(case, "F", "A", "M1")


def test_suppressed_translation(case):
    """(99), (103), (107), (108), (115): Gamma and M^2."""
    assert agree(case, "Gamma", "M2")


def test_right_sides_of_nests(case):
    """(81), (87), (100), (101), (107), (108), (112), (171), (172): eta_1 with external loads."""
    assert right_sides_agree(case, 1)


def test_right_sides_of_wheels(case):
    """(94), (102), (105), (109), (113): eta_2, the tensor turning with its node."""
    assert right_sides_agree(case, 2)


def test_right_sides_of_modes(case):
    """(110), (114), (186): eta_3 with what loads at nodes and gravity do on the modes."""
    assert right_sides_agree(case, 3)


def test_right_sides_of_suppressed_translation(case):
    """(80), (100), (108), (115): eta_4 with external forces."""
    assert right_sides_agree(case, 4)


def test_symmetry(case):
    """(111): to the last bit in the compiled matrix; by (107) against (108) in the double sums."""
    assert np.array_equal(case.found.matrix, case.found.matrix.T)
    assert relative(case.expected.Gamma_T, case.expected.Gamma.T) <= case.bound
    assert relative(case.expected.X, case.expected.X.T) <= case.bound


def test_congruence_of_the_double_sums(case):
    """(128), (136): S' Z S and S' (eta - Z bias) of the double sums are mass matrix and bias from the bodies' points.

    Neither side has seen a nest of the compiled route.
    """
    S, found = case.found.S, replace(case.found, **{name: getattr(case.expected, name) for name in NAMES})
    eta, Z = np.concatenate(case.expected.eta), found.matrix
    q, u = case.state.q, case.state.u
    assert relative(S.T @ Z @ S, case.dense.mass_matrix(q)) <= case.bound
    size = np.abs(S.T) @ (np.abs(eta) + np.abs(Z) @ np.abs(case.found.bias))
    assert relative(S.T @ (eta - Z @ case.found.bias), -case.dense.bias(q, u), size) <= case.bound


def test_congruence_of_the_compiled_partitions(case):
    """(136): the compiled reduction is S' Z S of its partitions, and the mass matrix of the recursion."""
    S, Z = case.found.S, case.found.matrix
    M, right = case.system.nested().reduced(0.0, packed(case.state))
    assert relative(S.T @ Z @ S, M) <= case.bound
    assert relative(case.system.mass_matrix(case.state), M) <= case.bound
    eta, bias = np.concatenate(case.found.eta), case.found.bias
    size = np.abs(S.T) @ (np.abs(eta) + np.abs(Z) @ np.abs(bias))
    applied = case.dense.applied(case.state.q, case.state.u)
    assert relative(S.T @ (eta - Z @ bias) + applied, right, size) <= case.bound


def test_constraint_loads_do_no_work(case):
    """(128), (135): what Z x - eta leaves over has no component along any motion S u but springs, motors and drives."""
    status, motion = case.system.nested().motion(0.0, packed(case.state))
    assert status == 0
    S, Z, eta = case.found.S, case.found.matrix, np.concatenate(case.found.eta)
    x = S @ motion.accelerations + case.found.bias
    work = S.T @ (Z @ x - eta)
    expected = case.dense.applied(case.state.q, case.state.u) + motion.drives
    size = np.abs(S.T) @ (np.abs(eta) + np.abs(Z) @ np.abs(x))
    assert relative(work, expected, size) <= case.bound


def expansion(case: Case, rates: np.ndarray) -> Expansion:
    """Expanded accelerations of all bodies for given rates of the speeds."""
    motion = case.system.nested().relative_motion(0.0, packed(case.state))
    x, count = motion.S @ rates + motion.bias, len(case.nests.bodies)
    wheels = 3 * (count + len(case.nests.wheels))
    by_body = [rates[member.u_modes] for member in case.dense.tree.members]
    return Expansion(
        x[: 3 * count].reshape(-1, 3), x[3 * count : wheels].reshape(-1, 3), by_body, x[-3 * count :].reshape(-1, 3)
    )


def rates_of_momentum(case: Case, rates: np.ndarray) -> np.ndarray:
    """m gamma'' (N,3) of all bodies with their wheels, World axes: by points, or to first order in the deformation."""
    tree, points = case.dense.tree, case.dense.points
    motion = Motions(case.state.q, case.state.u[None], rates[None])
    frames = member_frames(tree, motion)
    acceleration = point_frames(tree, frames, motion).first.position.acceleration
    found = np.array([points.mass * (points.member == k) @ acceleration for k in case.nests.labels])
    for k in tree.linear:
        body = first_order_body(tree, k, frames[k], motion)
        found[k] = body.rotation @ body.force(np.zeros(3))[-3:]
    return found


def test_accelerations_of_mass_centres(case):
    """(86), (89), (91): path sums of relative accelerations, with a_n'' A_n of the body's own modes."""
    rates = np.random.default_rng(0).uniform(-5.0, 5.0, case.dense.nu)
    exact, x = rates_of_momentum(case, rates), expansion(case, rates)
    found = [body.m * case.nests.acceleration(lam, x) for lam, body in enumerate(case.nests.bodies)]
    frames = contiguous.hinge_frames(case.dense.tree, Motions(case.state.q, case.state.u[None], rates[None]))
    fastest = max(np.max(np.abs(f.position.acceleration)) for f in frames) + np.max(np.abs(exact))
    assert relative(found, exact, fastest) <= case.bound


# Negative controls


class WrongCoriolis(Nests):
    def C(self, lam):
        b = self.bodies[lam]
        return super().C(lam) - 4.0 * b.m * np.cross(b.omega, b.alpha_rate)


class FirstHingeCounted(Nests):
    def gamma(self, k, lam):
        return super().gamma(k, lam) + self.bodies[k].beta


class NoMomentumOfWheels(Nests):
    def H_relative(self, m):
        return np.zeros(3)


class TensorsThatDoNotTurn(Nests):
    def tensor_turning(self, m):
        return np.zeros(3)


class WheelsWithoutTensor(Nests):
    def Phi(self, lam):
        return self.bodies[lam].Phi


def flipped(name: str):
    """The reference with the sign of one quantity of every body changed."""

    def plant(bodies, wheels):
        return Nests([replace(body, **{name: -getattr(body, name)}) for body in bodies], wheels)

    return plant


SUMS = (WrongCoriolis, FirstHingeCounted, NoMomentumOfWheels, TensorsThatDoNotTurn, WheelsWithoutTensor)
QUANTITIES = ("K", "H", "Q", "A_0", "Phi_rate", "Delta_L", "beta_rate", "alpha_rate", "on_modes", "phi_e")


@pytest.mark.parametrize("plant", [*SUMS, *map(flipped, QUANTITIES)], ids=[*(x.__name__ for x in SUMS), *QUANTITIES])
def test_planted_errors_are_seen(plant):
    """Negative controls: one wrong sign or one term left out in the double sums is seen in the partitions."""
    scene = random_scene(1, CHAIN)
    system, dense = flexmb.compile(scene), DenseSystem(scene)
    q, u = dense.on_profile(system.initial_state.q, system.initial_state.u, 0.0)
    found, wrong = system.partitions(system.initial_state), partitions(plant(*labels.at(dense, q, u, 0.0)))
    pairs = [(getattr(found, name), getattr(wrong, name)) for name in NAMES] + list(
        zip(found.eta, wrong.eta, strict=True)
    )
    largest = max(len(member.model.mass) for member in dense.tree.members)
    assert max(relative(a, b) for a, b in pairs) > 1e6 * algebra(dense.nu, len(dense.tree.members), largest)
