"""The flexible slider-crank of the Test Set for IVP Solvers: its printed matrices, and its printed equations of motion,
integrated by SciPy."""

from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from crosscheck.library.reference import load_reference
from flexmb.scene.files import load_scene
from flexmb.scene.modal_data import modal_arrays
from flexmb.typing import Real

CASE = Path(__file__).parents[2] / "cases" / "flexible_mechanisms" / "slider_crank_simeon"
ROD, SLIDER, CRANK_LENGTH, ROD_LENGTH, ROD_INERTIA = 0.151104, 0.075552, 0.15, 0.30, 0.0045339259
CRANK_RATE, PI = 150.0, 3.1415927
SQUARE, STRETCH = ROD * np.diag([0.5, 0.5, 8.0, 2.0]), 0.2e12 * 0.008**2 / ROD_LENGTH
SQUARE[2, 3] = SQUARE[3, 2] = ROD
STIFFNESS = STRETCH * np.diag([PI**4 / 24.0 * (0.008 / 0.3) ** 2, PI**4 / 1.5 * (0.008 / 0.3) ** 2, 16 / 3, 7 / 3])
STIFFNESS[2, 3] = STIFFNESS[3, 2] = -STRETCH * 8 / 3
ALONG, ACROSS = ROD * np.array([0, 0, 2 / 3, 1 / 6]), ROD * np.array([2 / np.pi, 0, 0, 0])
FIRST_ALONG = ROD * ROD_LENGTH * np.array([0, 0, 1 / 3, 1 / 6])
FIRST_ACROSS = ROD * ROD_LENGTH * np.array([1 / np.pi, -0.5 / np.pi, 0, 0])
CROSSED = np.zeros((4, 4))
CROSSED[0, 2:] = -16 / np.pi**3, 8 / np.pi**3 - 1 / np.pi
CROSSED[1, 3] = 0.5 / np.pi
CROSSED = ROD * (CROSSED - CROSSED.T)


def test_points_have_the_printed_integrals() -> None:
    """The last is antisymmetric: displacements along times those across, less the reverse."""
    data = modal_arrays(load_scene(CASE / "scene.toml").bodies[1])
    m, x, (along, across, _) = data.mass, data.position, np.moveaxis(data.translation_modes, 1, 0)
    for found, printed in (
        (np.sum(m), ROD),
        (m @ np.sum(x**2, axis=1), ROD_INERTIA),
        (m @ x[:, 1], 0.0),
        (m @ along, ALONG),
        (m @ across, ACROSS),
        ((m * x[:, 0]) @ along, FIRST_ALONG),
        ((m * x[:, 0]) @ across - (m * x[:, 1]) @ along, FIRST_ACROSS),
        (along.T @ (m[:, None] * along) + across.T @ (m[:, None] * across), SQUARE),
        (along.T @ (m[:, None] * across) - across.T @ (m[:, None] * along), CROSSED),
    ):
        assert np.max(np.abs(found - printed)) < 1e-12 * ROD


def accelerations(t: float, angle: float, q: Real, rate: float, dq: Real) -> Real:
    """Of the rod's angle, the slider and q, then the two multipliers."""
    crank = CRANK_RATE * t
    sin, cos, length = np.sin(crank - angle), np.cos(crank - angle), ROD_LENGTH + q[3]
    A, f = np.zeros((8, 8)), np.zeros(8)
    A[0, 0] = ROD_INERTIA + q @ SQUARE @ q + 2.0 * FIRST_ALONG @ q
    A[0, 2:6] = A[2:6, 0] = FIRST_ACROSS + q @ CROSSED
    A[1, 1], A[2:6, 2:6] = SLIDER, SQUARE
    G = np.array(
        [[length * np.cos(angle), 0, 0, 0, 0, np.sin(angle)], [length * np.sin(angle), 1, 0, 0, 0, -np.cos(angle)]]
    )
    A[6:, :6], A[:6, 6:] = G, G.T
    pull = CRANK_LENGTH * CRANK_RATE**2
    f[0] = pull * (0.5 * ROD_LENGTH * ROD * sin + sin * (ALONG @ q) - cos * (ACROSS @ q))
    f[0] -= 2.0 * rate * (FIRST_ALONG @ dq + dq @ SQUARE @ q) + dq @ CROSSED @ dq
    f[2:6] = rate**2 * (SQUARE @ q + FIRST_ALONG) + pull * (cos * ALONG + sin * ACROSS)
    f[2:6] += 2.0 * rate * CROSSED @ dq - STIFFNESS @ q
    f[6] = pull * np.sin(crank) + length * np.sin(angle) * rate**2 - 2.0 * rate * np.cos(angle) * dq[3]
    f[7] = -pull * np.cos(crank) - length * np.cos(angle) * rate**2 - 2.0 * rate * np.sin(angle) * dq[3]
    return np.linalg.solve(A, f)


def test_the_printed_equations_move_like_the_reference() -> None:
    """Over a third of a turn. The start has nine digits; what they leave open rings on in the forces."""
    stored, until = load_reference(CASE), 15
    times = stored.times[: until + 1]
    start = [0, 0, 0, 0.103339863e-4, 0.169327969e-4]
    start += [-74.9957670, 0.444896105, 0.463434311e-2, -0.178591076e-5, -0.268938672e-5]

    def rate(t: float, y: Real) -> Real:
        found = accelerations(t, y[0], y[1:5], y[5], y[6:])
        return np.concatenate([y[5:], found[:1], found[2:6]])

    run = solve_ivp(rate, (0.0, times[-1]), start, "DOP853", times, rtol=1e-10, atol=1e-14)
    y = run.y.T
    x = CRANK_LENGTH * np.cos(CRANK_RATE * times) + (ROD_LENGTH + y[:, 4]) * np.cos(y[:, 0])
    assert np.max(np.abs(x - stored.channels["marker:slider.position"][: until + 1, 0])) < 1e-9
    assert np.max(np.abs(y[:, 5] - stored.channels["marker:rod.angular_velocity"][: until + 1, 2])) < 2e-6
    forces = np.array([accelerations(t, s[0], s[1:5], s[5], s[6:])[6:] for t, s in zip(times, y, strict=True)])
    stored_forces = stored.channels["load:wristpin.force"][: until + 1]
    assert np.max(np.abs(np.stack([-forces[:, 1], forces[:, 0]], axis=1) - stored_forces[:, :2])) < 2e-4
