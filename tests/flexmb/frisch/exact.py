"""The exact kinetic energy of a body's points, and its derivatives from Cauchy's formula.

Everything is analytic in the modal coordinates, so a Taylor coefficient is a mean over a circle in the complex plane:
no step to choose, no cancellation. The rotations are exponentials, summed as power series.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexmb.modal.flexible_model import FlexibleModel, FlexibleNode
from tests.bounds import gamma

RADIUS = 0.1
CIRCLE = 16  # nodes: the next coefficient that aliases is RADIUS^16 of its size, below round-off
_SERIES = 20


def random_body(seed: int, points: int = 6, modes: int = 3, *, particles: bool = False, clamped: bool = True):
    """Points with anisotropic inertia and offset mass centres, or particles only; rotations of order one."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(points, 3, 3))
    second = root @ np.swapaxes(root, 1, 2)
    inertia = np.trace(second, axis1=1, axis2=2)[:, None, None] * np.eye(3) - second
    stiffness, damping = rng.normal(size=(2, modes, modes))
    still = np.zeros((3, modes))
    return FlexibleModel(
        mass=rng.uniform(0.5, 2.0, points),
        position=rng.normal(size=(points, 3)),
        com_offset=np.zeros((points, 3)) if particles else rng.normal(size=(points, 3)),
        inertia=np.zeros((points, 3, 3)) if particles else inertia,
        translation=rng.normal(size=(points, 3, modes)),
        rotation=rng.normal(size=(points, 3, modes)),
        stiffness=stiffness @ stiffness.T,
        damping=damping @ damping.T,
        nodes={"origin": FlexibleNode(np.zeros(3), np.eye(3), still, still)},
        clamped=clamped,
    )


def skew(v: np.ndarray) -> np.ndarray:
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def exponential(theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """exp(theta~), and the left Jacobian that makes theta's rate an angular velocity."""
    term, R, left = np.eye(3), np.eye(3), np.eye(3)
    for k in range(1, _SERIES):
        term = term @ skew(theta) / k
        R, left = R + term, left + term / (k + 1)
    return R, left


def mass_matrix(model: FlexibleModel, eta: np.ndarray) -> np.ndarray:
    """Of the kinetic energy in [etadot; w; v], body frame, at any eta, complex too."""
    n = model.mode_count
    M = np.zeros((n + 6, n + 6), dtype=np.asarray(eta).dtype)
    for i in range(len(model.mass)):
        R, left = exponential(model.rotation[i] @ eta)
        arm, W = R @ model.com_offset[i], left @ model.rotation[i]
        x = model.position[i] + model.translation[i] @ eta + arm
        U = np.hstack([model.translation[i] - skew(arm) @ W, -skew(x), np.eye(3)])
        V = np.hstack([W, np.eye(3), np.zeros((3, 3))])
        M = M + model.mass[i] * U.T @ U + V.T @ R @ model.inertia[i] @ R.T @ V
    return M


def coefficient(f: Callable[[complex], np.ndarray], order: int) -> np.ndarray:
    """Taylor coefficient of f(t) at t = 0."""
    circle = RADIUS * np.exp(2j * np.pi * np.arange(CIRCLE) / CIRCLE)
    return sum(f(t) / t**order for t in circle) / CIRCLE


def slope(f: Callable[[np.ndarray], np.ndarray], direction: np.ndarray) -> np.ndarray:
    """Derivative of f at 0 along `direction`."""
    return coefficient(lambda t: f(t * direction), 1).real


def second(f: Callable[[np.ndarray], np.ndarray], a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Second derivative of f at 0 along `a` and `b`."""
    both, difference = (coefficient(lambda t, d=d: f(t * d), 2).real for d in (a + b, a - b))
    return 0.5 * (both - difference)


def rounding(model: FlexibleModel, order: int = 0) -> float:
    """Share of the largest term by which a sum over the points, differentiated `order` times, is rounded.

    A term passes through the power series of its rotation, five roundings a step, a product of four 3 x 3 matrices and
    the sum over the points.
    """
    return gamma(5 * _SERIES + 4 * 5 + len(model.mass)) / RADIUS**order


def coriolis(model: FlexibleModel, eta: np.ndarray, etad: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Lagrange's d/dt dT/detadot - dT/deta (n,) at rest of all accelerations and of the body origin, exact."""
    u = np.concatenate([etad, w, np.zeros(3)])
    unit = np.eye(model.mode_count)
    dM = [coefficient(lambda t, k=k: mass_matrix(model, eta + t * unit[k]), 1) for k in range(model.mode_count)]
    rate = sum(dM[k] * etad[k] for k in range(model.mode_count))
    return np.array([(rate @ u)[n] - 0.5 * u @ dM[n] @ u for n in range(model.mode_count)])
