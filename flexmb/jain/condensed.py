"""Modes condensed onto the nodes of a body: (63), (64) at cost O(n_m) without D_f, where M_ff = L L' is constant.

With Lam = M_ff^-1, the constants of Appendix B are Psi = Lam M_fr, Ups = Lam Pi', zeta = M_rf Psi, Omega = Pi Ups and
Theta = phi' - Pi Psi. The modes follow the body and the loads F at its nodes,

    etadd = -Lam z_f - Psi alpha - Ups F,      F = T Theta alpha + F_0,      T = (1 + Gamma Omega)^-1 Gamma,
    F_0   = y - T (Ups' z_f + Omega y),

hence P_R = M_rr - zeta + Theta' T Theta and z_R = z_r - Psi' z_f + Theta' F_0: no term knows how many modes there are.
Kept are L' Psi = L^-1 M_fr, L' Ups and L^-1 z_f, as this loses fewest digits. Where M_fr and Pi change with the
deformation, the tables are made anew at each evaluation.
"""

from math import sqrt

from flexmb.arrays import RUTHLESS
from flexmb.jain.explicit import refer_rigid
from flexmb.jain.reduced import node_inertia
from flexmb.kernel import helper
from flexmb.spatial.inertia import add_product
from flexmb.spatial.vector import vec3

NEGLIGIBLE = 2.0**-49  # pivots of a matrix of unit diagonal below it are rounding: 16 units


@helper
def eliminate_modes(c, w, k):
    """P_R and z_R of (63), (64) from the constants of (B4); False where T does not exist."""
    r = c.body[k].reduced
    nodes = c.body[k].nodes
    if c.body[k].level != RUTHLESS:
        _tables(c, w, k)
    elif c.body[k].outboard_port >= 0:
        refer_rigid(c, w, k)
    _to_orthonormal(c, w, k)
    for b in range(21):
        w.body[k].hinge_inertia[b] = w.body[k].inertia[b] - w.zeta[r, b]
    for b in range(6):
        s = w.body[k].force[b]
        for n in range(c.body[k].modes):
            s -= w.gain[r, n, 0, b] * w.mode[k, n].zf
        w.body[k].hinge_force[b] = s
    if nodes == 0:
        return True
    if not node_inertia(w, r, nodes):
        return False
    _responses(c, w, k)
    T = w.scratch[2]
    for i in range(nodes):
        for a in range(6):
            force = w.node[r, i].force[a]
            for j in range(nodes):
                for b in range(6):
                    force -= T[6 * i + a, 6 * j + b] * w.node[r, j].response[b]
            w.scratch[0, 0, 6 * i + a] = force
            for b in range(6):
                carried = 0.0
                for j in range(nodes):
                    for d in range(6):
                        carried += T[6 * i + a, 6 * j + d] * w.node[r, j].theta[d, b]
                w.node[r, i].carried[a, b] = carried
    for i in range(nodes):
        node = w.node[r, i]
        for a in range(6):
            node.force[a] = w.scratch[0, 0, 6 * i + a]
            add_product(w.body[k].hinge_inertia, 0, 1.0, node.theta[a], node.carried[a])
            for b in range(6):
                w.body[k].hinge_force[b] += node.theta[a, b] * node.force[a]
    return True


@helper
def _tables(c, w, k):
    """L^-1 M_fr, L^-1 Pi', zeta, root of Omega and Theta at the present deformation."""
    r = c.body[k].reduced
    nodes = c.body[k].nodes
    nm = c.body[k].modes
    for b in range(21):
        w.zeta[r, b] = 0.0
    for n in range(nm):
        first = n if c.body[k].orthogonal else 0
        for j in range(1 + nodes):
            for b in range(6):
                w.gain[r, n, j, b] = 0.0
        for i in range(first, n + 1):
            s = c.compliance[r, n, i]
            for b in range(6):
                w.gain[r, n, 0, b] += s * w.mode[k, i].pfr[b]
            for j in range(nodes):
                column = w.port_mode[c.node[r, j].port, i]
                for b in range(3):
                    w.gain[r, n, 1 + j, b] += s * column.W[b]
                    w.gain[r, n, 1 + j, 3 + b] += s * column.L[b]
        add_product(w.zeta[r], 0, 1.0, w.gain[r, n, 0], w.gain[r, n, 0])
    omega = w.scratch[0]
    for j in range(nodes):
        _theta(c, w, k, j)
        for i in range(nodes):
            for a in range(6):
                for b in range(6):
                    s = 0.0
                    for n in range(nm):
                        s += w.gain[r, n, 1 + j, a] * w.gain[r, n, 1 + i, b]
                    omega[6 * j + a, 6 * i + b] = s
    w.rank[r] = semidefinite_root(omega, w.scratch[1, 0], w.root[r], 6 * nodes)


