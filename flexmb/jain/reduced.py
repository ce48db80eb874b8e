"""What outboard bodies do to the modes of a reduced body, kept at its nodes: of size 6 each, whatever the mode count.

A node is a port that deforms and carries a hinge. With Gamma and y the articulated inertia and force of what is hinged
there, and A the acceleration of the node, its load on the body and its modes is F = Gamma A + y. Matrices of several
nodes have six rows for each.
"""

from math import sqrt

from flexmb.jit.kernel import helper
from flexmb.spatial.inertia import inertia_times, load_inertia, rotate_inertia, shift_inertia, store_inertia
from flexmb.spatial.pivots import SINGULAR
from flexmb.spatial.spatial_vector import shift_force, store6, times6, vec6
from flexmb.spatial.vector import mat3, vec3


@helper
def to_node(c, w, k, P, F):
    """Gamma = P_R^+ = P and y = z_R^+ = F of body k, referred to the node of its parent, parent axes."""
    R_parent_body, arm = mat3(w.body[k].rotation, 0), vec3(w.body[k].arm, 0)
    node = w.node[c.body[c.body[k].parent].reduced, c.body[k].node]
    store_inertia(node.gamma, 0, shift_inertia(rotate_inertia(R_parent_body, P), arm))
    store6(node.force, 0, shift_force(times6(R_parent_body, F), arm))


@helper
def node_inertia(w, r, nodes):
    """T = (1 + Gamma Omega)^-1 Gamma into w.scratch[2], for Omega = root' root; False where it does not exist.

    As Gamma - B'B with B = C^-1 root Gamma and C C' = 1 + root Gamma root': neither Gamma, which a hinge makes
    singular, nor Omega, which has the rank of the modes, is inverted.
    """
    B, C, T = w.scratch[0], w.scratch[1], w.scratch[2]
    root, rank = w.root[r], w.rank[r]
    for i in range(nodes):
        gamma = load_inertia(w.node[r, i].gamma, 0)
        for a in range(rank):
            store6(B[a], 6 * i, inertia_times(gamma, vec6(root[a], 6 * i)))
    for a in range(rank):
        for b in range(a + 1):
            s = 1.0 if a == b else 0.0
            for i in range(6 * nodes):
                s += B[a, i] * root[b, i]
            C[a, b] = s
        T[0, a] = SINGULAR * C[a, a]
    for a in range(rank):  # one elimination for C and B: roots are no part of its chain of divisions
        if not C[a, a] > T[0, a]:
            return False
        s = 1.0 / C[a, a]
        for b in range(a + 1, rank):
            factor = s * C[b, a]
            for e in range(a + 1, b + 1):
                C[b, e] -= factor * C[e, a]
            for i in range(6 * nodes):
                B[b, i] -= factor * B[a, i]
        s = sqrt(s)
        for i in range(6 * nodes):
            B[a, i] *= s
    for i in range(6 * nodes):
        for j in range(i + 1):
            s = 0.0
            for a in range(rank):
                s -= B[a, i] * B[a, j]
            T[i, j] = s
            T[j, i] = s
    for i in range(nodes):
        _add_block(T, 6 * i, load_inertia(w.node[r, i].gamma, 0))
    return True


@helper
def _add_block(T, i, gamma):
    """Add a spatial inertia to the diagonal block of T that starts at row i."""
    a, b, c = gamma
    for n in range(3):
        T[i + n, i + n] += a[n]
        T[i + 3 + n, i + 3 + n] += c[n]
        for m in range(3):
            T[i + n, i + 3 + m] += b[3 * n + m]
            T[i + 3 + m, i + n] += b[3 * n + m]
    for n, row, column in ((3, 0, 1), (4, 0, 2), (5, 1, 2)):
        T[i + row, i + column] += a[n]
        T[i + column, i + row] += a[n]
        T[i + 3 + row, i + 3 + column] += c[n]
        T[i + 3 + column, i + 3 + row] += c[n]
