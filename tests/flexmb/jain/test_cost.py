"""Section VII against its own statements, against algorithms that can be counted, and against our kernels."""

from functools import partial
from itertools import pairwise

import numpy as np
import pytest

import flexmb
from flexmb.jain import cost
from flexmb.jit.counting import Operations, count
from flexmb.scene.build import SceneBuilder
from flexmb.scene.modal_data import inertia_points
from flexmb.scene.schema import ModalNode, Scene
from tests.benchmarks.rivals import flexible_chain, rigid_chain
from tests.benchmarks.routes import articulated, composite_body
from tests.trees import matrix


@pytest.mark.parametrize("n", range(21))
def test_polynomials_are_numbers_of_operations(n):
    """All are whole numbers up to the 20 modes of figure 2."""
    for polynomial in (cost.composite_inertia, cost.bias, cost.articulated_inertia,
                       cost.articulated_inertia_by_identity, cost.inward_sweep, cost.outward_sweep):  # fmt: skip
        assert polynomial(n).total > 0
    assert cost.mass_matrix_row(2, n) == 2 * cost.mass_matrix_row(1, n)


def test_the_scan_of_composite_inertia_is_no_number_of_operations():
    """n^2 + 97/2 n + 116 additions are not whole for odd n: why they are read as n^2/2 + 97/2 n + 116."""
    with pytest.raises(ValueError, match="no number of operations"):
        cost._whole(1, "116 97/2 1")


def test_statements_of_the_paper():
    """Explicit inversion is cheaper for up to 7 modes; factors over 3 and 7 with 5 and 10 modes on 10 bodies."""
    explicit, identity = cost.articulated_inertia, cost.articulated_inertia_by_identity
    cheaper = [n for n in range(21) if explicit(n).total <= identity(n).total]
    assert cheaper == list(range(cost.EXPLICIT_UP_TO + 1))
    ratio = {n: cost.composite([n] * 10).total / cost.articulated([n] * 10).total for n in (5, 10)}
    assert 3.0 < ratio[5] < 4.0
    assert 7.0 < ratio[10] < 8.0


class LinearEquations:
    """L D L' and both substitutions, in place: L above the diagonal, L D on and below it."""

    @staticmethod
    def py_func(matrix, right):
        n = right.shape[0]
        for j in range(n):
            for m in range(j, n):
                for i in range(j):
                    matrix[m, j] -= matrix[m, i] * matrix[i, j]
            for m in range(j + 1, n):
                matrix[j, m] = matrix[m, j] / matrix[j, j]
        for j in range(n):
            for i in range(j):
                right[j] -= matrix[i, j] * right[i]
        for j in range(n):
            right[j] = right[j] / matrix[j, j]
        for j in range(n - 1, -1, -1):
            for i in range(j + 1, n):
                right[j] -= matrix[j, i] * right[i]


@pytest.mark.parametrize("n", [1, 2, 3, 5, 8])
def test_linear_equations_are_an_ldl_factorisation(n):
    """To the last operation, with divisions as multiplications."""
    root, right = np.random.default_rng(n).normal(size=(n, n)), np.ones(n)
    matrix = root @ root.T + n * np.eye(n)
    counted = count(LinearEquations, matrix, right)
    np.testing.assert_allclose(matrix @ counted.arguments[1].astype(float), right, rtol=0.0, atol=1e-12)
    found, printed = counted.operations, cost.linear_equations(n)
    assert found.multiplications + found.divisions == printed.multiplications
    assert found.additions == printed.additions


def executed(route, scene, elimination="explicit") -> Operations:
    """Operations of one evaluation of the accelerations at the initial state."""
    return route(flexmb.compile(scene, elimination)).operations()


def degree(counts: list[int]) -> int:
    """Of the polynomial through counts at equal distances; ValueError where they do not show its end."""
    differences, found = np.array(counts), 0
    while np.any(differences[1:] != differences[:-1]):
        differences, found = np.diff(differences), found + 1
        if len(differences) < 3:
            raise ValueError(f"no polynomial of a degree below {found + 1} goes through {counts}")
    return found


def test_degree():
    for n in range(4):
        assert degree([7 * k**n + k for k in range(8)]) == max(n, 1)
    with pytest.raises(ValueError, match="no polynomial"):
        degree([2**n for n in range(8)])


CHAINS = {
    "rigid": rigid_chain,
    "ruthless": partial(flexible_chain, modes=3, level="ruthless"),
    "free-free": partial(flexible_chain, modes=3, level="ruthless", boundary="free-free"),
    "full": partial(flexible_chain, modes=3, level="full"),
}


