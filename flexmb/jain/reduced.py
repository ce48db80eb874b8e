"""Effect of the outboard bodies on the modes of a reduced body, expressed at its nodes.

A node is a port that deforms and carries a hinge. Let Gamma and y be the articulated inertia and force of all that is
hinged there, and A the acceleration of the node. The load of the node on its outboard body is then F = Gamma A + y.
Matrices of several nodes have six rows for each node, however many modes the body has.
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
    """T = (1 + Gamma Omega)^-1 Gamma to w.scratch[2], Omega = root' root; returns False if it does not exist.

    Computed as Gamma - B'B with B = C^-1 root Gamma and C C' = 1 + root Gamma root'. This inverts neither Gamma, which
    is singular behind a hinge, nor Omega, whose rank is at most the number of modes; 1 + root Gamma root' is symmetric
    with no eigenvalue below one.
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
        T[0, a] = SINGULAR * C[a, a]  # the least value that the pivot of row a may have; T is free until the end
    # C is eliminated as L D L' together with B. The square roots come after a row is finished, so that no pivot waits
    # for a root of the one before.
    for a in range(rank):
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
