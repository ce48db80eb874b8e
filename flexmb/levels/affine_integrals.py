"""Modal integrals that are affine in eta, summed over modes: strips of the table `Constants.product`.

For each body the table has the integrals P0_n = sum m phi_n x' at rest and, for every mode i, their derivatives
P1_ni = sum m phi_n phi_i' with respect to eta_i. They are 3x3 matrices, stored by columns, each element as a strip over
the modes n. Column j of P1_ni is zero for all n if mode i moves no mass along axis j; such columns are skipped. Most
modes of beams move along one axis only.
"""

import numpy as np

from flexmb.jit.kernel import helper
from flexmb.jit.lanes import some
from flexmb.jit.strips import ROW, strip, whole
from flexmb.spatial.vector import axpy
from flexmb.typing import Real

NUMBERS = 9


@helper
def sum_integrals(w, k, product, moves, nm, n):
    """Columns of P_n = P0_n + sum_i eta_i P1_ni and of sum_i etad_i P1_ni of body k, for the strip that starts at n."""
    blocks, at = product[n // ROW], n % ROW
    X, Y, Z = columns_of(w, blocks[0], at)
    x = y = z = (0.0, 0.0, 0.0)
    for i in range(nm):
        slope, eta, etad = blocks[1 + i], w.eta[k, i], w.etad[k, i]
        if some(moves[i, 0].real != 0.0):
            column = _column(w, slope, 0, at)
            X, x = axpy(eta, column, X), axpy(etad, column, x)
        if some(moves[i, 1].real != 0.0):
            column = _column(w, slope, 1, at)
            Y, y = axpy(eta, column, Y), axpy(etad, column, y)
        if some(moves[i, 2].real != 0.0):
            column = _column(w, slope, 2, at)
            Z, z = axpy(eta, column, Z), axpy(etad, column, z)
    return (X, Y, Z), (x, y, z)


@helper
def columns_of(w, block, at):
    """The three columns of the matrices of a strip, which starts at element `at` of a block of `Constants.product`."""
    return _column(w, block, 0, at), _column(w, block, 1, at), _column(w, block, 2, at)


@helper
def _column(w, block, column, at):
    first = 3 * column * ROW + at
    return strip(w, block, first), strip(w, block, first + ROW), strip(w, block, first + 2 * ROW)


@helper
def symmetric_part(columns):
    """Symmetric part (xx, yy, zz, xy, xz, yz) of the matrix with these columns."""
    X, Y, Z = columns
    return X[0], Y[1], Z[2], 0.5 * (X[1] + Y[0]), 0.5 * (X[2] + Z[0]), 0.5 * (Y[2] + Z[1])


@helper
def axial_vector(columns):
    """sum m b x a from the matrix sum m a b' with these columns."""
    X, Y, Z = columns
    return Y[2] - Z[1], Z[0] - X[2], X[1] - Y[0]


def table_of_products(at_rest: Real, slope: Real, points: int) -> Real:
    """(strips,1+n,72) of `Constants.product` from sum m x~' phi_n~ (n,3,3) and sum m phi_n~' phi_i~ (n,n,3,3).

    Elements of the slopes below the rounding error of their sum over `points` terms are set to zero, so that their
    columns are skipped. The error is bounded by points 2^-53 times the sum of the terms' magnitudes, which by the
    Cauchy-Schwarz inequality is at most the root of the product of both modes' diagonal elements.
    """
    P0, P1 = _products(at_rest), _products(slope)
    size = np.sqrt(np.abs(np.einsum("nnaa->n", P1)))
    P1 = np.where(np.abs(P1) > points * 2.0**-53 * np.outer(size, size)[..., None, None], P1, 0.0)
    blocks = np.concatenate([P0[None], np.swapaxes(P1, 0, 1)])  # [., n, row, column]
    n = len(P0)
    padded = np.zeros((1 + n, 3, 3, whole(n)))
    padded[..., :n] = blocks.transpose(0, 3, 2, 1)
    return padded.reshape(1 + n, NUMBERS, -1, ROW).transpose(2, 0, 1, 3).reshape(-1, 1 + n, NUMBERS * ROW)


def moving_columns(product: Real) -> Real:
    """(B,m,3) 1 where a mode has a column in a table (B,strips,1+m,72), else 0."""
    there = np.any(product[:, :, 1:] != 0.0, axis=1)
    return np.any(there.reshape(*there.shape[:2], 3, 3 * ROW), axis=-1).astype(float)


def _products(J: Real) -> Real:
    """sum m a b' from sum m a~' b~ = (a.b) 1 - b a', over the leading axes."""
    half_trace = 0.5 * np.trace(J, axis1=-2, axis2=-1)
    return np.swapaxes(half_trace[..., None, None] * np.eye(3) - J, -1, -2)
