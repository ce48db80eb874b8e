"""Loads of groups that are coupled only by the bodies that carry them (a cluster).

The cost is that of the single groups plus that of the few shared speeds. The rows of a cluster are B' = [R'Q', S],
where the columns of the speeds of one group come before those of the shared speeds, so that

    Lambda^-1 = R'R + S S',   R'R in a block for each group.

With T = R'^-1 S, which is stored beside Q when the rows are orthonormalised, and z = R f the loads follow from

    (1 + T T') z = R'^-1 b,   (1 + T T')^-1 = 1 - T (1 + T'T)^-1 T'   (Woodbury),

where the order of 1 + T'T is the number of shared speeds. Its Cholesky factor C is found by Givens rotations of the
rows of T into the unit matrix, without forming T'T; all its pivots are at least 1.
"""

from math import sqrt

from flexmb.jit.kernel import helper


@helper
def shared_place(cc, g, a):
    """Index in cw.basis where the row of T that belongs to row a of group g begins."""
    group = cc.group[g]
    return group.half + a * (group.column_stop - group.column_start) + group.own_stop - group.column_start


@helper
def factorise_shared(cc, cw):
    """Compute C of every cluster, upper triangular with C'C = 1 + T'T, for the groups that were factorised last."""
    for k in range(cc.cluster.shape[0]):
        cluster = cc.cluster[k]
        n = cluster.shared
        for i in range(n):
            for j in range(n):
                cw.shared_factor[cluster.factor + i * n + j] = 1.0 if i == j else 0.0
        if n > 0:
            for g in range(cluster.group_start, cluster.group_stop):
                for a in range(cw.rank[g]):
                    _rotate_into(cw, cluster.factor, n, shared_place(cc, g, a))


@helper
def _rotate_into(cw, factor, n, at):
    """Eliminate the row of T that begins at cw.basis[at] by Givens rotations with the rows of C."""
    C, row = cw.shared_factor, cw.shared
    for j in range(n):
        row[j] = cw.basis[at + j]
    for i in range(n):
        pivot = C[factor + i * n + i]
        length = sqrt(pivot * pivot + row[i] * row[i])
        cosine, sine = pivot / length, row[i] / length
        for j in range(i, n):
            old = C[factor + i * n + j]
            C[factor + i * n + j] = cosine * old + sine * row[j]
            row[j] = cosine * row[j] - sine * old


@helper
def subtract_shared(cc, cw, k, z):
    """z = (1 + T T')^-1 z for the entries of cluster k."""
    cluster, y, C = cc.cluster[k], cw.shared, cw.shared_factor
    n = cluster.shared
    for j in range(n):
        y[j] = 0.0
    for g in range(cluster.group_start, cluster.group_stop):
        for a in range(cw.rank[g]):
            at = shared_place(cc, g, a)
            for j in range(n):
                y[j] += cw.basis[at + j] * z[cc.group[g].row_start + a]
    for i in range(n):
        for m in range(i):
            y[i] -= C[cluster.factor + m * n + i] * y[m]
        y[i] /= C[cluster.factor + i * n + i]
    for i in range(n - 1, -1, -1):
        for m in range(i + 1, n):
            y[i] -= C[cluster.factor + i * n + m] * y[m]
        y[i] /= C[cluster.factor + i * n + i]
    for g in range(cluster.group_start, cluster.group_stop):
        for a in range(cw.rank[g]):
            at = shared_place(cc, g, a)
            for j in range(n):
                z[cc.group[g].row_start + a] -= cw.basis[at + j] * y[j]
