"""The stages of a step by Radau IIA of order 5: decoupled, and solved for by simplified Newton iterations.

Hairer, Wanner, Solving Ordinary Differential Equations II (1996), IV.8: one real and one complex factorisation.

Of its coefficients (IV.5) only the Runge-Kutta matrix and the error weights are data; what else the method needs
follows from them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from flexmb.integrate import newton_matrix
from flexmb.integrate.control import FACTORISATIONS, derivative, linearisation, scaled_norm
from flexmb.integrate.newton_matrix import NewtonMatrix
from flexmb.integrate.stiff_place import StiffPlace, answer, settle_at, shift, stiff_place, suffices
from flexmb.jit.kernel import helper, sweep
from flexmb.tables.status import NONFINITE, NOT_CONVERGED, OK

_R6 = np.sqrt(6.0)

C = np.array([(4.0 - _R6) / 10.0, (4.0 + _R6) / 10.0, 1.0])
A = np.array([
    [(88.0 - 7.0 * _R6) / 360.0, (296.0 - 169.0 * _R6) / 1800.0, (-2.0 + 3.0 * _R6) / 225.0],
    [(296.0 + 169.0 * _R6) / 1800.0, (88.0 + 7.0 * _R6) / 360.0, (-2.0 - 3.0 * _R6) / 225.0],
    [(16.0 - _R6) / 36.0, (16.0 + _R6) / 36.0, 1.0 / 9.0],
])  # fmt: skip

# (8.19): with the slope f0 at the start, h f0 + E'Z is h times the defect of the collocation polynomial there.
E = np.array([-13.0 - 7.0 * _R6, -13.0 + 7.0 * _R6, -1.0]) / 3.0

# A^-1 = V diag(REAL, COMPLEX, conj COMPLEX) W: stages Z = V w decouple into one real and one complex system.
_values, _vectors = np.linalg.eig(np.linalg.inv(A))
_order = np.lexsort((-_values.imag, np.abs(_values.imag)))  # the real one, then the pair with the positive part first
_values, _vectors = _values[_order], _vectors[:, _order]
_inverse = np.linalg.inv(_vectors)
REAL, COMPLEX = float(_values[0].real), complex(_values[1])
V_REAL, V_COMPLEX = np.ascontiguousarray(_vectors[:, 0].real), np.ascontiguousarray(_vectors[:, 1])
W_REAL, W_COMPLEX = np.ascontiguousarray(_inverse[0].real), np.ascontiguousarray(_inverse[1])

# Collocation polynomial y + sum over i, k of P[i, k] Z[i] x^(k+1), through y at x = 0 and y + Z_i at x = C_i.
P = np.ascontiguousarray(np.linalg.inv(C[:, None] ** np.arange(1, 4)).T)


ITERATIONS = 7  # of Newton's method, at most


class RadauStages(NamedTuple):
    """Arrays of a step: slope f at its start; stages Z, those of the step before, slopes F (3,n); factors; unknowns w,
    v and corrections dw, dv, decoupled.
    """

    f: np.ndarray
    J: np.ndarray
    real: NewtonMatrix
    paired: NewtonMatrix
    Z: np.ndarray
    Z_before: np.ndarray
    F: np.ndarray
    w: np.ndarray
    v: np.ndarray
    dw: np.ndarray
    dv: np.ndarray
    y_new: np.ndarray
    f_new: np.ndarray
    error: np.ndarray
    trial: np.ndarray
    change: np.ndarray
    stiff: StiffPlace


@helper
def renew(problem, t, y, s, counts):
    """Linearise at (t, y): the Jacobian, or the place of the stiff part where this suffices; returns a status code."""
    if suffices(s.stiff):
        return settle_at(problem, t, y, s.stiff)
    return linearisation(problem, t, y, s.J, counts)


@sweep
def factorise(problem, s, h, counts):
    """Factors of REAL/h - J and COMPLEX/h - J, or of the stiff parts; returns whether both are regular."""
    counts[FACTORISATIONS] += 1
    if suffices(s.stiff):
        a, b = h / REAL, h / COMPLEX
        return shift(problem, a, a * a, 0) and shift(problem, b, b * b, 1)
    newton_matrix.find_blocks(s.real.blocks, s.J, s.real.inner.shape[0])
    return newton_matrix.factorise(s.real, s.J, REAL / h) and newton_matrix.factorise(s.paired, s.J, COMPLEX / h)


@helper
def evaluate_polynomial(Z, x, result):
    """result (n,) = collocation polynomial at the fraction x of the step, less the state at its start."""
    for i in range(result.shape[0]):
        value = 0.0
        for k in range(2, -1, -1):
            value = (value + P[0, k] * Z[0, i] + P[1, k] * Z[1, i] + P[2, k] * Z[2, i]) * x
        result[i] = value


@helper
def solve(problem, s, h, x):
    """x := (REAL/h - J)^-1 x."""
    if suffices(s.stiff):
        for i in range(x.shape[0]):
            s.stiff.z[i] = x[i]
        answer(problem, h / REAL, 0, s.stiff.z, s.stiff)
        for i in range(x.shape[0]):
            x[i] = s.stiff.z[i].real
    else:
        newton_matrix.solve(s.real, s.J, x)


@helper
def solve_paired(problem, s, h, x):
    """x := (COMPLEX/h - J)^-1 x."""
    if suffices(s.stiff):
        answer(problem, h / COMPLEX, 1, x, s.stiff)
    else:
        newton_matrix.solve(s.paired, s.J, x)


@helper
def correct(problem, s, h):
    """One Newton correction (dw real, dv complex) of the decoupled stages (w, v)."""
    F = s.F
    for i in range(s.w.shape[0]):
        s.dw[i] = W_REAL[0] * F[0, i] + W_REAL[1] * F[1, i] + W_REAL[2] * F[2, i] - REAL / h * s.w[i]
        s.dv[i] = W_COMPLEX[0] * F[0, i] + W_COMPLEX[1] * F[1, i] + W_COMPLEX[2] * F[2, i] - COMPLEX / h * s.v[i]
    solve(problem, s, h, s.dw)
    solve_paired(problem, s, h, s.dv)
    for i in range(s.w.shape[0]):
        s.w[i] += s.dw[i]
        s.v[i] += s.dv[i]


@helper
def to_stages(w, v, Z):
    """Z (3,n) from its decoupled form."""
    for s in range(3):
        for i in range(w.shape[0]):
            Z[s, i] = V_REAL[s] * w[i] + 2.0 * (V_COMPLEX[s] * v[i]).real


@helper
def to_decoupled(Z, w, v):
    """The decoupled form of Z (3,n)."""
    for i in range(w.shape[0]):
        w[i] = W_REAL[0] * Z[0, i] + W_REAL[1] * Z[1, i] + W_REAL[2] * Z[2, i]
        v[i] = W_COMPLEX[0] * Z[0, i] + W_COMPLEX[1] * Z[1, i] + W_COMPLEX[2] * Z[2, i]


@helper
def stage_norm(dZ, y, accuracy):
    """Root mean square of the scaled norms of three stages (3,n)."""
    total = 0.0
    for s in range(3):
        total += scaled_norm(dZ[s], y, accuracy) ** 2
    return math.sqrt(total / 3.0)


@helper
def newton(problem, step, y, s, accuracy, counts):
    """Solve for the stages Z, which hold a first guess. Returns (status, iterations, last contraction).

    Ends where the next correction would be below a fraction of the tolerance, with NOT_CONVERGED where it would not get
    there in time. The first ratio of corrections says little of that: it is that of a guess, which may happen to fulfil
    the linear equations.
    """
    h = step.end - step.start
    tolerance = max(10.0 * 2.0**-52 / accuracy.rtol, min(0.03, math.sqrt(accuracy.rtol)))
    to_decoupled(s.Z, s.w, s.v)
    rate, before = 0.0, 0.0
    for iteration in range(1, ITERATIONS + 1):
        for stage in range(3):
            for i in range(y.shape[0]):
                s.trial[i] = y[i] + s.Z[stage, i]
            status = derivative(problem, min(step.start + C[stage] * h, step.last), s.trial, s.F[stage], counts)
            if status != OK:
                return status, iteration, rate
        correct(problem, s, h)
        to_stages(s.dw, s.dv, s.F)
        size = stage_norm(s.F, y, accuracy)
        to_stages(s.w, s.v, s.Z)
        if not math.isfinite(size):
            return NONFINITE, iteration, rate
        if iteration > 1:
            rate = size / before
            if rate >= 1.0 or (iteration > 2 and rate ** (ITERATIONS - iteration) / (1.0 - rate) * size > tolerance):
                return NOT_CONVERGED, iteration, rate
        if size == 0.0 or (iteration > 1 and rate / (1.0 - rate) * size < tolerance):
            return OK, iteration, rate
        before = size
    return NOT_CONVERGED, ITERATIONS, rate


@helper
def guess(before, h_before, h, Z):
    """First guess of the stages: the polynomial of the step before, continued; zero without one."""
    for stage in range(3):
        if h_before > 0.0:
            evaluate_polynomial(before, 1.0 + C[stage] * h / h_before, Z[stage])
        for i in range(Z.shape[1]):
            Z[stage, i] = Z[stage, i] - before[2, i] if h_before > 0.0 else 0.0


@helper
def scratch(n, coordinates, speeds):
    """For n components, of which the first are coordinates, then speeds."""
    blocks = newton_matrix.rate_blocks(coordinates)
    return RadauStages(
        np.empty(n), np.zeros((n, n)), newton_matrix.unfactorised(n, coordinates, blocks, np.float64),
        newton_matrix.unfactorised(n, coordinates, blocks, np.complex128), np.empty((3, n)), np.empty((3, n)),
        np.empty((3, n)), np.empty(n),
        np.empty(n, np.complex128), np.empty(n), np.empty(n, np.complex128), np.empty(n), np.empty(n), np.empty(n),
        np.empty(n), np.empty(n), stiff_place(n, coordinates, speeds),
    )  # fmt: skip
