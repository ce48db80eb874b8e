"""The matrix sigma - J of Newton's method for y = [q, rest], factorised with the coordinates q eliminated first.

The rate of a coordinate depends on few speeds: that of a scalar one is a speed, that of a quaternion depends on the
speeds of its hinge and on the quaternion. In the blocks

    sigma - J = [ sigma - J_qq    -J_qr       ]        J_qq block diagonal, zero for scalar coordinates
                [ -J_rq           sigma - J_rr ]       J_qr with a few columns for each of these blocks

eliminating q therefore costs little, and what is left to factorise is the matrix

    sigma - J_rr - J_rq Y,    Y = (sigma - J_qq)^-1 J_qr

of the speeds (and of a controller's states and the work): half the size, an eighth of the operations. The blocks are
found from the zeros of J, so that nothing is assumed: in the worst case J_qq is one block.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexmb.integrate.lu import lu_factorise, lu_solve, product
from flexmb.jit.kernel import helper, sweep


class RateBlocks(NamedTuple):
    """Blocks of coordinates; `count` (1,) is their number.

    Block b has the coordinates start[b] .. stop[b] - 1, whose rates depend on these, and on the components first[b]
    .. last[b] - 1 of the rest. Where `single` is 1, it is a row of scalar coordinates instead, each of whose rates
    depends on one of these components only, in the same order.
    """

    start: np.ndarray
    stop: np.ndarray
    first: np.ndarray
    last: np.ndarray
    single: np.ndarray
    count: np.ndarray


class NewtonMatrix(NamedTuple):
    """Factors of sigma - J for n = Q + R components, the first Q of which are coordinates; real or complex.

    `inner` (Q,Q) has the factors of sigma - J_qq in its diagonal blocks, for scalar coordinates 1/sigma; `motion` (R,Q)
    is the transpose of Y; `outer` (R,R) has the factors of what is left. `along` (Q,) is Y of scalar coordinates.
    """

    blocks: RateBlocks
    inner: np.ndarray
    inner_pivots: np.ndarray
    motion: np.ndarray
    along: np.ndarray
    outer: np.ndarray
    outer_pivots: np.ndarray


@helper
def rate_blocks(coordinates):
    """For so many coordinates, not yet found."""
    return RateBlocks(
        np.zeros(coordinates, np.int64), np.zeros(coordinates, np.int64), np.zeros(coordinates, np.int64),
        np.zeros(coordinates, np.int64), np.zeros(coordinates, np.int64), np.zeros(1, np.int64),
    )  # fmt: skip


@helper
def unfactorised(n, coordinates, blocks, numbers):
    """For n components; `blocks` are shared by all matrices of one J, `numbers` is the type of the arrays' elements."""
    rest = n - coordinates
    return NewtonMatrix(
        blocks, np.zeros((coordinates, coordinates), numbers), np.zeros(coordinates, np.int64),
        np.zeros((rest, coordinates), numbers), np.zeros(coordinates, numbers), np.zeros((rest, rest), numbers),
        np.zeros(rest, np.int64),
    )  # fmt: skip


@helper
def find_blocks(b, J, coordinates):
    """The finest partition of consecutive coordinates for which J_qq is block diagonal, and the columns of J_qr."""
    Q, count, start = coordinates, 0, 0
    while start < Q:
        stop, first, last, coupled = _block_from(J, start, Q)
        single = stop == start + 1 and last <= first + 1 and not coupled
        if single and count > 0 and b.single[count - 1] == 1 and first == b.last[count - 1] and last == first + 1:
            b.stop[count - 1], b.last[count - 1] = stop, last
        else:
            b.start[count], b.stop[count], b.first[count], b.last[count] = start, stop, first, last
            b.single[count] = 1 if single and last == first + 1 else 0
            count += 1
        start = stop
    b.count[0] = count


@helper
def _block_from(J, start, Q):
    """(End of the block that begins with a coordinate, its first column of the rest and the end of these, whether J_qq
    is not zero there)."""
    i, stop, first, last, coupled = start, start + 1, J.shape[0] - Q, 0, False
    while i < stop:
        coupled = coupled or J[i, i] != 0.0
        for k in range(i + 1, Q):
            if J[i, k] != 0.0 or J[k, i] != 0.0:
                coupled = True
                stop = max(stop, k + 1)
        for j in range(J.shape[0] - Q):
            if J[i, Q + j] != 0.0:
                first, last = min(first, j), max(last, j + 1)
        i += 1
    return stop, first, last, coupled


@sweep
def factorise(m, J, sigma):
    """Factors of sigma - J to m, whose blocks have been found in J; returns whether they exist."""
    Q, R, blocks = m.inner.shape[0], m.outer.shape[0], m.blocks
    for b in range(blocks.count[0]):
        if not _factorise_block(m, J, sigma, b):
            return False
    for i in range(R):
        row, given = m.outer[i], J[Q + i]
        for j in range(R):
            row[j] = -given[Q + j]
        row[i] += sigma
        for b in range(blocks.count[0]):
            start, stop, first = blocks.start[b], blocks.stop[b], blocks.first[b]
            if blocks.single[b] == 1:
                for k in range(stop - start):
                    row[first + k] -= given[start + k] * m.along[start + k]
            else:
                for j in range(first, blocks.last[b]):
                    row[j] -= product(given, m.motion[j], start, stop)
    return lu_factorise(m.outer, m.outer_pivots)


@sweep
def solve(m, J, x):
    """Solve (sigma - J) x = b; x (n,) holds b and receives the solution. J is that of `factorise`."""
    Q, blocks = m.inner.shape[0], m.blocks
    q, rest = x[:Q], x[Q:]
    for b in range(blocks.count[0]):
        _solve_block(m, b, q)
    for i in range(rest.shape[0]):
        rest[i] += product(J[Q + i], q, 0, Q)
    lu_solve(m.outer, m.outer_pivots, rest)
    for b in range(blocks.count[0]):
        start, stop, first = blocks.start[b], blocks.stop[b], blocks.first[b]
        if blocks.single[b] == 1:
            for k in range(stop - start):
                q[start + k] += m.along[start + k] * rest[first + k]
        else:
            for j in range(first, blocks.last[b]):
                column = m.motion[j]
                for k in range(start, stop):
                    q[k] += column[k] * rest[j]


@helper
def _factorise_block(m, J, sigma, b):
    """Factors of sigma - J_qq and Y for one block; returns whether all pivots are regular."""
    Q, start, stop, first = m.inner.shape[0], m.blocks.start[b], m.blocks.stop[b], m.blocks.first[b]
    if m.blocks.single[b] == 1:
        inverse = 1.0 / sigma
        for k in range(start, stop):
            m.inner[k, k] = inverse
            m.along[k] = J[k, Q + first + k - start] * inverse
        return True
    for i in range(start, stop):
        for k in range(start, stop):
            m.inner[i, k] = -J[i, k]
        m.inner[i, i] += sigma
    if not lu_factorise(m.inner[start:stop, start:stop], m.inner_pivots[start:stop]):
        return False
    for j in range(first, m.blocks.last[b]):
        column = m.motion[j]
        for k in range(start, stop):
            column[k] = J[k, Q + j]
        _solve_block(m, b, column)
    return True


@helper
def _solve_block(m, b, x):
    """The entries of x for a block, times (sigma - J_qq)^-1."""
    start, stop = m.blocks.start[b], m.blocks.stop[b]
    if m.blocks.single[b] == 1:
        for k in range(start, stop):
            x[k] *= m.inner[k, k]
    else:
        lu_solve(m.inner[start:stop, start:stop], m.inner_pivots[start:stop], x[start:stop])
