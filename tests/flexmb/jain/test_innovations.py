"""The innovations factorisation by recursion: Lemmas 2 to 4 without matrices, up to 200 bodies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flexmb
from flexmb.entry import factorisation
from flexmb.jain.response import response
from flexmb.jit.counting import count
from flexmb.system.factors import MassMatrixFactors
from flexmb.tables.state import DynamicsError
from flexmb.typing import Real
from tests import trees
from tests.benchmarks.rivals import flexible_chain
from tests.bounds import backward_error, gamma
from tests.flexmb.jain.random_states import LEVELS, RandomState, random_state

CARRIERS = ("rigid", "modal", "floating")


LONG = [pytest.param((level, 200), marks=[] if level == "every level" else pytest.mark.slow) for level in LEVELS]


@pytest.fixture(scope="module", params=[*((level, n) for level in LEVELS for n in (3, 20)), *LONG], ids=str)
def found(request) -> RandomState:
    """Trees, and at 200 bodies chains; wheels and prescribed speeds among them."""
    level, bodies = request.param
    carriers = {} if level in ("rigid", "exact") else {"carriers": CARRIERS}
    return random_state(bodies, level, bodies, branching=bodies < 200, **carriers)


@pytest.fixture(scope="module")
def factors(found) -> MassMatrixFactors:
    return found.system.factorise(found.state)


def norm(x: Real) -> float:
    return float(np.linalg.norm(x, np.inf))


def test_solutions(found, factors):
    """(56): backward error within n u."""
    b = np.random.default_rng(0).normal(size=found.system.nu)
    assert backward_error(found.M, factors.solve(b), b) <= gamma(found.system.nu)


def test_products(found, factors):
    """(54)."""
    x = np.random.default_rng(1).normal(size=found.system.nu)
    assert norm(factors.multiply(x) - found.M @ x) <= found.bound * norm(np.abs(found.M) @ np.abs(x))


def test_forward_dynamics_of_inverse_dynamics_is_the_identity(found, factors):
    """(45), then (56): the accelerations come back, to backward error."""
    rates = np.random.default_rng(2).normal(size=found.system.nu)
    again = factors.solve(found.system.inverse_dynamics(found.state, rates) - found.bias)
    size = norm(found.M) * norm(rates) + norm(found.bias)
    assert norm(found.M @ (again - rates)) <= gamma(found.system.nu) * size


def test_half_solutions_are_those_of_the_cholesky_factor(found, factors):
    """(55): F^-1 M F'^-1 = 1, and F is triangular, tips to base, with a positive diagonal: only one is."""
    order = elimination_order(found.system)
    inverse = factors.half_solve(np.eye(found.system.nu))[order]
    M = found.M[np.ix_(order, order)]
    triangle = inverse[:, order]
    assert not np.any(np.triu(triangle, 1))
    assert np.all(np.diag(triangle) > 0.0)
    size = norm(triangle) * norm(M) * norm(triangle.T)
    assert norm(triangle @ M @ triangle.T - np.eye(len(M))) <= found.bound * size
    F = factors.half_multiply(np.eye(len(M)))
    assert norm(F @ F.T - found.M) <= found.bound * norm(F) * norm(F.T)


def elimination_order(system: flexmb.System) -> list[int]:
    """Speeds, tips to base: of each body its wheels, modes, hinge."""
    order: list[int] = []
    for body in system.constants.body[::-1]:
        order += system.constants.wheel["u_index"][body["wheel_start"] : body["wheel_stop"]].tolist()
        order += range(body["etad_index"], body["etad_index"] + body["modes"])
        order += range(body["u_index"], body["u_index"] + body["nv"])
    return order


def test_determinant(found, factors):
    """log det D (54) against LU. Scaled to a unit diagonal, which neither factorisation minds."""
    scale = np.sqrt(np.diag(found.M))
    scaled = found.M / np.outer(scale, scale)
    expected = np.linalg.slogdet(scaled)[1] + 2.0 * np.sum(np.log(scale))
    n = found.system.nu
    assert abs(factors.log_determinant - expected) <= n * gamma(n) * np.linalg.cond(scaled)


def test_several_right_sides_are_several_solutions(found, factors):
    B = np.random.default_rng(3).normal(size=(found.system.nu, 3))
    for apply in (factors.solve, factors.half_solve, factors.multiply, factors.half_multiply):
        assert np.array_equal(apply(B), np.transpose([apply(column) for column in B.T]))


@pytest.mark.parametrize("level", LEVELS)
def test_spatial_operators(level):
    """The recursions against the operators they stand for: (54), (56) as dense products."""
    found = random_state(8, level, 8)
    factors, operators = found.system.factorise(found.state), found.system.operators(found.state)
    b = np.random.default_rng(4).normal(size=found.system.nu)
    n = found.system.nu
    assert norm(found.M @ (factors.solve(b) - operators.M_inverse @ b)) <= found.bound * norm(found.M) * norm(
        np.abs(operators.M_inverse) @ np.abs(b)
    )
    assert abs(factors.log_determinant - operators.log_determinant) <= n * found.bound * np.linalg.cond(found.M)


def test_factors_are_of_their_own_state():
    """A second factorisation, or any other question, leaves the first as it was; those of other states do not fit."""
    found = random_state(2, "full", 6)
    factors = found.system.factorise(found.state)
    b = np.random.default_rng(5).normal(size=found.system.nu)
    before = factors.solve(b)
    elsewhere = found.system.state(found.state.q + 0.05, found.state.u)
    others = found.system.factorise(elsewhere)
    found.system.accelerations(elsewhere), found.system.mass_matrix(elsewhere)
    assert np.array_equal(factors.solve(b), before)
    assert backward_error(found.M, others.solve(b), b) > 1e3 * gamma(found.system.nu)


def test_velocities_and_loads_are_no_part_of_it():
    found = random_state(2, "full", 6)
    resting = found.system.state(found.state.q, np.zeros(found.system.nu), found.state.t)
    b = np.random.default_rng(6).normal(size=found.system.nu)
    assert np.array_equal(found.system.factorise(found.state).solve(b), found.system.factorise(resting).solve(b))


def test_an_indefinite_mass_matrix_is_refused():
    """Where some D is not positive definite (51)."""
    recipe = replace(trees.LINEAR, bodies=6, carriers=("modal", "floating"), deformation=0.4)
    refused = 0
    for seed in range(6):
        system = flexmb.compile(trees.random_scene(seed, recipe))
        lowest = np.linalg.eigvalsh(system.mass_matrix(system.initial_state))[0]
        if lowest > 0.0:
            system.factorise(system.initial_state)
        else:
            refused += 1
            with pytest.raises(DynamicsError, match="is not positive definite"):
                system.factorise(system.initial_state)
    assert refused > 0


@pytest.mark.parametrize(
    "kernel",
    [factorisation.solve, factorisation.half_solve, factorisation.multiply, factorisation.half_multiply],
    ids=lambda kernel: kernel.__name__,
)
def test_operations_grow_with_the_bodies(kernel):
    """(55), (56): one body more costs the same wherever the chain ends."""

    def total(bodies):
        system = flexmb.compile(flexible_chain(bodies, 3, "full"))
        state, w = system.initial_state, system.workspace()
        factorisation.factorise(0.0, np.concatenate([state.q, state.u, [0.0]]), system.constants, system.constants, w)
        b = np.ones((1, system.nu))
        return count(kernel, system.constants, w, response(system.constants), b).operations.total

    cost = [total(bodies) for bodies in (2, 4, 6)]
    assert cost[2] - cost[1] == cost[1] - cost[0] > 0
