"""Eigenfrequencies of the linearised motion from derivatives, and how well they are known.

    A = [[transport, 1], [by_displacement, by_speed]],    A x = lambda x

The frequencies (rad/s) are the imaginary parts of the 2n eigenvalues lambda: n numbers from the lowest to the highest,
one for each conjugate pair, and 0 for two real eigenvalues: motion that does not oscillate. A repeated frequency stands
in the list as often as it occurs. About an equilibrium they are those of small vibrations; elsewhere those of the
equations with their coefficients held.

**Errors.** Of undamped motion without gyroscopic terms, -by_displacement is similar to the symmetric matrix
S = -L^-1 by_displacement L, where by_force = L L'. Its eigenvalues are the squares w^2, and no change E of S changes
one by more than e = |E| (Weyl), also if they are repeated. Any other motion: first-order perturbation, with left and
right eigenvectors y and x, |y'| |E| |x| / |y'x|, and at most the root of the change where y'x vanishes (a defective
eigenvalue). A frequency within its error of zero, such as that of a rigid-body motion, is given as zero and known to
that error, which is the root of what the matrices are known to.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import cholesky, eig, solve_triangular

from crosscheck.engines.linear.matrices import EPS, LinearMatrices, norm
from flexmb.typing import Real


def eigenfrequencies(at: LinearMatrices) -> tuple[Real, float]:
    """The frequencies (n,) and the Euclidean norm of their errors (rad/s), infinite where the masses are singular."""
    if not np.isfinite((at.errors.by_displacement, at.errors.by_speed)).all():
        return np.zeros(len(at.by_speed)), float("inf")
    undamped = _undamped(at)
    frequencies, errors = undamped if undamped is not None else _damped(at)
    frequencies = np.where(frequencies <= errors, 0.0, frequencies)
    order = np.argsort(frequencies, kind="stable")
    return frequencies[order], norm(errors)


def _undamped(at: LinearMatrices) -> tuple[Real, Real] | None:
    """Frequencies and errors where speeds have no part and S is symmetric, within what is known; None elsewhere."""
    if norm(at.by_speed) > at.errors.by_speed or norm(at.transport) > 0.0:
        return None
    L = cholesky(at.by_force, lower=True)
    S = -solve_triangular(L, at.by_displacement @ L, lower=True)
    doubt = at.errors.by_displacement * float(np.linalg.cond(L)) + len(S) * EPS * norm(S)
    return _of_squares(S, doubt) if norm(S - S.T) <= 2.0 * doubt else None


def _of_squares(S: Real, doubt: float) -> tuple[Real, Real]:
    """Roots of the eigenvalues of a symmetric matrix that is known to `doubt`, 0 for negative ones, with errors."""
    squares = np.linalg.eigvalsh((S + S.T) / 2.0)
    frequencies = np.sqrt(np.maximum(squares, 0.0))
    reach = np.sqrt(frequencies**2 + doubt)
    return frequencies, doubt / (reach + frequencies) if doubt > 0.0 else np.zeros_like(frequencies)


def _damped(at: LinearMatrices) -> tuple[Real, Real]:
    """Frequencies and errors by the eigenvalues of A in the coordinates a, b of xi = L a, u = s L b, which have no
    units: their inertia is 1, and s is the size of the frequencies."""
    n = len(at.by_speed)
    L = cholesky(at.by_force, lower=True)
    T, Q, V = (solve_triangular(L, part @ L, lower=True) for part in (at.transport, at.by_displacement, at.by_speed))
    s = max(np.sqrt(norm(Q)), norm(V), norm(T)) or 1.0
    A = np.block([[T, s * np.eye(n)], [Q / s, V]])
    values, left, right = eig(A, left=True, right=True)
    overlap = np.abs(np.sum(left.conj() * right, axis=0))
    displaced, hurried = np.linalg.norm(L @ right[:n], axis=0), s * np.linalg.norm(L @ right[n:], axis=0)
    weight = np.linalg.norm(solve_triangular(L.T, left[n:], lower=False), axis=0) / s
    change = weight * (at.errors.by_displacement * displaced + at.errors.by_speed * hurried)
    change += 2 * n * EPS * norm(A)
    errors = np.minimum(change / np.maximum(overlap, np.sqrt(EPS)), np.sqrt(change * norm(A)))
    order = np.argsort(np.abs(values.imag), kind="stable")
    return np.abs(values.imag)[order][::2], errors[order][::2]
