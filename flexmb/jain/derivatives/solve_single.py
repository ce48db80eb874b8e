"""A block of columns of M x = -T for trees of rigid bodies with single axes: three strips, in registers.

Three is what the registers hold, with the six components of J or G beside them. With y for the innovation of the other
sign than in `flexmb.jain.innovations`,

    inward     y = T + J . z        z := z - G y
    outward    x = -(y / D + G . A)    A := A + J x
"""

from flexmb.jain.derivatives.columns import zero
from flexmb.jit.kernel import helper
from flexmb.jit.strips import put, strip, width
from flexmb.spatial.rows import column6, put6, strips6
from flexmb.spatial.spatial_vector import axpy6, dot6, scale6, shift_force, shift_motion, sub6, sum6, vec6
from flexmb.spatial.vector import scale, vec3


@helper
def size(d):
    """Number of columns of a block."""
    return 3 * width(d)


@helper
def solve_block(c, d, at, bodies):
    """The columns from `at` on, in the rows of the first bodies of the order."""
    nothing = _nothing(d)
    for i in range(d.fork.shape[0]):
        _store(d, d.passed[d.fork[i]], nothing)
    z = nothing
    for i in range(d.stretch.shape[0] - 1, -1, -1):
        start, stop = d.stretch[i].start, min(d.stretch[i].stop, bodies)
        if start < stop:
            if d.stretch[i].ends or stop == bodies:
                z = nothing
            if d.stretch[i].forks and stop == d.stretch[i].stop:
                z = _sum(z, _load(d, d.passed[d.order[stop - 1]]))
            for j in range(stop - 1, start - 1, -1):
                z = _inward(d, d.order[j], at, z)
            z = _force_inboard(c, d, d.order[start], z)
    A = nothing
    for i in range(d.stretch.shape[0]):
        start, stop = d.stretch[i].start, min(d.stretch[i].stop, bodies)
        if start < stop:
            A = _acceleration_inboard(c, d, d.order[start], A)
            for j in range(start, stop):
                A = _outward(d, d.order[j], at, A)
            if d.stretch[i].forks:
                _store(d, d.passed[d.order[stop - 1]], A)


@helper
def _inward(d, k, at, z):
    place, slot = d.places[k].hinge, d.places[k].slot
    J, T = column6(d.seed, slot), _row(d, d.matrix[place], at)
    y = T[0] + dot6(J, z[0]), T[1] + dot6(J, z[1]), T[2] + dot6(J, z[2])
    _put(d, d.matrix[place], at, y)
    G = vec6(d.gain[place], 0)  # after the stores: all at once would not fit into the registers
    return sub6(z[0], scale6(y[0], G)), sub6(z[1], scale6(y[1], G)), sub6(z[2], scale6(y[2], G))


@helper
def _outward(d, k, at, A):
    place, slot = d.places[k].hinge, d.places[k].slot
    G, y = vec6(d.gain[place], 0), scale(d.factor[place], _row(d, d.matrix[place], at))
    x = -(y[0] + dot6(G, A[0])), -(y[1] + dot6(G, A[1])), -(y[2] + dot6(G, A[2]))
    _put(d, d.matrix[place], at, x)
    J = column6(d.seed, slot)
    return axpy6(x[0], J, A[0]), axpy6(x[1], J, A[1]), axpy6(x[2], J, A[2])


@helper
def _row(d, row, n):
    s = width(d)
    return strip(d, row, n), strip(d, row, n + s), strip(d, row, n + 2 * s)


@helper
def _put(d, row, n, x):
    s = width(d)
    put(d, row, n, x[0])
    put(d, row, n + s, x[1])
    put(d, row, n + 2 * s, x[2])


@helper
def _force_inboard(c, d, k, z):
    """The force about the base point of the body on which body k sits, the first of its stretch."""
    p = c.body[k].parent
    if d.places[k].new_point and p >= 0:
        step = vec3(d.body[k].step, 0)
        z = shift_force(z[0], step), shift_force(z[1], step), shift_force(z[2], step)
    if d.places[k].branches:
        _store(d, d.passed[p], _sum(z, _load(d, d.passed[p])))
    return z


@helper
def _acceleration_inboard(c, d, k, A):
    """The acceleration of the body on which body k sits, about the base point of k; A is from the stretch before."""
    p = c.body[k].parent
    if p < 0:
        A = _nothing(d)
    if d.places[k].branches:
        A = _load(d, d.passed[p])
    if d.places[k].new_point and p >= 0:
        step = vec3(d.body[k].step, 0)
        A = shift_motion(A[0], step), shift_motion(A[1], step), shift_motion(A[2], step)
    return A


@helper
def _nothing(d):
    x = zero(d, d.passed[0, 0])
    v = x, x, x
    return (v, v), (v, v), (v, v)


@helper
def _load(d, a):
    return strips6(d, a, 0), strips6(d, a, width(d)), strips6(d, a, 2 * width(d))


@helper
def _store(d, a, V):
    put6(d, a, 0, V[0])
    put6(d, a, width(d), V[1])
    put6(d, a, 2 * width(d), V[2])


@helper
def _sum(V, W):
    return sum6(V[0], W[0]), sum6(V[1], W[1]), sum6(V[2], W[2])
