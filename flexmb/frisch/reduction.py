"""Reduction of the expanded equations to the speeds (126)-(141), and their solution with predefined motion (142)-(145).

Corrected, (111) is premultiplied by the transpose of the whole transformation S = (126) (133). The matrix is then
symmetric, and the constraint loads vanish, because they do no work in any motion that S describes. As printed, (136)
and (138) premultiply by q' and h' only.
"""

from flexmb.frisch.tables import ONE_SIDED
from flexmb.jit.features import has
from flexmb.jit.kernel import helper
from flexmb.spatial.linear_algebra import cholesky_rows, cholesky_solve
from flexmb.spatial.pivots import is_small
from flexmb.spatial.vector import store3, vec3
from flexmb.tables.features import ARMATURES
from flexmb.tables.status import NOT_POSITIVE_DEFINITE, OK


@helper
def reduce(c, w):
    """Matrix and right-hand side of the scalar equations (136), (138), (141) in the speeds.

    They contain no constraint loads (135). Armatures, which the paper does not have, are inertia along their own speeds
    alone, and enter the diagonal.
    """
    _bias(c, w)
    _times(w, w.x, w.y)
    _product(c, w)
    nu = w.M.shape[0]
    one_sided = c.printed[ONE_SIDED] == 1
    for i in range(nu):
        start, stop = c.column[i].start, c.column[i].stop
        first = i  # the matrix is symmetric: its upper triangle is computed and copied
        if one_sided:
            stop, first = c.column[i].own, 0
        row, force = w.M[i, first:], w.speed[i].applied
        _combine(c, w, start, stop, w.product, first, row)
        for e in range(start, stop):
            r = c.entry_row[e]
            force += w.S[e] * (w.eta[r] - w.y[r])
        w.right[i] = force
        if has(c, ARMATURES):
            w.M[i, i] += c.speed[i].armature
        if not one_sided:
            for j in range(i, nu):
                w.M[j, i] = w.M[i, j]


@helper
def _product(c, w):
    """Z S of (128), stored by expanded rows.

    Z is symmetric, so that a column of Z S is a combination of rows of Z, which are contiguous. Eight columns at a time
    are computed into a buffer and transposed: eight numbers are a cache line of the product.
    """
    nu, buffer = w.M.shape[0], w.columns
    for j in range(0, nu, buffer.shape[0]):
        count = min(nu - j, buffer.shape[0])
        for i in range(count):
            _combine(c, w, c.column[j + i].start, c.column[j + i].stop, w.Z, 0, buffer[i])
        for r in range(buffer.shape[1]):
            for i in range(count):
                w.product[r, j + i] = buffer[i, r]


@helper
def _combine(c, w, start, stop, X, first, y):
    """y = sum over the entries start .. stop of S of each entry times its row of X, from column `first` on.

    The entry in a mode's own row comes first; all others are components of vectors, and come in threes.
    """
    for i in range(y.shape[0]):
        y[i] = 0.0
    e = start
    if (stop - start) % 3 == 1:
        _axpy(w.S[e], X[c.entry_row[e], first:], y)
        e += 1
    while e < stop:
        r = c.entry_row[e]
        s0, s1, s2 = w.S[e], w.S[e + 1], w.S[e + 2]
        a, b, d = X[r, first:], X[r + 1, first:], X[r + 2, first:]
        # Many vectors are zero: the translation of revolute hinges, the axial motion of bending modes.
        if s0 != 0.0 or s1 != 0.0 or s2 != 0.0:
            for i in range(y.shape[0]):
                y[i] += s0 * a[i] + s1 * b[i] + s2 * d[i]
        e += 3


