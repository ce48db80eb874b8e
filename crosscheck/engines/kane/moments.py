"""All mass integrals of a body in one matrix, and the tensors of Kane's equations that follow from it.

A point of a body of level "full" is at rho = N z from the body's origin, with N = [r, phi_1, .., phi_m] (3, m+1) and
z = [1, eta]. Every integral that its equations need is an element of the second moments (1+3(m+1), 1+3(m+1)) of
y = [1, N], N row by row: sum m y y'. Its partial velocities (3, 6+m) by the velocity of the origin, the angular
velocity and the modal rates, [1, -rho~, phi], are linear in y and in z.
"""

from __future__ import annotations

import numpy as np

from flexmb.typing import Real

LEVI_CIVITA = np.zeros((3, 3, 3))
LEVI_CIVITA[[0, 1, 2], [1, 2, 0], [2, 0, 1]] = 1.0
LEVI_CIVITA[[0, 2, 1], [2, 1, 0], [1, 0, 2]] = -1.0


def moments_of_points(mass: Real, position: Real, shapes: Real) -> Real:
    """Second moments (1+3(m+1), 1+3(m+1)) of points: mass (n,) kg, position (n, 3) m, shapes (n, 3, m)."""
    N = np.concatenate([position[:, :, None], shapes], axis=2).reshape(len(mass), -1)
    y = np.column_stack([np.ones(len(mass)), N])
    return np.asarray(y.T @ (mass[:, None] * y))


def rigid_moments(mass: float, centre: Real, inertia: Real) -> Real:
    """Those (4, 4) of a rigid body: mass centre (3,) m from the origin, inertia (3, 3) kg m^2 about the mass centre.

    The second moments of its mass about the mass centre are tr(J)/2 1 - J.
    """
    about_centre = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    first = mass * centre
    return np.block([[np.array([[mass]]), first[None]], [first[:, None], about_centre + np.outer(first, centre)]])


def with_modes(moments: Real, modes: int) -> Real:
    """The same body with further modes that move nothing, `modes` in all."""
    size = (len(moments) - 1) // 3
    place = np.concatenate([[0], 1 + (np.arange(3)[:, None] * (modes + 1) + np.arange(size)).ravel()])
    wider = np.zeros((4 + 3 * modes, 4 + 3 * modes))
    wider[np.ix_(place, place)] = moments
    return wider


def partial_velocities(modes: int) -> Real:
    """T (m+1, 3, 6+m, 1+3(m+1)): component a of partial velocity i is the sum of z_c T[c, a, i] . y over c."""
    columns = modes + 1
    T = np.zeros((columns, 3, 6 + modes, 1 + 3 * columns))
    for a in range(3):
        T[0, a, a, 0] = 1.0
        for n in range(modes):
            T[0, a, 6 + n, 1 + a * columns + 1 + n] = 1.0
        for c in range(columns):
            T[c, a, 3:6, 1 + c :: columns] = LEVI_CIVITA[a]  # e_j x rho
    return T


def tensors(moments: Real) -> tuple[Real, Real]:
    """Of bodies with the second moments (b, s, s): Q (b, m+1, m+1, 6+m, 6+m) and S (b, m+1, 6+m, 3, s).

    The mass matrix is the sum of z_c z_d Q[c, d]. Points with the accelerations B y beyond those of the body's own
    coordinates, B (3, s), have the generalised inertia forces sum z_c S[c] : B.
    """
    T = partial_velocities((moments.shape[-1] - 4) // 3)
    S = np.einsum("caix,bxy->bciay", T, moments)
    return np.einsum("bciay,dajy->bcdij", S, T), S
