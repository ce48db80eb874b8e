"""Derivatives by recursion: against dual numbers on random trees. (The dense route's: system/test_derivatives.py.)"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

import flexmb
from flexmb.entry import derivatives
from flexmb.entry.tangent import tangent_workspace
from flexmb.scene.schema import Scene
from flexmb.tables.features import OF_SINGLE_AXES, contained
from flexmb.tables.status import Status
from tests import trees
from tests.benchmarks.rivals import flexible_chain, rigid_chain
from tests.bounds import UNIT_ROUNDOFF
from tests.flexmb.connectors import connected_scenes
from tests.flexmb.entry import dual_jacobian
from tests.flexmb.guards import NOTHING, guarded

H = 2.0**-100
T = 0.3  # s: no function of the trees is at rest there
RECIPES = {
    "armed rigid": trees.ARMED_RIGID, "full": trees.FULL, "ruthless": trees.RUTHLESS, "linear": trees.LINEAR,
    "stiffened": trees.STIFFENED, "armed": trees.ARMED, "mixed": trees.MIXED, "flying": trees.FREE_FLYING,
    "later kinds": trees.LATER, "every level": trees.EVERY_LEVEL, "exact": trees.EXACT,
}  # fmt: skip


class Both(NamedTuple):
    """A system, the state y of its Jacobians, by recursion and by duals, and the workspace of the former."""

    system: flexmb.System
    y: np.ndarray
    J: np.ndarray
    by_duals: np.ndarray
    w: derivatives.DerivativeWorkspace


def both(scene: Scene) -> Both | None:
    """At the scene's initial state; None where there are no accelerations, which both routes must say."""
    system = flexmb.compile(scene)
    c, state = system.constants, system.initial_state
    y = np.concatenate([state.q, state.u, [0.0]])
    J, by_duals = np.full((2, len(y), len(y)), np.nan)
    tables, space = guarded(c, NOTHING), guarded(derivatives.derivative_workspace(c, system.nq, system.nu))
    w = space.bundle
    status = derivatives.jacobian(T, y, J, tables.bundle, w)
    assert not space.written()
    assert status == dual_jacobian.jacobian(T, y, by_duals, c, tangent_workspace(c, system.nq, system.nu))
    return Both(system, y, J, by_duals, w) if status == Status.OK else None


def errors(found: Both) -> np.ndarray:
    """By column, of its largest element. A unit displacement changes accelerations by their own size at least.

    The columns of light bodies that turn fast are what is left of larger terms.
    """
    size = np.max(np.abs(found.by_duals), axis=0)
    nq, rates = found.system.nq, found.w.sweeps.speed["acceleration"]
    size[:nq] = np.where(size[:nq] > 0.0, np.maximum(size[:nq], np.max(np.abs(rates))), 0.0)
    error = np.max(np.abs(found.J - found.by_duals), axis=0)
    return np.divide(error, size, out=np.where(error > 1e-20, np.inf, 0.0), where=size > 0.0)


def mass(system: flexmb.System) -> np.ndarray:
    """Mass matrix of the free speeds, where prescribed coordinates are at time T."""
    free = system.constants.speed["prescribed"] < 0
    return system.mass_matrix(replace(system.initial_state, t=T))[np.ix_(free, free)]


def bound(system: flexmb.System) -> float:
    """1e-11, beside what rounding leaves of the solution of each route."""
    return 1e-11 + 8.0 * float(np.linalg.cond(mass(system))) * UNIT_ROUNDOFF


def agree(scene: Scene) -> bool:
    """Whether both routes found derivatives; they are equal then, and a planted error of 1e-8 is noticed."""
    found = both(scene)
    if found is None:
        return False
    limit = bound(found.system)
    assert np.max(errors(found)) <= limit
    column = np.argmax(np.max(np.abs(found.by_duals), axis=0))
    found.J[np.argmax(np.abs(found.J[:, column])), column] *= 1.0 + 1e3 * limit
    assert np.max(errors(found)) > limit
    return True


@pytest.mark.parametrize("recipe", RECIPES)
def test_random_trees_against_dual_numbers(recipe):
    """Rows of qdot, udot and of the work's rate."""
    assert sum([agree(trees.random_scene(seed, RECIPES[recipe])) for seed in range(6)]) >= 4