@pytest.mark.parametrize("chain", CHAINS)
def test_articulated_bodies_cost_the_same_each(chain):
    """Exactly linear in N once there is an inner body: second differences vanish in every kind of operation."""
    counts = [executed(articulated, CHAINS[chain](n)) for n in range(2, 7)]
    steps = {b - a for a, b in pairwise(counts)}
    assert len(steps) == 1
    assert steps.pop().total > 0


@pytest.mark.parametrize("chain", CHAINS)
def test_composite_bodies_are_cubic_in_bodies(chain):
    """A factorisation of all speeds: their cube over 6 multiplications and as many additions are the leading terms.

    Even numbers of bodies: rows are factorised in pairs.
    """
    speeds = 2 if chain == "rigid" else 8  # of two bodies
    counts = [executed(composite_body, CHAINS[chain](n)) for n in range(2, 13, 2)]
    for kind in ("multiplications", "additions"):
        numbers = [getattr(c, kind) for c in counts]
        assert degree(numbers) == 3
        assert set(np.diff(numbers, 3)) == {speeds**3}


def test_composite_bodies_are_cubic_in_modes():
    """Two bodies: (2 n)^3 / 6 multiplications and as many additions are the leading terms.

    Free-free modes: clamped ones are orthogonal also with the body hinged, and zeros of the factor are left out.
    """
    counts = [executed(composite_body, flexible_chain(2, n, "ruthless", boundary="free-free")) for n in range(1, 8)]
    for kind in ("multiplications", "additions"):
        numbers = [getattr(c, kind) for c in counts]
        assert degree(numbers) == 3
        assert set(np.diff(numbers, 3)) == {8}


@pytest.mark.parametrize("level", ["ruthless", "full"])
def test_explicit_elimination_is_cubic_in_modes(level):
    """A factorisation of D_f: n^3 / 6 multiplications and as many additions are the leading terms of each body."""
    counts = [executed(articulated, flexible_chain(3, n, level)) for n in range(1, 8)]
    for kind in ("multiplications", "additions"):
        numbers = [getattr(c, kind) for c in counts]
        assert degree(numbers) == 3
        assert set(np.diff(numbers, 3)) == {3}


def test_composite_bodies_agree_with_the_paper_in_the_highest_terms():
    """Ours less theirs, free-free modes: no N^3, no N^2 n^2, in multiplications as in additions.

    Of these terms are the linear equations, VII.A.5, and the blocks of the mass matrix, VII.A.2.
    """
    for kind in ("multiplications", "additions"):
        difference = np.array([
            [
                getattr(executed(composite_body, flexible_chain(N, n, "ruthless", boundary="free-free")), kind)
                - getattr(cost.composite([n] * N), kind)
                for n in range(1, 5)
            ]
            for N in range(2, 9, 2)
        ])  # fmt: skip
        assert not np.any(np.diff(difference, 3, axis=0))
        assert not np.any(np.diff(np.diff(difference, 2, axis=0), 2, axis=1))
        assert np.any(np.diff(difference, 2, axis=0))


def particles(bodies: int, modes: int) -> Scene:
    """Chain of clamped bodies whose mode n moves particle n alone: modal masses and stiffness are exactly diagonal."""
    rng = np.random.default_rng(modes)
    scene = SceneBuilder("particles", gravity=(0.0, 0.0, -9.81))
    for k in range(bodies):
        shapes = np.eye(modes)[:, None] * rng.normal(size=(modes, 3, 1))
        points = inertia_points(rng.uniform(0.5, 1.0, modes), rng.uniform(-1.0, 1.0, (modes, 3)), shapes)
        tip = ModalNode(
            name="tip", position_m=(1.0, 0.0, 0.0), translation_modes=matrix(rng.normal(size=(modes, 3))),
            rotation_modes=matrix(rng.normal(size=(modes, 3))),
        )  # fmt: skip
        scene.modal_body(f"b{k}", points=points, stiffness=np.eye(modes), damping=np.eye(modes), level="ruthless",
                         boundary="clamped-free", nodes=[tip])  # fmt: skip
        at = ("ground", {}) if k == 0 else (f"b{k - 1}", {"parent_node": "tip"})
        scene.revolute(f"h{k}", at[0], f"b{k}", axis=(0.0, 0.6, 0.8), angle=0.3, rate=0.2, **at[1])
    return scene.scene()


@pytest.mark.parametrize(("elimination", "expected"), [("explicit", 3), ("woodbury", 2), ("condensed", 1)])
def test_degree_of_each_elimination_in_modes(elimination, expected):
    """(63), (64) by a factor of D_f, by (B3), and condensed: with modal masses and stiffness that are diagonal.

    From 6 modes on, when the tip moves in all directions and Omega has its full rank.
    """
    systems = [flexmb.compile(particles(3, n), elimination) for n in range(6, 13)]
    assert all(set(system.elimination.values()) == {elimination} for system in systems)
    assert degree([articulated(system).operations().total for system in systems]) == expected
