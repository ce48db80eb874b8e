"""First-order tables against the exact kinetic energy: its mass matrix is entire in eta, so that the mean over a circle
of complex scales gives every Taylor coefficient to round-off."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flexmb.modal.first_order import FirstOrder, first_order, inertia_slope
from flexmb.modal.flexible_model import FlexibleModel
from flexmb.modal.integrals import modal_integrals
from flexmb.scene.quaternions import cross_matrix
from tests.bounds import gamma
from tests.flexmb.modal.test_modal_points import random_model

POINTS, MODES = 8, 3
CIRCLE = 64  # samples: the 65th coefficient is the first to spoil the first, below 1e-30 for |theta| < 5


def mass_matrix(model: FlexibleModel, eta: np.ndarray) -> np.ndarray:
    """(m+6,m+6) [modes; angular; linear] of complex eta: sum m U'U + V' R J R' V, exponentials as power series."""
    total = np.zeros((MODES + 6, MODES + 6), complex)
    none = np.zeros((3, 3))
    for m, r, c, J, phi, psi in zip(
        model.mass, model.position, model.com_offset, model.inertia, model.translation, model.rotation, strict=True
    ):
        S = cross_matrix(psi @ eta)
        R, left, term = np.zeros((3, 3), complex), np.zeros((3, 3), complex), np.eye(3, dtype=complex)
        for n in range(1, 60):
            R, left, term = R + term, left + term / n, term @ S / n
        arm, W = R @ c, left @ psi
        U = np.hstack([phi - cross_matrix(arm) @ W, -cross_matrix(r + phi @ eta + arm), np.eye(3)])
        V = np.hstack([W, np.eye(3), none])
        total += m * U.T @ U + V.T @ R @ J @ R.T @ V
    return total


def coefficients(model: FlexibleModel, eta: np.ndarray) -> list[np.ndarray]:
    """Taylor coefficients 0, 1, 2 of M(x eta) in x."""
    circle = np.exp(2j * np.pi * np.arange(CIRCLE) / CIRCLE)
    samples = [mass_matrix(model, x * eta) for x in circle]
    return [np.tensordot(circle**-order, samples, 1).real / CIRCLE for order in range(3)]


def size(model: FlexibleModel, eta: np.ndarray) -> float:
    """The largest element anywhere on the circle, times the roundings of its sum."""
    worst = np.max(np.abs(mass_matrix(model, 1j * eta))) + np.max(np.abs(mass_matrix(model, eta)))
    return gamma(CIRCLE * POINTS * 36) * float(worst)


def matrix(known: FirstOrder, M_ff, C, L, J, s, mass) -> np.ndarray:
    S = cross_matrix(s)
    coupling = np.hstack([C, L])
    return np.block([[M_ff, coupling], [coupling.T, np.block([[J, S], [S.T, mass * np.eye(3)]])]])


def orders(known: FirstOrder, eta: np.ndarray) -> list[np.ndarray]:
    """The mass matrix of the tables: order 0, and order 1 along eta."""
    return [
        matrix(known, known.M0, known.C0, known.L0, known.J0, known.s0, known.mass),
        matrix(
            known, np.tensordot(eta, known.M1, 1), np.tensordot(eta, known.C1, 1), np.tensordot(eta, known.L1, 1),
            np.tensordot(eta, known.E, 1), eta @ known.L0, 0.0,
        ),
    ]  # fmt: skip


@pytest.mark.parametrize("seed", range(3))
def test_tables_are_the_taylor_coefficients_of_the_exact_mass_matrix(seed):
    rng = np.random.default_rng(seed)
    model = random_model(rng, POINTS, MODES)
    known = first_order(model)
    for eta in (*np.eye(MODES), rng.normal(size=MODES)):
        bound = size(model, eta)
        exact = coefficients(model, eta)
        for found, expected in zip(orders(known, eta), exact[:2], strict=True):
            assert np.max(np.abs(found - expected)) <= bound
        curvature = np.einsum("n,k,nkab->ab", eta, eta, known.G)
        assert np.max(np.abs(curvature - exact[2][MODES : MODES + 3, MODES : MODES + 3])) <= bound


def test_every_pair_of_modes_has_its_curvature():
    """G_nk by polarisation: half of what two modes together have beyond each alone."""
    model = random_model(np.random.default_rng(7), POINTS, MODES)
    G = first_order(model).G
    rotary = slice(MODES, MODES + 3)
    for n in range(MODES):
        for k in range(n):
            one, other = np.eye(MODES)[n], np.eye(MODES)[k]
            both, first, second = (coefficients(model, eta)[2][rotary, rotary] for eta in (one + other, one, other))
            assert np.max(np.abs(G[n, k] - 0.5 * (both - first - second))) <= 3.0 * size(model, one + other)


def test_symmetries():
    known = first_order(random_model(np.random.default_rng(3), POINTS, MODES))
    for a, b in [
        (known.G, np.swapaxes(known.G, 0, 1)), (known.G, np.swapaxes(known.G, 2, 3)),
        (known.L1, np.swapaxes(known.L1, 0, 1)), (known.M1, np.swapaxes(known.M1, 1, 2)),
        (known.E, np.swapaxes(known.E, 1, 2)),
    ]:  # fmt: skip
        assert np.max(np.abs(a - b)) <= gamma(100) * np.max(np.abs(a))


def test_modal_masses_change_with_turning_inertia_only():
    """Point masses on their points, and isotropic tensors, have modal masses that no deformation changes."""
    model = random_model(np.random.default_rng(4), POINTS, MODES)
    plain = replace(model, com_offset=0.0 * model.com_offset, inertia=0.0 * model.inertia)
    assert not np.any(first_order(plain).M1)
    balls = replace(plain, inertia=np.tile(2.0 * np.eye(3), (POINTS, 1, 1)))
    assert np.max(np.abs(first_order(balls).M1)) <= gamma(100) * np.max(np.abs(first_order(model).M1))
    assert np.max(np.abs(first_order(model).M1)) > 0.1


def test_polynomial_part_agrees_with_the_modal_integrals():
    model = random_model(np.random.default_rng(5), POINTS, MODES)
    plain = replace(model, com_offset=0.0 * model.com_offset, inertia=0.0 * model.inertia)
    known, integrals = first_order(plain), modal_integrals(plain)
    for ours, theirs in [
        (known.E, integrals.J1 + np.swapaxes(integrals.J1, 1, 2)), (known.C1, np.moveaxis(integrals.C1, 1, 2)),
        (known.G, 0.5 * (integrals.J2 + np.swapaxes(integrals.J2, 2, 3))), (known.L0, integrals.s1.T),
        (inertia_slope(plain), known.E),
    ]:  # fmt: skip
        assert np.max(np.abs(ours - theirs)) <= gamma(POINTS * 36) * np.max(np.abs(theirs))