def test_a_write_beyond_an_array_is_noticed():
    """Of a table that has a row too few."""
    system = flexmb.compile(flexible_chain(2, 3, "ruthless"))
    c, y = system.constants, np.concatenate([system.initial_state.q, system.initial_state.u, [0.0]])
    w = derivatives.derivative_workspace(c, system.nq, system.nu)
    space = guarded(replace(w, tables=replace(w.tables, local=np.zeros((5, 3)))))
    assert derivatives.jacobian(T, y, np.full((len(y), len(y)), np.nan), c, space.bundle) == Status.OK
    assert space.written() == ["tables.local"]


@pytest.mark.slow
@pytest.mark.parametrize("recipe", RECIPES)
def test_many_random_trees_against_dual_numbers(recipe):
    """Fifty more of each; a scene of level linear may start beyond its range."""
    assert sum([agree(trees.random_scene(seed, RECIPES[recipe])) for seed in range(6, 56)]) >= 40


@pytest.mark.filterwarnings('ignore:scene "connected" is doubtful')
@pytest.mark.parametrize("level", ["full", "linear", "stiffened", "rigid"])
def test_connectors(level):
    assert agree(connected_scenes.everything(level))
    assert agree(connected_scenes.free_flying(lossy=True))


@pytest.mark.parametrize("scene", [rigid_chain(1), rigid_chain(30), flexible_chain(12, 3, "full"),
                                   flexible_chain(9, 10, "ruthless")])  # fmt: skip
def test_chains_longer_than_a_base_point_serves(scene):
    assert agree(scene)


@pytest.mark.parametrize("seed", range(2))
def test_by_displacement_and_by_force(seed):
    """Displacements move the coordinates by N; M times the derivatives by forces is 1; what is prescribed has zeros."""
    found = both(trees.random_scene(seed, trees.EVERY_LEVEL))
    assert found is not None
    c, nq, nu = found.system.constants, found.system.nq, found.system.nu
    by_displacement, by_speed, by_force = matrices = np.full((3, nu, nu), np.nan)
    assert derivatives.acceleration_derivatives(T, found.y, *matrices, c, found.w) == Status.OK
    free = c.speed["prescribed"] < 0
    rows = found.by_duals[nq : nq + nu]
    expected = rows[:, :nq] @ found.by_duals[:nq, nq : nq + nu]
    assert np.max(np.abs(by_displacement - expected)) <= 1e-11 * np.max(np.abs(expected))
    assert np.max(np.abs(by_speed - rows[:, nq : nq + nu])) <= 1e-11 * np.max(np.abs(rows[:, nq : nq + nu]))
    identity = mass(found.system) @ by_force[np.ix_(free, free)]
    assert np.max(np.abs(identity - np.eye(len(identity)))) <= bound(found.system)
    for matrix in (by_displacement, by_speed, by_force):
        assert not matrix[~free].any() and not matrix[:, ~free].any()


@pytest.mark.parametrize("kernels", ["special", "general"])  # of the latter those that are ready for such trees
@pytest.mark.parametrize("seed", [0, 5])  # with long branches
def test_kernels_of_rigid_trees_on_single_axes(seed, kernels):
    """They have sweeps of their own; M times the derivatives by forces is 1, in the lower triangle too."""
    scene = trees.random_scene(seed, trees.SINGLE)
    found = both(scene)
    assert found is not None
    system = flexmb.compile(scene, kernels=kernels)
    c, nq, nu = system.derivative_constants, system.nq, system.nu
    parent = c.body["parent"].tolist()
    assert contained(c) <= OF_SINGLE_AXES and len(set(parent)) < len(parent)
    w = derivatives.derivative_workspace(c, nq, nu)
    assert len(w.tables.fork) and np.any(w.tables.places["new_point"][np.array(parent) >= 0])
    matrices = np.full((3, nu, nu), np.nan)
    assert derivatives.acceleration_derivatives(T, found.y, *matrices, c, w) == Status.OK
    rows = found.by_duals[nq : nq + nu]
    limit = bound(found.system)
    for matrix, expected in zip(matrices, (rows[:, :nq], rows[:, nq : nq + nu]), strict=False):
        assert np.max(np.abs(matrix - expected)) <= limit * np.max(np.abs(expected))
    assert np.max(np.abs(mass(found.system) @ matrices[2] - np.eye(nu))) <= limit
