"""The exact flow of x' = Z x + a polynomial in time over a step of unit length, by scaling and doubling.

With E = exp(tau Z) - 1 at tau = 2^-j and X_m(tau) the solution from zero under the m-th derivative of the polynomial,

    E(2 tau) = 2 E + E E,       X_m(2 tau) = X_m + (1 + E) X_m + sum over l > m of tau^(l-m)/(l-m)! X_l,

so that products of matrices are computed once per step, and each polynomial requires products with vectors only. E is
stored without the identity to preserve the accuracy of slow motions beside fast ones: repeated squaring of exp(tau Z)
itself would amplify rounding by 2^j. All levels from the smallest tau, which a Taylor series resolves, to tau = 1/4 are
kept, because they give the flow at any fraction of the step. Rows and columns of Z are balanced first (Osborne),
because the scales of coordinates and speeds differ by the frequency.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from flexmb.jit.kernel import helper, sweep

LEVELS = 36
QUARTER = 2  # level of tau = 1/4, the coarsest one kept
TERMS = 5  # number of terms of the polynomial, from the constant to the fourth power
# Norm at which the Taylor series to power 12 is exact to rounding, 0.25^13 / 13! = 2e-18, as is phi_5 to power 10.
_RESOLVED = 0.25
_POWER = 12


class Flow(NamedTuple):
    """Z (n,n) balanced, x = scale (n,) * balanced x; E (LEVELS,n,n) by level; P (TERMS,n,n) of `taylor` at the finest
    level (1,); powers (5,n,n) are scratch.
    """

    Z: np.ndarray
    scale: np.ndarray
    E: np.ndarray
    P: np.ndarray
    powers: np.ndarray
    finest: np.ndarray


@sweep
def multiply(A, B, C):
    """C = A B for square matrices, C being neither A nor B. Four rows of B at a time are added to each row of C."""
    n = A.shape[0]
    for i in range(n):
        target = C[i]
        for j in range(n):
            target[j] = 0.0
        k = 0
        while k + 3 < n:
            a0, a1, a2, a3 = A[i, k], A[i, k + 1], A[i, k + 2], A[i, k + 3]
            b0, b1, b2, b3 = B[k], B[k + 1], B[k + 2], B[k + 3]
            for j in range(n):
                target[j] += a0 * b0[j] + a1 * b1[j] + a2 * b2[j] + a3 * b3[j]
            k += 4
        while k < n:
            a0, b0 = A[i, k], B[k]
            for j in range(n):
                target[j] += a0 * b0[j]
            k += 1


@helper
def add_product(A, x, y):
    """y += A x."""
    for i in range(y.shape[0]):
        row, total = A[i], 0.0
        for j in range(x.shape[0]):
            total += row[j] * x[j]
        y[i] += total


@sweep
def balance(Z, scale):
    """Balance Z by a similarity with powers of two, so that sums of rows and columns are alike; returns its norm."""
    n = Z.shape[0]
    for i in range(n):
        scale[i] = 1.0
    for _ in range(10):
        changed = False
        for i in range(n):
            row, column = 0.0, 0.0
            for j in range(n):
                if j != i:
                    row += abs(Z[i, j])
                    column += abs(Z[j, i])
            if row > 0.0 and column > 0.0:
                factor = 2.0 ** round(0.5 * math.log2(row / column))
                if factor < 0.75 or factor > 1.5:
                    changed = True
                    scale[i] *= factor
                    for j in range(n):
                        Z[i, j] /= factor
                    for j in range(n):
                        Z[j, i] *= factor
        if not changed:
            break
    norm = 0.0
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += abs(Z[i, j])
        norm = max(norm, total)
    return norm


@sweep
def taylor(Z, tau, powers, P, E):
    """E = exp(tau Z) - 1 and P[k-1] = tau^k phi_k(tau Z), k to 5: the response to the powers of time.

    phi_5 by its series to power 10 in five products (Paterson, Stockmeyer), then tau^k phi_k = tau^k/k! +
    Z tau^(k+1) phi_(k+1), in which nothing cancels; phi_0 = 1 + E.
    """
    B, B2, B3, B4, sums = powers[0], powers[1], powers[2], powers[3], powers[4]
    n = Z.shape[0]
    for i in range(n):
        for j in range(n):
            B[i, j] = tau * Z[i, j]
    multiply(B, B, B2)
    multiply(B2, B, B3)
    multiply(B2, B2, B4)
    for i in range(n):
        for j in range(n):
            E[i, j] = B[i, j] / 87178291200.0 + B2[i, j] / 1307674368000.0
        E[i, i] += 1.0 / 6227020800.0
    multiply(B4, E, sums)
    for i in range(n):
        for j in range(n):
            sums[i, j] += B[i, j] / 3628800.0 + B2[i, j] / 39916800.0 + B3[i, j] / 479001600.0
        sums[i, i] += 1.0 / 362880.0
    top = P[TERMS - 1]
    multiply(B4, sums, top)
    scale = tau**TERMS
    for i in range(n):
        for j in range(n):
            top[i, j] = scale * (top[i, j] + B[i, j] / 720.0 + B2[i, j] / 5040.0 + B3[i, j] / 40320.0)
        top[i, i] += scale / 120.0
    factor = 1.0 / 120.0
    for k in range(TERMS - 1, 0, -1):
        factor *= k + 1.0
        multiply(Z, P[k], P[k - 1])
        for i in range(n):
            P[k - 1, i, i] += tau**k * factor
    multiply(Z, P[0], E)


@sweep
def prepare(flow, A, h):
    """Compute everything that depends on Z = h A only; returns whether Z is finite and LEVELS suffice for its norm."""
    n = A.shape[0]
    for i in range(n):
        for j in range(n):
            flow.Z[i, j] = h * A[i, j]
    norm = balance(flow.Z, flow.scale)
    if not norm < _RESOLVED * 2.0 ** (LEVELS - 1):
        return False
    finest = QUARTER
    while norm > _RESOLVED * 2.0**finest:
        finest += 1
    flow.finest[0] = finest
    taylor(flow.Z, 2.0**-finest, flow.powers, flow.P, flow.E[finest])
    for level in range(finest, QUARTER, -1):
        E, doubled = flow.E[level], flow.E[level - 1]
        multiply(E, E, doubled)
        for i in range(n):
            for j in range(n):
                doubled[i, j] += 2.0 * E[i, j]
    return True


@sweep
def series(Z, tau, v, x, term, product):
    """Advance x by the flow over a short time tau under sum over l of v[l] t^l / l!, by its Taylor series."""
    n = x.shape[0]
    for i in range(n):
        term[i] = x[i]
    factor = 1.0
    for k in range(1, _POWER + 1):
        factor *= tau / k
        for i in range(n):
            product[i] = 0.0
        add_product(Z, term, product)
        forced = k <= TERMS
        for i in range(n):
            term[i] = tau / k * product[i] + (factor * v[k - 1, i] if forced else 0.0)
            x[i] += term[i]


@sweep
def respond(flow, v, terms, X):
    """X[level, m] for the polynomial sum over l < terms of v[l] t^l / l!, at all levels that are kept."""
    finest = flow.finest[0]
    n = v.shape[1]
    for m in range(TERMS):
        x = X[finest, m]
        for i in range(n):
            x[i] = 0.0
        for l in range(m, terms):
            add_product(flow.P[l - m], v[l], x)
    for level in range(finest, QUARTER, -1):
        tau = 2.0**-level
        for m in range(terms):
            advance(flow.E[level], X[level, m], X[level], m, tau, X[level - 1, m])
        for m in range(terms, TERMS):
            for i in range(n):
                X[level - 1, m, i] = 0.0


@sweep
def advance(E, x, X, m, t, result):
    """result = (1 + E) x + sum over l >= m of t^(l-m)/(l-m)! X[l]: the solution from t to t + tau, tau that of E and X.
    """
    n = x.shape[0]
    factor = 1.0
    for i in range(n):
        result[i] = x[i]
    add_product(E, x, result)
    for l in range(m, TERMS):
        for i in range(n):
            result[i] += factor * X[l, i]
        factor *= t / (l - m + 1)


@sweep
def at_quarters(flow, X, x):
    """x (4,n): the solution from zero at 1/4, 1/2, 3/4 and 1."""
    for i in range(x.shape[1]):
        x[0, i] = X[QUARTER, 0, i]
    for k in range(1, 4):
        advance(flow.E[QUARTER], x[k - 1], X[QUARTER], 0, 0.25 * k, x[k])


@sweep
def at_fraction(flow, v, X, x, theta, result, term, product):
    """result (n,): the solution from zero at any fraction theta of the step; x (4,n) of `at_quarters`."""
    n = result.shape[0]
    quarter = min(int(4.0 * theta), 3)
    for i in range(n):
        result[i] = x[quarter - 1, i] if quarter > 0 else 0.0
    t = 0.25 * quarter
    for level in range(QUARTER + 1, flow.finest[0] + 1):
        tau = 2.0**-level
        if t + tau <= theta:
            for i in range(n):
                term[i] = result[i]
            advance(flow.E[level], term, X[level], 0, t, result)
            t += tau
    rest = theta - t
    # The rest of the interval is driven by the derivatives of the polynomial at t.
    for k in range(TERMS):
        factor = 1.0
        for i in range(n):
            X[0, k, i] = 0.0
        for l in range(k, TERMS):
            for i in range(n):
                X[0, k, i] += factor * v[l, i]
            factor *= t / (l - k + 1)
    series(flow.Z, rest, X[0], result, term, product)