@helper
def _theta(c, w, k, j):
    """Theta = phi' - Pi Lam M_fr of node j."""
    r = c.body[k].reduced
    theta = w.node[r, j].theta
    x, y, z = vec3(w.port[c.node[r, j].port].r, 0)
    for a in range(6):
        for b in range(6):
            s = 1.0 if a == b else 0.0
            for n in range(c.body[k].modes):
                s -= w.gain[r, n, 1 + j, a] * w.gain[r, n, 0, b]
            theta[a, b] = s
    theta[3, 1] += z
    theta[3, 2] -= y
    theta[4, 0] -= z
    theta[4, 2] += x
    theta[5, 0] += y
    theta[5, 1] -= x


@helper
def semidefinite_root(a, diagonal, root, n):
    """Rows root[:rank] with a[:n,:n] = root' root to round-off; returns the rank. Overwrites a and diagonal (n,).

    Cholesky with complete pivoting, scaled to a unit diagonal: what is left behind is smaller than the last pivot, and
    units do not matter.
    """
    for i in range(n):
        diagonal[i] = a[i, i]
    rank = 0
    while rank < n:
        best = -1
        largest = NEGLIGIBLE
        for i in range(n):
            if a[i, i] > largest * diagonal[i]:
                best = i
                largest = a[i, i] / diagonal[i]
        if best < 0:
            break
        s = 1.0 / sqrt(a[best, best])
        for i in range(n):
            root[rank, i] = a[best, i] * s
        for i in range(n):
            for j in range(n):
                a[i, j] -= root[rank, i] * root[rank, j]
        rank += 1
    return rank


@helper
def _to_orthonormal(c, w, k):
    """L^-1 z_f in place."""
    row = c.compliance[c.body[k].reduced]
    for n in range(c.body[k].modes - 1, -1, -1):
        s = 0.0
        for i in range(n if c.body[k].orthogonal else 0, n + 1):
            s += row[n, i] * w.mode[k, i].zf
        w.mode[k, n].zf = s


@helper
def _responses(c, w, k):
    """Ups' z_f + Omega y by node."""
    r = c.body[k].reduced
    nodes = c.body[k].nodes
    for i in range(nodes):
        for b in range(6):
            s = 0.0
            for n in range(c.body[k].modes):
                s += w.gain[r, n, 1 + i, b] * w.mode[k, n].zf
            w.node[r, i].response[b] = s
    for a in range(w.rank[r]):
        s = 0.0
        for i in range(nodes):
            for b in range(6):
                s += w.root[r, a, 6 * i + b] * w.node[r, i].force[b]
        for i in range(nodes):
            for b in range(6):
                w.node[r, i].response[b] += s * w.root[r, a, 6 * i + b]


@helper
def modal_accelerations(c, w, k, alpha, a):
    """etadd from the acceleration of O: outward half of (64)."""
    r = c.body[k].reduced
    nodes = c.body[k].nodes
    for i in range(nodes):
        node = w.node[r, i]
        for b in range(6):
            node.response[b] = node.force[b] + _row_times(node.carried[b], alpha, a)
    for n in range(c.body[k].modes):
        s = w.mode[k, n].zf + _row_times(w.gain[r, n, 0], alpha, a)
        for i in range(nodes):
            response = w.node[r, i].response
            s += _row_times(w.gain[r, n, 1 + i], vec3(response, 0), vec3(response, 3))
        w.mode[k, n].etadd = -s
    for n in range(c.body[k].modes):
        s = 0.0
        for i in range(n, n + 1 if c.body[k].orthogonal else c.body[k].modes):
            s += c.compliance[r, i, n] * w.mode[k, i].etadd
        w.mode[k, n].etadd = s
        w.speed[c.body[k].etad_index + n].acceleration = s


@helper
def _row_times(row, x, y):
    """Product of 6 numbers with [x; y]."""
    return row[0] * x[0] + row[1] * x[1] + row[2] * x[2] + row[3] * y[0] + row[4] * y[1] + row[5] * y[2]
