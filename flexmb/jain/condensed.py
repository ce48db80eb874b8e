"""Modes condensed onto the nodes of a body: (63), (64) at cost O(n_m) without D_f, where M_ff = L L' is constant.

With Lam = M_ff^-1, the constants of Appendix B are Psi = Lam M_fr, Ups = Lam Pi', zeta = M_rf Psi, Omega = Pi Ups and
Theta = phi' - Pi Psi. The modal accelerations follow from that of the body and the loads F at its nodes,

    etadd = -Lam z_f - Psi alpha - Ups F,      F = T Theta alpha + F_0,      T = (1 + Gamma Omega)^-1 Gamma,
    F_0   = y - T (Ups' z_f + Omega y),

hence P_R = M_rr - zeta + Theta' T Theta and z_R = z_r - Psi' z_f + Theta' F_0, in which no matrix has the size of the
modes. Stored are L' Psi = L^-1 M_fr, L' Ups and L^-1 z_f in place of Psi, Ups and Lam z_f: products of two of them
contain Lam with the square root of its condition in each factor, which loses fewer digits. Where M_fr and Pi change
with the deformation, these tables are recomputed at each evaluation.
"""

from math import sqrt

from flexmb.jain.explicit import cholesky, refer_rigid
from flexmb.jain.reduced import node_inertia
from flexmb.jit.kernel import helper
from flexmb.jit.strips import put, put_across, strip, width
from flexmb.levels.body import is_at_rest
from flexmb.spatial.inertia import add_product, store_inertia
from flexmb.spatial.rows import column_inertia, strips6
from flexmb.spatial.spatial_vector import dot6, plus6, store6, sub6, vec6
from flexmb.spatial.vector import vec3

NEGLIGIBLE = 2.0**-49  # 16 unit roundoffs: pivots of a matrix with unit diagonal below this are rounding errors


@helper
def eliminate_modes(c, w, k):
    """P_R and z_R of (63), (64) from the constants of (B4); returns False if 1 + Gamma Omega is singular."""
    r = c.body[k].reduced
    nodes = c.body[k].nodes
    if not is_at_rest(c.body[k].level):
        _tables(c, w, k)
    elif c.body[k].outboard_port >= 0:
        refer_rigid(c, w, k)
    _to_orthonormal(c, w, k)
    for b in range(21):
        w.body[k].hinge_inertia[b] = w.body[k].inertia[b] - w.zeta[r, b]
    F = _sum_of_modes(w, w.zf[k], w.gain[r, 0], c.body[k].modes)
    store6(w.body[k].hinge_force, 0, sub6(vec6(w.body[k].force, 0), F))
    if nodes == 0:
        return True
    if not node_inertia(w, r, nodes):
        return False
    _responses(c, w, k)
    _pass_nodes(w, k, r, nodes)
    return True


@helper
def _pass_nodes(w, k, r, nodes):
    """F_0 and T Theta of all nodes, and their shares of P_R += Theta' T Theta and z_R += Theta' F_0.

    Needs T in w.scratch[2], y in the nodes' `force` and Ups' z_f + Omega y in their `response`.
    """
    # F_0 goes to w.scratch first: the y of every node is needed until the last node has its F_0.
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


@helper
def _tables(c, w, k):
    """L^-1 M_fr, L^-1 Pi', zeta, Theta and the root of Omega at the present deformation, for diagonal L.

    `flexmb.jain.elimination.applies` admits no coupled modal masses here.
    """
    r, nodes, nm = c.body[k].reduced, c.body[k].nodes, c.body[k].modes
    rows, inverse, found = w.gain[r], c.compliance[r], w.point_mode
    for n in range(nm):
        _scale_row(w, inverse[n, n], w.pfr[k, n], rows[0, n])
    _products(w, rows[0], rows[0], nm, found)
    store_inertia(w.zeta[r], 0, column_inertia(found))
    omega = w.scratch[0]
    for j in range(nodes):
        port = c.node[r, j].port
        for n in range(0, nm, width(w)):
            put_across(w, rows[1 + j], n, strips6(w, w.port_mode[port], n))
        for n in range(nm):
            _scale_row(w, inverse[n, n], rows[1 + j, n], rows[1 + j, n])
        _products(w, rows[1 + j], rows[0], nm, found)
        _theta(found, vec3(w.port[port].r, 0), w.node[r, j].theta)
        for i in range(j + 1):
            _products(w, rows[1 + j], rows[1 + i], nm, found)
            for a in range(6):
                for b in range(6):
                    omega[6 * j + a, 6 * i + b] = found[a, b]
                    omega[6 * i + b, 6 * j + a] = found[a, b]
    w.rank[r] = semidefinite_root(omega, w.scratch[1, 0], w.root[r], 6 * nodes)