@helper
def solve(c, w):
    """Free accelerations (144) of (137), reordered by w.free (142), for given predefined ones; returns a status."""
    nu = w.u.shape[0]
    free = nu
    one_sided = c.printed[ONE_SIDED] == 1
    for j in range(nu):
        f = c.speed[j].prescribed
        if f >= 0:
            free -= 1
            w.speed[j].acceleration = w.function[f, 2]
    for a in range(free):
        i = w.free[a]
        w.solution[a] = w.right[i]
        for b in range(0 if one_sided else a, free):
            w.factor[a, b] = w.M[i, w.free[b]]
        for b in range(free, nu):
            w.solution[a] -= w.M[i, w.free[b]] * w.speed[w.free[b]].acceleration
    failed = _eliminate(w, free) if one_sided else cholesky_rows(w.factor, free)
    if failed >= 0:
        w.fault[0] = c.column[w.free[failed]].body
        return NOT_POSITIVE_DEFINITE
    w.doubt[0] = 0
    if not one_sided:
        for a in range(free):
            i = w.free[a]
            is_small(c, w, i, w.factor[a, a] * w.factor[a, a], w.M[i, i])
        cholesky_solve(w.factor, w.solution, free)
    for a in range(free):
        w.speed[w.free[a]].acceleration = w.solution[a]
    for b in range(free, nu):
        j = w.free[b]
        load = -w.right[j]
        for i in range(nu):
            load += w.M[j, i] * w.speed[i].acceleration
        w.speed[j].drive = load  # (145)
    return OK


@helper
def expanded_accelerations(c, w):
    """x of (111) from the accelerations of the speeds, (127) with (134); w.y = Z x - eta, the hinge loads of (111)."""
    _bias(c, w)
    for j in range(w.u.shape[0]):
        for e in range(c.column[j].start, c.column[j].stop):
            w.x[c.entry_row[e]] += w.S[e] * w.speed[j].acceleration
    _times(w, w.x, w.y)
    for r in range(w.y.shape[0]):
        w.y[r] -= w.eta[r]


@helper
def _bias(c, w):
    """The expanded accelerations at udot = 0: the second terms of (127) and (134)."""
    bodies = c.body.shape[0]
    hinges = w.x.shape[0] - 3 * bodies
    for k in range(bodies):
        store3(w.x, 3 * k, vec3(w.nest[k].spin_bias, 0))
        store3(w.x, hinges + 3 * k, vec3(w.nest[k].beta_bias, 0))
        for n in range(c.body[k].modes):
            w.x[c.element[k].mode_row + n] = 0.0
    for i in range(c.wheel.shape[0]):
        store3(w.x, 3 * bodies + 3 * i, vec3(w.wheel[i].spin_bias, 0))


@helper
def _times(w, x, y):
    """y = Z x as a combination of rows of the symmetric Z, which are contiguous."""
    for r in range(y.shape[0]):
        y[r] = 0.0
    for r in range(x.shape[0]):
        _axpy(x[r], w.Z[r], y)


@helper
def _axpy(s, x, y):
    """y += s x."""
    if s != 0.0:
        for r in range(y.shape[0]):
            y[r] += s * x[r]


@helper
def _eliminate(w, n):
    """Solve with the matrix w.factor, unsymmetric as printed, by Gaussian elimination with partial pivoting.

    Returns the row of a zero pivot, or -1.
    """
    A, x = w.factor, w.solution
    for j in range(n):
        p = j
        for i in range(j + 1, n):
            if abs(A[i, j]) > abs(A[p, j]):
                p = i
        if not abs(A[p, j]) > 0.0:
            return j
        if p != j:
            for i in range(j, n):
                A[j, i], A[p, i] = A[p, i], A[j, i]
            x[j], x[p] = x[p], x[j]
        for m in range(j + 1, n):
            s = A[m, j] / A[j, j]
            x[m] -= s * x[j]
            _axpy(-s, A[j, j:n], A[m, j:n])
    for j in range(n - 1, -1, -1):
        for i in range(j + 1, n):
            x[j] -= A[j, i] * x[i]
        x[j] /= A[j, j]
    return -1
