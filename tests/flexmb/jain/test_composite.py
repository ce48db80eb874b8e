"""Composite bodies: the mass matrix, and forward dynamics with its Cholesky factors."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np
import pytest

import flexmb
from flexmb.entry import composite
from flexmb.jain.places import matrices
from flexmb.jit.counting import count
from flexmb.tables.state import DynamicsError
from tests import trees
from tests.benchmarks.rivals import flexible_chain
from tests.bounds import backward_error, gamma
from tests.flexmb.jain.random_states import LEVELS, RandomState, of, random_state


@pytest.fixture(scope="module", params=[(level, n) for level in LEVELS for n in (1, 12)], ids=str)
def found(request) -> RandomState:
    level, bodies = request.param
    return random_state(bodies, level, bodies, point_masses=3)


def test_columns_are_inverse_dynamics_of_unit_accelerations(found):
    """(47)-(50) against (44): two routes from the same bodies; the columns are not symmetric by construction."""
    columns = [found.system.inverse_dynamics(found.state, unit) - found.bias for unit in np.eye(found.system.nu)]
    size = np.max(np.abs(found.M)) + np.max(np.abs(found.bias))
    assert np.max(np.abs(np.transpose(columns) - found.M)) <= found.bound * size
    assert np.array_equal(found.M, found.M.T)


def test_mass_matrix_is_that_of_the_spatial_operators(found):
    """(50) against H Phi M_m Phi' H' of (43)."""
    operators = found.system.operators(found.state)
    assert np.max(np.abs(operators.M - found.M)) <= found.bound * np.max(np.abs(found.M))


def test_accelerations_by_composite_bodies(found):
    """(46): backward error within n u, prescribed rates those of the articulated recursion."""
    system, state, free = found.system, found.state, found.free
    rates, others = (system.accelerations(state, algorithm) for algorithm in ("composite", "articulated"))
    right = (system.applied(state) - found.bias)[free]
    assert backward_error(found.M[free], rates, right) <= gamma(system.nu)
    assert np.array_equal(rates[~free], others[~free])


def test_everything_observable_is_that_of_the_articulated_recursion(found):
    """Hinge loads by inverse dynamics, drive loads by rows of M; in the size of what cancels in them."""
    q, u = found.state.q, found.state.u
    ours, theirs = (found.system.evaluate(0.0, q, u, algorithm) for algorithm in ("composite", "articulated"))
    condition = max(1.0, float(np.linalg.cond(found.M)))
    size = found.inertia(theirs.accelerations) * condition * found.bound
    for name in theirs.drives:
        assert np.max(np.abs(ours.drives[name] - theirs.drives[name])) <= size
    for name in theirs.loads:
        assert np.max(np.abs(ours.loads[name] - theirs.loads[name])) <= size
    assert ours.energy == theirs.energy


def test_bodies_that_do_not_carry_each_other_have_no_common_element():
    """A heavier body changes the rows of its own branch and no other (47); what is between branches is zero (50)."""
    recipe = replace(trees.RIGID, bodies=8, point_masses=0, wheels=0, hinges=("revolute", "prismatic", "universal"))
    scene = trees.random_scene(3, recipe)
    light = of(scene)
    names, parent = light.system.body_names, light.system.constants.body["parent"]
    branches = [np.array([owner in branch_of(parent, k) for owner in owners(light.system)]) for k in range(len(names))]
    tip = next(k for k in range(len(names)) if k not in parent and not np.all(branches[k]))
    bodies = [
        msgspec.structs.replace(body, mass_kg=3.0 * body.mass_kg) if body.name == names[tip] else body
        for body in scene.bodies
    ]
    heavy = of(msgspec.structs.replace(scene, bodies=tuple(bodies)))
    on_branch = branches[tip]
    assert np.array_equal(light.M[~on_branch], heavy.M[~on_branch])
    assert not np.array_equal(light.M[on_branch], heavy.M[on_branch])
    apart = np.array([[not (a in branch_of(parent, b) or b in branch_of(parent, a)) for b in owners(light.system)]
                      for a in owners(light.system)])  # fmt: skip
    assert np.any(apart)
    assert not np.any(light.M[apart])


def branch_of(parent: np.ndarray, k: int) -> list[int]:
    """Body k and all that carry it."""
    return [k] if parent[k] < 0 else [k, *branch_of(parent, int(parent[k]))]


def owners(system: flexmb.System) -> list[int]:
    """Body of each speed of a rigid tree."""
    found = np.zeros(system.nu, dtype=int)
    for k, body in enumerate(system.constants.body):
        found[body["u_index"] : body["u_index"] + body["nv"]] = k
    return found.tolist()


def test_an_indefinite_mass_matrix_names_the_body_that_the_recursion_names():
    """Pivots are taken from the tips as the recursion takes them (54)."""
    failures = 0
    for seed in range(6):
        recipe = replace(trees.LINEAR, bodies=6, carriers=("modal", "floating"), deformation=0.4)
        system = flexmb.compile(trees.random_scene(seed, recipe))
        messages = []
        for algorithm in ("articulated", "composite"):
            try:
                system.accelerations(system.initial_state, algorithm)
            except DynamicsError as error:
                messages.append(str(error))
        assert len(messages) != 1
        assert len(set(messages)) == min(len(messages), 1)
        failures += bool(messages)
    assert failures > 0


def test_runs():
    """The same motion, to the tolerance of the integrator."""
    system = flexmb.compile(trees.random_scene(4, replace(LEVELS["every level"], bodies=4)))
    rtol = 1e-10
    ours, theirs = (flexmb.simulate(system, 0.05, rtol=rtol, algorithm=each) for each in ("composite", "articulated"))
    assert ours.finished, ours.message
    assert np.max(np.abs(ours.q - theirs.q)) <= rtol * np.max(np.abs(theirs.q))
    assert np.max(np.abs(ours.work - theirs.work)) <= rtol * np.max(np.abs(theirs.work)) + 1e-12


@pytest.mark.parametrize("modes", [1, 3])
def test_operations_grow_with_the_square_of_the_bodies(modes):
    """The mass matrix of a chain of N bodies: N inertias, and N (N - 1)/2 forces that pass a body (50)."""

    def total(bodies):
        system = flexmb.compile(flexible_chain(bodies, modes, "ruthless"))
        state, M = system.initial_state, np.zeros((system.nu, system.nu))
        y = np.concatenate([state.q, state.u, [0.0]])
        written = system.workspace(), matrices(system.constants)
        return count(composite.mass_matrix, 0.0, y, system.constants, *written, M).operations.total

    cost = np.array([total(bodies) for bodies in (2, 4, 6, 8)])
    assert np.all(np.diff(cost, 2) > 0)
    assert not np.any(np.diff(cost, 3))