@helper
def _scale_row(w, s, row, out):
    """Write s times the six elements of `row` to `out`."""
    for b in range(0, 6, width(w)):
        put(w, out, b, s * strip(w, row, b))


@helper
def _products(w, left, right, nm, out):
    """Write X' Y (6,6) to `out`, X and Y being the first six columns of the first `nm` rows of `left` and `right`."""
    for a in range(6):
        for b in range(0, 6, width(w)):
            total = 0.0
            for n in range(nm):
                total += left[n, a] * strip(w, right[n], b)
            put(w, out[a], b, total)


@helper
def _theta(product, r, theta):
    """Theta = phi' - Pi Lam M_fr of a node at r from the `product` Pi Lam M_fr (6,6)."""
    for a in range(6):
        for b in range(6):
            theta[a, b] = -product[a, b]
        theta[a, a] += 1.0
    theta[3, 1] += r[2]
    theta[3, 2] -= r[1]
    theta[4, 0] -= r[2]
    theta[4, 2] += r[0]
    theta[5, 0] += r[1]
    theta[5, 1] -= r[0]


@helper
def semidefinite_root(a, diagonal, root, n):
    """Rows root[:rank] with a[:n,:n] = root' root to round-off; returns the rank. Overwrites a and diagonal (n,).

    By Cholesky's factor if every pivot is positive. Otherwise by elimination with complete pivoting of the matrix
    scaled to a unit diagonal: the remainder that is neglected is then smaller than the last pivot, in any units.
    """
    for i in range(n):
        diagonal[i] = a[i, i]
    if cholesky(a, n):
        for i in range(n):
            for j in range(n):
                root[j, i] = a[i, j] if j <= i else 0.0
        return n
    for i in range(n):
        a[i, i] = diagonal[i]
        for j in range(i):
            a[i, j] = a[j, i]
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
    """z_f := L^-1 z_f."""
    rows = c.compliance[c.body[k].reduced]  # L^-1, lower triangular: from the last column on, z_f[i] is still unchanged
    for i in range(c.body[k].modes - 1, -1, -1):
        s = w.zf[k, i]
        w.zf[k, i] = rows[i, i] * s
        if not c.body[k].orthogonal:
            for n in range(i + 1, c.body[k].modes):
                w.zf[k, n] += rows[n, i] * s


@helper
def _sum_of_modes(w, zf, rows, nm):
    """rows' z_f (6,): Psi' z_f or Ups' z_f of a node, from the rows of L' Psi or L' Ups and L^-1 z_f."""
    found = w.point_mode[0]
    for b in range(0, 6, width(w)):
        total = 0.0
        for n in range(nm):
            total += zf[n] * strip(w, rows[n], b)
        put(w, found, b, total)
    return vec6(found, 0)


@helper
def _responses(c, w, k):
    """Ups' z_f + Omega y of each node, Omega y by its root."""
    r = c.body[k].reduced
    nodes = c.body[k].nodes
    for i in range(nodes):
        store6(w.node[r, i].response, 0, _sum_of_modes(w, w.zf[k], w.gain[r, 1 + i], c.body[k].modes))
    for a in range(w.rank[r]):
        s = 0.0
        for i in range(nodes):
            for b in range(6):
                s += w.root[r, a, 6 * i + b] * w.node[r, i].force[b]
        for i in range(nodes):
            for b in range(6):
                w.node[r, i].response[b] += s * w.root[r, a, 6 * i + b]


@helper
def modal_accelerations(c, w, k, A):
    """etadd from the acceleration A of O: outward half of (64)."""
    r = c.body[k].reduced
    nodes = c.body[k].nodes
    for i in range(nodes):  # F = T Theta A + F_0
        node = w.node[r, i]
        for b in range(6):
            node.response[b] = plus6(node.force[b], vec6(node.carried[b], 0), A)
    rows = w.gain[r]
    for n in range(c.body[k].modes):
        s = plus6(w.zf[k, n], vec6(rows[0, n], 0), A)
        for i in range(nodes):
            s += dot6(vec6(rows[1 + i, n], 0), vec6(w.node[r, i].response, 0))
        w.etadd[k, n] = -s
    for i in range(c.body[k].modes):  # L'^-1 in place, from the first row of L^-1 on
        row, s = c.compliance[r, i], w.etadd[k, i]
        w.etadd[k, i] = row[i] * s
        if not c.body[k].orthogonal:
            for n in range(i):
                w.etadd[k, n] += row[n] * s
    for n in range(c.body[k].modes):
        w.speed[c.body[k].etad_index + n].acceleration = w.etadd[k, n]
