"""Modal integrals against brute-force sums over the points at random states."""

from __future__ import annotations

from math import cos, sin

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from flexmb.modal.flexible_model import FlexibleModel
from flexmb.modal.integrals import ModalIntegrals, TurningPoints, modal_integrals
from tests.flexmb.modal.beam_references import EPS


def random_model(rng: np.random.Generator, points: int, modes: int) -> FlexibleModel:
    """Points with all kinds of inertia: a third massy only, a third with a tensor, a third with an offset as well."""
    root = rng.normal(size=(points, 3, 3))
    inertia = root @ np.swapaxes(root, 1, 2)
    inertia[::3] = 0.0
    com_offset = rng.normal(size=(points, 3))
    com_offset[::3] = com_offset[1::3] = 0.0
    stiffness = rng.normal(size=(modes, modes))
    return FlexibleModel(
        mass=rng.uniform(0.1, 2.0, points),
        position=rng.normal(size=(points, 3)),
        com_offset=com_offset,
        inertia=inertia,
        translation=rng.normal(size=(points, 3, modes)),
        rotation=rng.normal(size=(points, 3, modes)),
        stiffness=stiffness @ stiffness.T,
        damping=np.zeros((modes, modes)),
        nodes={},
        clamped=False,
    )


def left_jacobian(theta: np.ndarray) -> np.ndarray:
    """Angular velocity of exp(skew(theta)) in outer axes is left_jacobian(theta) thetadot."""
    angle = float(np.linalg.norm(theta))
    S = np.array([[0, -theta[2], theta[1]], [theta[2], 0, -theta[0]], [-theta[1], theta[0], 0]])
    if angle == 0.0:
        return np.eye(3)
    return np.eye(3) + (1 - cos(angle)) / angle**2 * S + (angle - sin(angle)) / angle**3 * S @ S


def kinetic_energy(points, eta, rate, w, v) -> tuple[float, float]:
    """Energy of points (a model or a set of turning points) by definition, and the number of terms summed."""
    energy = 0.0
    for j in range(len(points.mass)):
        theta = points.rotation[j] @ eta
        R = Rotation.from_rotvec(theta).as_matrix()
        turning = left_jacobian(theta) @ (points.rotation[j] @ rate)
        arm = R @ points.com_offset[j]
        place = points.position[j] + points.translation[j] @ eta + arm
        velocity = v + np.cross(w, place) + points.translation[j] @ rate + np.cross(turning, arm)
        spin = R.T @ (w + turning)
        energy += 0.5 * points.mass[j] * velocity @ velocity + 0.5 * spin @ points.inertia[j] @ spin
    return energy, 60.0 * len(points.mass) * len(eta)


def polynomial_energy(known: ModalIntegrals, eta, rate, w, v) -> float:
    """The kinetic energy of the module's docstring."""
    s = known.s0 + known.s1 @ eta
    J1 = np.einsum("n,nab->ab", eta, known.J1)
    J = known.J0 + J1 + J1.T + np.einsum("n,k,nkab->ab", eta, eta, known.J2)
    C = known.C0 + np.einsum("k,kan->an", eta, known.C1)
    return float(
        0.5 * rate @ known.M_ff @ rate
        + w @ C @ rate
        + v @ known.s1 @ rate
        + 0.5 * w @ J @ w
        + v @ np.cross(w, s)
        + 0.5 * known.mass * v @ v
    )


@pytest.mark.parametrize("seed", range(8))
def test_kinetic_energy_is_the_sum_over_points(seed):
    rng = np.random.default_rng(seed)
    model = random_model(rng, points=10, modes=4)
    integrals = modal_integrals(model)
    eta, rate = rng.normal(size=4), rng.normal(size=4)
    w, v = rng.normal(size=3), rng.normal(size=3)
    direct, terms = kinetic_energy(model, eta, rate, w, v)
    turning, _ = kinetic_energy(integrals.turning, eta, rate, w, v)
    # A sum of `terms` products; all point energies are positive, so no cancellation beyond that within a point.
    assert polynomial_energy(integrals, eta, rate, w, v) + turning == pytest.approx(direct, rel=terms * EPS)


@pytest.mark.parametrize("seed", range(4))
def test_spatial_mass_matrix_is_the_energy_at_rest_shape(seed):
    rng = np.random.default_rng(seed)
    model = random_model(rng, points=10, modes=4)
    M = modal_integrals(model).spatial_mass
    zero = np.zeros(4)
    for _ in range(5):
        rate, w, v = rng.normal(size=4), rng.normal(size=3), rng.normal(size=3)
        speeds = np.concatenate([rate, w, v])
        direct, terms = kinetic_energy(model, zero, rate, w, v)
        assert 0.5 * speeds @ M @ speeds == pytest.approx(direct, rel=terms * EPS)
    assert pytest.approx(M.T, rel=0, abs=10 * EPS * np.abs(M).max()) == M


def test_polynomial_and_turning_parts_split_the_points():
    model = random_model(np.random.default_rng(1), points=9, modes=3)
    integrals = modal_integrals(model)
    turning: TurningPoints = integrals.turning
    assert turning.mass.tolist() == [0.0, model.mass[2], 0.0, model.mass[5], 0.0, model.mass[8]]
    assert integrals.mass + turning.mass.sum() == pytest.approx(model.mass.sum(), rel=9 * EPS)


def test_symmetries_of_the_integrals():
    integrals = modal_integrals(random_model(np.random.default_rng(2), points=9, modes=3))
    assert np.swapaxes(integrals.C1, 0, 2) == pytest.approx(-integrals.C1, abs=1e3 * EPS)
    assert integrals.J2.transpose(1, 0, 3, 2) == pytest.approx(integrals.J2, abs=1e3 * EPS)
    assert pytest.approx(integrals.J0.T, abs=1e3 * EPS) == integrals.J0
