"""Rank-revealing factorisation of Lambda^-1 = B'B: B P = Q R with column pivoting, without forming B'B.

Each group of closures is factorised separately, in its own columns (`flexmb.closure.groups`); the coupling of groups
by shared columns enters when the loads are solved for (`flexmb.closure.clusters`).
The algorithm is modified Gram-Schmidt. Its R is as accurate as that of Householder's method, and only R is used in the
solution (semi-normal equations). A row counts as dependent on those chosen before it if its remainder is smaller than
`DEPENDENT` times the response of the separate ports of its closure, cw.size of `flexmb.closure.sizes`, where rotations
are weighted with a length of the scene. In a closed configuration the remainder of a redundant row is round-off and
the residual of the assembly, 1e-12 or less.
"""

from math import sqrt

from flexmb.closure.clusters import factorise_shared, subtract_shared
from flexmb.jit.kernel import helper, sweep

DEPENDENT = 1e-9


@helper
def norm(x, first, count):
    """Euclidean norm of x[first : first + count]."""
    total = 0.0
    for j in range(first, first + count):
        total += x[j] * x[j]
    return sqrt(total)


@helper
def rows(cc, g):
    """Number of rows of group g."""
    return cc.group[g].row_stop - cc.group[g].row_start


@helper
def columns(cc, g):
    """Number of speeds that loads of group g may change."""
    return cc.group[g].column_stop - cc.group[g].column_start


@helper
def own_columns(cc, g):
    """Number of those speeds that no other group shares; they come first."""
    return cc.group[g].own_stop - cc.group[g].column_start


@helper
def row_place(cc, g, r):
    """Index where row r of group g begins in cw.half; in cw.basis, that of the row at position r of cw.chosen."""
    return cc.group[g].half + (r - cc.group[g].row_start) * columns(cc, g)


@helper
def entry(cc, g, a, b):
    """Index of R[a, b] of group g in cw.factor."""
    return cc.group[g].factor + a * rows(cc, g) + b


@sweep
def choose_rows(cc, cw):
    """Order the rows of every group by pivot and count the independent ones, at most cw.rank if that is not negative.

    Returns the first group where fewer than cw.rank were found, or -1; a negative cw.rank receives the number.
    """
    short = -1
    for g in range(cc.group.shape[0]):
        wanted = cw.rank[g]
        found = _choose(cc, cw, g, wanted)
        if wanted < 0:
            cw.rank[g] = found
        elif found != wanted and short < 0:
            short = g
    return short


@helper
def _choose(cc, cw, g, wanted):
    """Order the rows of group g by pivot; returns the number of independent ones, at most `wanted`."""
    first, stop, own = cc.group[g].row_start, cc.group[g].row_stop, own_columns(cc, g)
    for r in range(first, stop):
        cw.chosen[r] = r
    for j in range(cc.group[g].half, cc.group[g].half + (stop - first) * columns(cc, g)):
        cw.basis[j] = cw.half[j]  # before the pivoting, rows have the order of `half`
    chosen = 0
    while first + chosen < stop and chosen != wanted:
        best, at = DEPENDENT, -1
        for place in range(first + chosen, stop):
            r = cw.chosen[place]
            if cw.size[r] > 0.0:  # ports that cannot move have rows of zeros
                left = cc.weight[r] * norm(cw.basis, row_place(cc, g, r), own) / cw.size[r]
                if left > best:
                    best, at = left, place
        if at < 0:
            break
        cw.chosen[first + chosen], cw.chosen[at] = cw.chosen[at], cw.chosen[first + chosen]
        along = row_place(cc, g, cw.chosen[first + chosen])
        length = norm(cw.basis, along, own)
        for place in range(first + chosen + 1, stop):
            _orthogonalise(cw.basis, row_place(cc, g, cw.chosen[place]), along, (own, own), length * length)
        chosen += 1
    return chosen


@helper
def _orthogonalise(basis, x, along, extent, squared):
    """x -= along (along . x) / squared, where x and along are start indices in `basis`; returns the coefficient.

    extent: (number of entries in the product, number of entries that are changed).
    """
    own, width = extent
    total = 0.0
    for j in range(own):
        total += basis[along + j] * basis[x + j]
    total /= squared
    for j in range(width):
        basis[x + j] -= total * basis[along + j]
    return total


@sweep
def factorise(cc, cw):
    """Compute R of the chosen rows; returns -1, or the row that depends on the rows before it."""
    for g in range(cc.group.shape[0]):
        for a in range(cw.rank[g]):
            row = cw.chosen[cc.group[g].row_start + a]
            length = _orthonormalise(cc, cw, g, a, row)
            if not cc.weight[row] * length > DEPENDENT * cw.size[row]:
                return row
    factorise_shared(cc, cw)
    return -1


@helper
def _orthonormalise(cc, cw, g, a, row):
    """Orthogonalise a row against the first a rows of its group's basis, into column a of R; returns its pivot."""
    first, own, width = cc.group[g].row_start, own_columns(cc, g), columns(cc, g)
    x, half = row_place(cc, g, first + a), row_place(cc, g, row)
    for j in range(width):
        cw.basis[x + j] = cw.half[half + j]
    for b in range(a):
        cw.factor[entry(cc, g, b, a)] = _orthogonalise(cw.basis, x, row_place(cc, g, first + b), (own, width), 1.0)
    length = norm(cw.basis, x, own)
    cw.factor[entry(cc, g, a, a)] = length
    for j in range(x, x + width):
        cw.basis[j] /= length
    return length


@sweep
def solve(cc, cw):
    """Solve Lambda^-1 f = cw.scratch (ordered as cw.chosen) for f, into cw.solution by row; other rows get 0.

    f are loads, changes of loads, or what displaces: whoever lets them act as loads writes them to cw.row.load.
    """
    for r in range(cw.solution.shape[0]):
        cw.solution[r] = 0.0
    R, b = cw.factor, cw.scratch
    for g in range(cc.group.shape[0]):
        first, rank = cc.group[g].row_start, cw.rank[g]
        for a in range(rank):
            for m in range(a):
                b[first + a] -= R[entry(cc, g, m, a)] * b[first + m]
            b[first + a] /= R[entry(cc, g, a, a)]
    for k in range(cc.cluster.shape[0]):
        subtract_shared(cc, cw, k, b)
    for g in range(cc.group.shape[0]):
        first, rank = cc.group[g].row_start, cw.rank[g]
        for a in range(rank - 1, -1, -1):
            for m in range(a + 1, rank):
                b[first + a] -= R[entry(cc, g, a, m)] * b[first + m]
            b[first + a] /= R[entry(cc, g, a, a)]
        for place in range(first, first + rank):
            cw.solution[cw.chosen[place]] = b[place]


@helper
def sum_rows(cc, cw, x):
    """x (nu,) = sum of the rows of cw.half, each times its entry of cw.solution."""
    for j in range(x.shape[0]):
        x[j] = 0.0
    for g in range(cc.group.shape[0]):
        start = cc.group[g].column_start
        for r in range(cc.group[g].row_start, cc.group[g].row_stop):
            load, at = cw.solution[r], row_place(cc, g, r)
            for n in range(columns(cc, g)):
                x[cc.column[start + n]] += load * cw.half[at + n]
