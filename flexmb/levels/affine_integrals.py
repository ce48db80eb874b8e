"""Modal integrals that are affine in eta, summed over modes: strips of a table of `Constants.product`.

Of a body, first the integrals P0_n at rest, then, for every mode i, their slopes P1_ni by eta_i: rows of numbers, for
each of which there is a row over the modes n. The numbers are those of a 3x3 matrix sum m a b': [xx yy zz xy xz yz] of
its symmetric part, and its axial vector sum m b x a.
"""

import numpy as np

from flexmb.jit.kernel import helper
from flexmb.levels.level import sixes
from flexmb.spatial.rows import strips3, strips_sym
from flexmb.spatial.vector import axpy, sym_axpy
from flexmb.typing import Real

AXIAL = 6  # where the axial vector starts
NUMBERS = 9


@helper
def sum_integrals(w, k, product, nm, n):
    """P_n = P0_n + sum_i eta_i P1_ni and sum_i etad_i P1_ni of body k and the strip of modes that starts at n.

    Of the first the symmetric part and the axial vector, of the second the axial vector.
    """
    P, axial = strips_sym(w, product[0], n), strips3(w, product[0], AXIAL, n)
    rate = (0.0, 0.0, 0.0)
    for i in range(nm):
        slope, eta = product[1 + i], w.eta[k, i]
        turn = strips3(w, slope, AXIAL, n)
        P = sym_axpy(eta, strips_sym(w, slope, n), P)
        axial = axpy(eta, turn, axial)
        rate = axpy(w.etad[k, i], turn, rate)
    return P, axial, rate


def blocks_of_cross_products(at_rest: Real, slope: Real) -> Real:
    """A table (1+n,9,n) of `Constants.product` from sum m x~' phi_n~ (n,3,3) and sum m phi_n~' phi_i~ (n,n,3,3)."""
    blocks, slopes = _nine(_products(at_rest)), _nine(_products(slope))
    return np.concatenate([blocks[None], np.swapaxes(slopes, 0, 1)]).swapaxes(1, 2)


def _products(J: Real) -> Real:
    """sum m a b' from sum m a~' b~ = (a.b) 1 - b a', over the leading axes."""
    half_trace = 0.5 * np.trace(J, axis1=-2, axis2=-1)
    return np.swapaxes(half_trace[..., None, None] * np.eye(3) - J, -1, -2)


def _nine(P: Real) -> Real:
    """Matrices (...,3,3) as nine numbers (...,9): [xx yy zz xy xz yz] of the symmetric part, the axial vector."""
    axial = [P[..., 2, 1] - P[..., 1, 2], P[..., 0, 2] - P[..., 2, 0], P[..., 1, 0] - P[..., 0, 1]]
    return np.concatenate([sixes(0.5 * (P + np.swapaxes(P, -1, -2))), np.stack(axial, axis=-1)], axis=-1)
