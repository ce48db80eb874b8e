"""From the expanded equations to the speeds: the transformation (126)-(134), the reduction (135)-(141), and the
solution with predefined motion (142)-(145).

Corrected, (111) is premultiplied by the transpose of the whole transformation S = (126) (133): a congruence, hence a
symmetric matrix, and the constraint loads, which do no work in any motion S describes, drop out. As printed, (136) and
(138), only q' and h' stand on the left.
"""

from math import sqrt

from flexmb.frisch.tables import ONE_SIDED
from flexmb.kernel import helper
from flexmb.spatial.vector import store3, vec3
from flexmb.status import NOT_POSITIVE_DEFINITE, OK

SINGULAR = 2.0**-46  # a pivot this far below its diagonal is what rounding left of a zero: 64 roundings of the diagonal


@helper
def reduce(c, w):
    """M and right side of the scalar equations (136), (138), (141) in the speeds."""
    _bias(c, w)
    _times(w, w.x, w.y)
    nu, nx = w.M.shape[0], w.Z.shape[0]
    one_sided = c.printed[ONE_SIDED] == 1
    for j in range(nu):
        row = w.product[j]
        for r in range(nx):
            row[r] = 0.0
        for e in range(c.column[j].start, c.column[j].stop):
            _axpy(w.S[e], w.Z[c.entry_row[e]], row)
    for i in range(nu):
        stop = c.column[i].own if one_sided else c.column[i].stop
        force = w.speed[i].applied
        for e in range(c.column[i].start, stop):
            r = c.entry_row[e]
            force += w.S[e] * (w.eta[r] - w.y[r])
        w.right[i] = force
        for j in range(0 if one_sided else i, nu):
            total = 0.0
            for e in range(c.column[i].start, stop):
                total += w.S[e] * w.product[j, c.entry_row[e]]
            w.M[i, j] = total
            if not one_sided:
                w.M[j, i] = total


@helper
def solve(c, w):
    """Accelerations of the free speeds (144), given those of the predefined ones; a status code."""
    nu = w.u.shape[0]
    free = nu
    for j in range(nu):
        f = c.speed[j].prescribed
        if f >= 0:
            free -= 1
            w.speed[j].acceleration = w.function[f, 2]
    for a in range(free):
        i = w.free[a]
        w.solution[a] = w.right[i]
        for b in range(free):
            w.factor[a, b] = w.M[i, w.free[b]]
        for b in range(free, nu):
            w.solution[a] -= w.M[i, w.free[b]] * w.speed[w.free[b]].acceleration
    failed = _eliminate(w, free) if c.printed[ONE_SIDED] == 1 else _cholesky(w, free)
    if failed >= 0:
        w.fault[0] = c.column[w.free[failed]].body
        return NOT_POSITIVE_DEFINITE
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
    """x of (111) from the accelerations of the speeds, (127) with (134), and Z x - eta: the hinge loads of (111)."""
    _bias(c, w)
    for j in range(w.u.shape[0]):
        for e in range(c.column[j].start, c.column[j].stop):
            w.x[c.entry_row[e]] += w.S[e] * w.speed[j].acceleration
    _times(w, w.x, w.y)
    for r in range(w.y.shape[0]):
        w.y[r] -= w.eta[r]


@helper
def _bias(c, w):
    """What the expanded accelerations are at udot = 0: the second terms of (127) and (134)."""
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
    """y = Z x, by rows of the symmetric Z."""
    for r in range(y.shape[0]):
        y[r] = 0.0
    for r in range(x.shape[0]):
        _axpy(x[r], w.Z[r], y)


@helper
def _axpy(s, x, y):
    for r in range(y.shape[0]):
        y[r] += s * x[r]


@helper
def _cholesky(w, n):
    """Solve with w.factor = U' U, by rows; the place of a pivot that is not positive to round-off, else -1."""
    U, x = w.factor, w.solution
    for j in range(n):
        w.floor[j] = SINGULAR * U[j, j]
    for j in range(n):
        if not U[j, j] > w.floor[j]:
            return j
        d = 1.0 / sqrt(U[j, j])
        for i in range(j, n):
            U[j, i] *= d
        x[j] *= d
        for m in range(j + 1, n):
            s = U[j, m]
            x[m] -= s * x[j]
            for i in range(m, n):
                U[m, i] -= s * U[j, i]
    for j in range(n - 1, -1, -1):
        for i in range(j + 1, n):
            x[j] -= U[j, i] * x[i]
        x[j] /= U[j, j]
    return -1


@helper
def _eliminate(w, n):
    """Solve with the unsymmetric w.factor by Gauss with partial pivoting; the place of a zero pivot, else -1."""
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
            if s != 0.0:
                x[m] -= s * x[j]
                for i in range(j, n):
                    A[m, i] -= s * A[j, i]
    for j in range(n - 1, -1, -1):
        for i in range(j + 1, n):
            x[j] -= A[j, i] * x[i]
        x[j] /= A[j, j]
    return -1
