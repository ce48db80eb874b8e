"""What closures add to the operators of a tree, and that the tree's alone are not given for those of a closed chain."""

from __future__ import annotations

import numpy as np
import pytest

import flexmb
from tests.bounds import relative
from tests.flexmb.closure import chains, loops
from tests.flexmb.closure import mechanisms as m


@pytest.mark.parametrize("scene", [m.four_bar(closure="spherical"), m.four_bar(), loops.random_loops(3)])
@pytest.mark.filterwarnings("ignore:.*the closures do not allow these values")
def test_the_inertia_at_the_closures_is_that_of_the_mass_matrix(scene):
    system, tree = flexmb.compile(scene), flexmb.System(scene)
    state = system.initial_state
    assert np.max(np.abs(state.u)) < 100.0  # rounding of rows that only held modes move must not drive hinges
    found = system.closure_operators(state)
    free = system.constants.speed["prescribed"] < 0
    M, J = system.mass_matrix(state)[np.ix_(free, free)], found.J[:, free]
    assert len(found.rows) == len(set(found.rows)) == len(found.J) == len(found.loads)
    assert relative(found.Lambda_inverse, J @ np.linalg.solve(M, J.T)) < 1e-11
    assert relative(found.Lambda_inverse @ found.loads, -found.opening) < 1e-10
    udot = tree.accelerations(tree.state(state.q, state.u))
    udot[free] += np.linalg.solve(M, J.T @ found.loads)
    assert relative(udot, system.accelerations(state)) < 1e-10
    dense = chains.constrained(scene, state.q, state.u)  # its rows are others of the same motions
    assert np.linalg.matrix_rank(np.vstack([dense.J, J]), 1e-9) == np.linalg.matrix_rank(J, 1e-9) == system.rank


@pytest.mark.parametrize("ask", ["operators", "partitions"])
def test_operators_of_the_tree_are_not_given_for_those_of_the_chain(ask):
    system = flexmb.compile(m.four_bar())
    with pytest.raises(NotImplementedError, match="closure_operators"):
        getattr(system, ask)(system.initial_state)
    tree = flexmb.System(m.four_bar())
    assert getattr(tree, ask)(tree.initial_state) is not None
