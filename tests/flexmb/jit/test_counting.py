"""Executed operations: helpers whose operations can be counted by hand, and the result of what was counted."""

import math

import numpy as np
import pytest

import flexmb
from flexmb.entry import articulated
from flexmb.jain.explicit import cholesky
from flexmb.jit.counting import Counted, Operations, count
from flexmb.spatial.inertia import inertia_times, outer_inertia
from flexmb.spatial.rotation import rotation_z
from flexmb.spatial.spatial_vector import shift_force
from flexmb.spatial.vector import axpy, cross, matmul, sym_times, times, transpose
from flexmb.tables.functions import evaluate
from tests import trees
from tests.bounds import algebra, backward_error

VECTOR = np.array([1.0, -2.0, 3.0])
MATRIX = np.arange(9.0)
SYM = np.arange(1.0, 7.0)


def of(kernel, *arguments) -> Operations:
    return count(kernel, *arguments).operations


@pytest.mark.parametrize(
    ("helper", "arguments", "multiplications", "additions"),
    [
        (cross, (VECTOR, VECTOR), 6, 3),
        (axpy, (2.0, VECTOR, VECTOR), 3, 3),
        (times, (MATRIX, VECTOR), 9, 6),
        (sym_times, (SYM, VECTOR), 9, 6),
        (matmul, (MATRIX, MATRIX), 27, 18),
        (transpose, (MATRIX,), 0, 0),
        (shift_force, ((VECTOR, VECTOR), VECTOR), 6, 6),
        # four blocks of 3x3 times a vector, two sums of the halves
        (inertia_times, (np.array([SYM, MATRIX, SYM], object), (VECTOR, VECTOR)), 36, 30),
        # 21 products of pairs, each scaled
        (outer_inertia, (VECTOR, VECTOR, -1.0), 42, 0),
    ],
)
def test_by_hand(helper, arguments, multiplications, additions):
    assert of(helper, *arguments) == Operations(multiplications, additions)


@pytest.mark.parametrize("n", [1, 2, 3, 6, 9])
def test_cholesky_of_any_size(n):
    """n divisions and roots, (n^3 - n)/6 multiplications as additions, n(n-1)/2 by pivots, and n for the floors."""
    root = np.random.default_rng(n).normal(size=(n, n))
    matrix = root @ root.T + n * np.eye(n)
    counted = count(cholesky, matrix, n)
    inner = (n**3 - n) // 6
    assert counted.result is True
    assert counted.operations == Operations(inner + n * (n - 1) // 2 + n, inner, n, n)
    np.testing.assert_allclose(
        np.tril(counted.arguments[0].astype(float)), np.linalg.cholesky(matrix), rtol=0.0, atol=1e-13 * n
    )


def test_elementary_functions_roots_and_literals():
    assert of(rotation_z, 0.3) == Operations(elementary=2)

    def literals(x):
        return (2.0 * math.pi + 1.0) * -abs(x) / 3.0 - x**0.5

    assert of(_compiled(literals), 4.0) == Operations(1, 1, 1, 1)


def test_powers_that_are_no_roots_are_refused():
    def cube(x):
        return x**3

    with pytest.raises(NotImplementedError):
        count(_compiled(cube), 2.0)


def test_division_by_zero_is_that_of_the_compiled_code():
    def quotient(a, b):
        return a / b

    assert count(_compiled(quotient), -1.0, 0.0).result == -math.inf
    assert math.isnan(count(_compiled(quotient), 0.0, 0.0).result)


def test_functions_of_time():
    """A sine's value, rate and acceleration: phase 1 product, 1 sum; 5 products, 1 sum, 2 elementary functions."""
    assert of(evaluate, 2, np.array([1.0, 2.0, 0.1, 0.5]), 0, 0, np.zeros((0, 7)), 0.3) == Operations(6, 2, 0, 0, 2)


class _Compiled:
    def __init__(self, function):
        self.py_func = function


def _compiled(function):
    return _Compiled(function)


def counted_accelerations(scene) -> tuple[flexmb.System, np.ndarray, Counted]:
    """The system, its state, and the counted evaluation of its accelerations."""
    system = flexmb.compile(scene)
    state = system.initial_state
    y = np.concatenate([state.q, state.u, [0.0]])
    return system, y, count(articulated.accelerations, 0.0, y, system.constants, system.workspace())


@pytest.mark.parametrize("seed", [0, 2])
def test_what_is_counted_is_what_the_compiled_kernel_computes(seed):
    """Every hinge, three levels, loads and wheels; the compiled kernel may only fuse products into sums."""
    system, _, counted = counted_accelerations(trees.random_scene(seed, trees.MIXED))
    state = system.initial_state
    speeds = counted.arguments[3].speed
    found = np.array([float(speed.acceleration) for speed in speeds])
    M, tau = system.mass_matrix(state), system.applied(state)
    c = system.inverse_dynamics(state, np.zeros(system.nu))
    free = system.constants.speed["prescribed"] < 0
    right = (tau - c)[free] - M[np.ix_(free, ~free)] @ found[~free]
    error = backward_error(M[np.ix_(free, free)], found[free], right, magnitude=np.abs(tau[free]) + np.abs(c[free]))
    assert error < algebra(system.nu, len(system.body_names), 16)
    assert counted.result == 0


def test_the_arguments_stay_as_they_were():
    system = flexmb.compile(trees.random_scene(0))
    state, workspace = system.initial_state, system.workspace()
    y = np.concatenate([state.q, state.u, [0.0]])
    before = workspace.body.copy()
    first, second = (count(articulated.accelerations, 0.0, y, system.constants, workspace).operations for _ in range(2))
    assert first == second
    assert np.array_equal(workspace.body, before)
