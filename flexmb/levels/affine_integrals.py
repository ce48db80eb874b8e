"""Modal integrals that are affine in eta, summed over modes: long loops without a gap, of a row of `Constants.product`.

A row is made of blocks of NUMBERS * nm numbers: first that of the integrals P0_n of a body at rest, then, for every
mode i, that of their slopes P1_ni by eta_i. In a block the number varies before the mode n. The numbers are those of a
3x3 matrix sum m a b': [xx yy zz xy xz yz] of its symmetric part, and its axial vector sum m b x a.
"""

import numpy as np

from flexmb.jit.kernel import helper
from flexmb.levels.level import sixes
from flexmb.typing import Real

AXIAL = 6  # where the axial vector starts
NUMBERS = 9


@helper
def sum_integrals(blocks, modes, nm, p):
    """P0_n + sum_i eta_i P1_ni into p, then the axial vectors of sum_i etadot_i P1_ni."""
    size, axial = NUMBERS * nm, AXIAL * nm
    value, rate = p[:size], p[size : size + 3 * nm]
    for j in range(value.shape[0]):
        value[j] = blocks[j]
    for j in range(rate.shape[0]):
        rate[j] = 0.0
    i = 0
    while i + 3 < nm:
        a, b, c, d = modes[i], modes[i + 1], modes[i + 2], modes[i + 3]
        four = blocks[(1 + i) * size : (5 + i) * size]
        _add_four(a.eta, b.eta, c.eta, d.eta, four, size, value)
        _add_four(a.etad, b.etad, c.etad, d.etad, four[axial:], size, rate)
        i += 4
    while i < nm:
        block = blocks[(1 + i) * size : (2 + i) * size]
        _add(modes[i].eta, block, value)
        _add(modes[i].etad, block[axial:], rate)
        i += 1


@helper
def symmetric(p, i, nm):
    """Six numbers from p[i] on, of one mode."""
    return p[i], p[i + nm], p[i + 2 * nm], p[i + 3 * nm], p[i + 4 * nm], p[i + 5 * nm]


@helper
def vector(p, i, nm):
    """Three numbers from p[i] on, of one mode."""
    return p[i], p[i + nm], p[i + 2 * nm]


@helper
def _add_four(s, t, u, v, blocks, size, y):
    """y += s a + t b + u c + v d of four blocks a, b, c, d that follow each other at a distance of `size`."""
    a, b, c, d = blocks, blocks[size:], blocks[2 * size :], blocks[3 * size :]
    for j in range(y.shape[0]):
        y[j] += s * a[j] + t * b[j] + u * c[j] + v * d[j]


@helper
def _add(s, a, y):
    """y += s a."""
    for j in range(y.shape[0]):
        y[j] += s * a[j]


def blocks_of_cross_products(at_rest: Real, slope: Real) -> Real:
    """A row of `Constants.product` from sum m x~' phi_n~ (n,3,3) and sum m phi_n~' phi_i~ (n,n,3,3)."""
    blocks, slopes = _nine(_products(at_rest)), _nine(_products(slope))
    return np.concatenate([blocks[None], np.swapaxes(slopes, 0, 1)]).swapaxes(1, 2).ravel()


def _products(J: Real) -> Real:
    """sum m a b' from sum m a~' b~ = (a.b) 1 - b a', over the leading axes."""
    half_trace = 0.5 * np.trace(J, axis1=-2, axis2=-1)
    return np.swapaxes(half_trace[..., None, None] * np.eye(3) - J, -1, -2)


def _nine(P: Real) -> Real:
    """Matrices (...,3,3) as nine numbers (...,9): [xx yy zz xy xz yz] of the symmetric part, the axial vector."""
    axial = [P[..., 2, 1] - P[..., 1, 2], P[..., 0, 2] - P[..., 2, 0], P[..., 1, 0] - P[..., 0, 1]]
    return np.concatenate([sixes(0.5 * (P + np.swapaxes(P, -1, -2))), np.stack(axial, axis=-1)], axis=-1)
