"""Beams to test with, and their frequencies from equations that share nothing with the finite elements."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

from flexmb.modal.flexible import flexible_model
from flexmb.scene.bodies import BeamBody, BeamStation, Modes
from flexmb.typing import Real

EPS = np.finfo(float).eps

UNIT = {
    "x_m": 0.0, "EA_N": 1e4, "EIy_Nm2": 1.0, "EIz_Nm2": 1.0, "GJ_Nm2": 0.7, "mass_per_length_kg_m": 1.0,
}  # fmt: skip


def beam(elements: int, count: int, section: dict | None = None, modes: dict | None = None, **changes) -> BeamBody:
    """A uniform beam of length 1, EI = 1, mass 1 per length, with changed section, modes and other keys."""
    data = {
        "name": "beam",
        "length_m": 1.0,
        "elements": elements,
        "stations": (BeamStation(**(UNIT | (section or {}))),),
        "modes": Modes(**({"count": count} | (modes or {}))),
    }
    return BeamBody(**(data | changes))


def frequencies(body: BeamBody) -> Real:
    """Angular frequencies (m,) of the model of `body`."""
    return np.sqrt(np.diag(flexible_model(body).stiffness))


def clamped_free_roots(count: int) -> Real:
    """beta L with cos cosh + 1 = 0."""
    return _roots(lambda b: np.cos(b) + 1.0 / np.cosh(b), [(n * np.pi, (n + 1) * np.pi) for n in range(count)])


def free_free_roots(count: int) -> Real:
    """beta L > 0 with cos cosh - 1 = 0."""
    return _roots(lambda b: np.cos(b) - 1.0 / np.cosh(b), [(n * np.pi, (n + 1) * np.pi) for n in range(1, count + 1)])


def tip_mass_roots(ratio: float, count: int) -> Real:
    """beta L of a clamped beam with a point mass `ratio` times the beam's at the tip.

    1 + cos cosh + ratio b (cos sinh - sin cosh) = 0, divided by cosh.
    """

    def equation(b: float) -> float:
        return 1.0 / np.cosh(b) + np.cos(b) + ratio * b * (np.cos(b) * np.tanh(b) - np.sin(b))

    return _roots(equation, [(n * np.pi + 1e-6, (n + 1) * np.pi) for n in range(count)])


def plane_roots(
    length: float, EI: float, GA: float, mass: float, rotary: float, guesses: Real, tip: Real | None = None
) -> Real:
    """Frequencies of a uniform clamped Timoshenko beam by its transfer matrix, next to `guesses` (within 1 %).

    State [v, theta, M, Q]: v' = theta + Q/GA, theta' = M/EI, M' = -Q - rotary w^2 theta, Q' = -mass w^2 v. At the tip
    [Q; M] = w^2 tip [v; theta] for a lump with the mass matrix `tip` (2,2), zero without.
    """
    lump = np.zeros((2, 2)) if tip is None else tip

    def equation(omega: float) -> float:
        w2 = omega**2
        A = np.array([[0, 1, 0, 1 / GA], [0, 0, 1 / EI, 0], [0, -rotary * w2, 0, -1], [-mass * w2, 0, 0, 0]])
        T = expm(A * length)[:, 2:]
        return float(np.linalg.det(T[[3, 2]] - w2 * lump @ T[:2]))

    return _roots(equation, [(0.99 * g, 1.01 * g) for g in guesses])


def varying_roots(EI: Callable[[float], float], mass: Callable[[float], float], guesses: Real) -> Real:
    """Frequencies of a clamped Euler-Bernoulli beam of length 1 with varying section, by integrating its equation.

    Integration tolerance 1e-12, hence good to about 1e-10.
    """

    def equation(omega: float) -> float:
        def slope(x: float, state: Real) -> Real:
            v, theta, M, Q = state.reshape(4, 2)
            return np.concatenate([theta, M / EI(x), -Q, -mass(x) * omega**2 * v])

        start = np.zeros((4, 2))
        start[2, 0] = start[3, 1] = 1.0
        end = solve_ivp(slope, (0.0, 1.0), start.ravel(), method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
        return float(np.linalg.det(end.reshape(4, 2)[2:]))

    return _roots(equation, [(0.99 * g, 1.01 * g) for g in guesses])


def slopes(sizes: list[int], errors: Real) -> Real:
    """Observed orders between neighbouring sizes: -d log(error) / d log(size); errors (len(sizes), k)."""
    return -np.diff(np.log(errors), axis=0) / np.diff(np.log(sizes))[:, None]


def _roots(equation: Callable[[float], float], brackets: list[tuple[float, float]]) -> Real:
    return np.array([brentq(equation, low, high, xtol=1e-300, rtol=4 * EPS) for low, high in brackets])
