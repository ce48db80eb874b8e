"""The coefficient matrix of (111): partitions X, I^c, F, Gamma, I^s, M^1, A, M^2 of (112)-(115).

Body i is k or one of the bodies between k and the ground; d is the vector from its hinge point to that of k. Sums over
the nest of k of terms with gamma_{i-1} = gamma_{k-1} + d follow from the sums about hinge point k-1. The blocks of two
bodies neither of which carries the other are zero and are never written.
"""

from flexmb.jit.kernel import helper
from flexmb.spatial.vector import add, axpy, cross, dot, scale, sub, sym6, sym_full, vec3


@helper
def coefficient_matrix(c, w):
    """Both triangles of Z of (111), the left-hand sides of (112)-(115), from the sums over nests."""
    wheels = 3 * c.body.shape[0]
    for k in range(c.body.shape[0]):
        i = k
        while i >= 0:
            d = sub(vec3(w.nest[k].origin, 0), vec3(w.nest[i].origin, 0))
            _nests(c, w, k, i, d)
            _modes(c, w, k, i, d)
            for m in range(c.body[k].wheel_start, c.body[k].wheel_stop):
                _block(w.Z, 3 * i, wheels + 3 * m, sym_full(sym6(w.wheel[m].inertia, 0)))  # I^c (109)
            i = c.body[i].parent
        _modal_mass(c, w, k)
        for m in range(c.body[k].wheel_start, c.body[k].wheel_stop):
            _block(w.Z, wheels + 3 * m, wheels + 3 * m, sym_full(sym6(w.wheel[m].inertia, 0)))  # I^s (109)


@helper
def _nests(c, w, k, i, d):
    """X (107), Gamma (107), (108) and M^2 (108) of nests k and i."""
    Z, nest = w.Z, w.nest[k]
    hinges = Z.shape[0] - 3 * c.body.shape[0]
    s, m = vec3(nest.first, 0), nest.mass
    inertia, along = sym6(nest.inertia, 0), dot(s, d)
    xx, yy, zz = inertia[0] + along, inertia[1] + along, inertia[2] + along
    X = (
        xx - d[0] * s[0], inertia[3] - d[0] * s[1], inertia[4] - d[0] * s[2],
        inertia[3] - d[1] * s[0], yy - d[1] * s[1], inertia[5] - d[1] * s[2],
        inertia[4] - d[2] * s[0], inertia[5] - d[2] * s[1], zz - d[2] * s[2],
    )  # fmt: skip
    _block(Z, 3 * k, 3 * i, X)
    _block(Z, 3 * k, hinges + 3 * i, _skew(s))
    _block(Z, 3 * i, hinges + 3 * k, _skew(axpy(m, d, s)))  # sum of m gamma_{i-1}
    _block(Z, hinges + 3 * k, hinges + 3 * i, (m, 0.0, 0.0, 0.0, m, 0.0, 0.0, 0.0, m))


@helper
def _modes(c, w, k, i, d):
    """F (107), (110) and A (108), (110): the modes of body k in the rows of nest i."""
    Z, mass = w.Z, c.element[k].mass
    hinges = Z.shape[0] - 3 * c.body.shape[0]
    gamma = add(vec3(w.nest[k].alpha, 0), d)
    for n in range(c.body[k].modes):
        A = scale(mass, vec3(w.mode[k, n].A, 0))
        F = add(vec3(w.mode[k, n].Q, 0), cross(gamma, A))
        row = c.element[k].mode_row + n
        for a in range(3):
            Z[row, 3 * i + a] = F[a]
            Z[3 * i + a, row] = F[a]
            Z[row, hinges + 3 * i + a] = A[a]
            Z[hinges + 3 * i + a, row] = A[a]


@helper
def _modal_mass(c, w, k):
    """M^1 (110): constant, m delta in the print, plus its first-order change where inertias turn."""
    at, slope = c.element[k].mode_row, c.element[k].slope
    for m in range(c.body[k].modes):
        for n in range(c.body[k].modes):
            value = c.element_pair[k, m, n].M1
            if slope >= 0:
                for i in range(c.body[k].modes):
                    value += w.modal[k, i] * c.M1_slope[slope, i, m, n]
            w.Z[at + m, at + n] = value


@helper
def _block(Z, row, col, m):
    """Store a 3x3 block and, on the other side of the diagonal, its transpose."""
    for a, x in ((0, (m[0], m[1], m[2])), (1, (m[3], m[4], m[5])), (2, (m[6], m[7], m[8]))):
        Z[row + a, col] = x[0]
        Z[row + a, col + 1] = x[1]
        Z[row + a, col + 2] = x[2]
        Z[col, row + a] = x[0]
        Z[col + 1, row + a] = x[1]
        Z[col + 2, row + a] = x[2]


@helper
def _skew(v):
    """v~."""
    return 0.0, -v[2], v[1], v[2], 0.0, -v[0], -v[1], v[0], 0.0
