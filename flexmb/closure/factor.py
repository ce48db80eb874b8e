"""Rank-revealing factorisation of Lambda^-1 = B'B: B P = Q R with column pivoting, never B'B itself.

Each group of closures is factorised by itself, in the columns that are its own (`flexmb.closure.groups`); what groups
feel of each other through shared columns comes in when loads are solved for (`flexmb.closure.clusters`).
Modified Gram-Schmidt; its R is as good as Householder's, and only R is used to solve (the semi-normal equations). A row
is counted as dependent on those chosen before it when what is left of it is below `DEPENDENT` times how far the ports
of its closure move by themselves, cw.size of `flexmb.closure.sizes`, rotations weighed with a length of the scene. On a
closed configuration what is left of a redundant row is round-off and the residual of the assembly, 1e-12 or less.
"""

from math import sqrt

from flexmb.closure.clusters import factorise_shared, subtract_shared
from flexmb.jit.kernel import helper, sweep

DEPENDENT = 1e-9


@helper
def norm(x, first, count):
    """Of count numbers from x[first] on."""
    total = 0.0
    for j in range(first, first + count):
        total += x[j] * x[j]
    return sqrt(total)


@helper
def rows(cc, g):
    """How many rows group g has."""
    return cc.group[g].row_stop - cc.group[g].row_start


@helper
def columns(cc, g):
    """How many speeds loads of group g may change."""
    return cc.group[g].column_stop - cc.group[g].column_start


@helper
def own_columns(cc, g):
    """How many of them are its own: the first ones."""
    return cc.group[g].own_stop - cc.group[g].column_start


@helper
def row_place(cc, g, r):
    """Where row r, of group g, begins in cw.half; in cw.basis what is at place r of cw.chosen."""
    return cc.group[g].half + (r - cc.group[g].row_start) * columns(cc, g)


@helper
def entry(cc, g, a, b):
    """Place of R[a, b] of group g in cw.factor."""
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
    """Order the rows of group g; returns how many independent ones were found, `wanted` at most."""
    first, stop, own = cc.group[g].row_start, cc.group[g].row_stop, own_columns(cc, g)
    for r in range(first, stop):
        cw.chosen[r] = r
    for j in range(cc.group[g].half, cc.group[g].half + (stop - first) * columns(cc, g)):
        cw.basis[j] = cw.half[j]  # until they are in order, rows stand in it as in `half`
    found = 0
    while first + found < stop and found != wanted:
        best, at = DEPENDENT, -1
        for place in range(first + found, stop):
            r = cw.chosen[place]
            if cw.size[r] > 0.0:  # ports that nothing moves have rows of zeros
                left = cc.weight[r] * norm(cw.basis, row_place(cc, g, r), own) / cw.size[r]
                if left > best:
                    best, at = left, place
        if at < 0:
            break
        cw.chosen[first + found], cw.chosen[at] = cw.chosen[at], cw.chosen[first + found]
        along = row_place(cc, g, cw.chosen[first + found])
        length = norm(cw.basis, along, own)
        for place in range(first + found + 1, stop):
            _orthogonalise(cw.basis, row_place(cc, g, cw.chosen[place]), along, (own, own), length * length)
        found += 1
    return found


@helper
def _orthogonalise(basis, x, along, extent, squared):
    """x -= along (along . x) / squared, both numbers of the basis from there on; returns the coefficient.

    extent: (how many enter the product, how many are changed).
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
    """R of the chosen rows; returns -1, or the row that depends on those before it."""
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
    """Make a row the one numbered a of the basis of its group, after those before it: column a of R; its pivot."""
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
    """Loads f of the chosen rows, Lambda^-1 f = cw.scratch (by place in cw.chosen), into cw.row.load; others are 0."""
    for r in range(cw.row.shape[0]):
        cw.row[r].load = 0.0
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
            cw.row[cw.chosen[place]].load = b[place]


@helper
def sum_rows(cc, cw, x):
    """x (nu,) = sum of the rows of cw.half, each times its load."""
    for j in range(x.shape[0]):
        x[j] = 0.0
    for g in range(cc.group.shape[0]):
        start = cc.group[g].column_start
        for r in range(cc.group[g].row_start, cc.group[g].row_stop):
            load, at = cw.row[r].load, row_place(cc, g, r)
            for n in range(columns(cc, g)):
                x[cc.column[start + n]] += load * cw.half[at + n]
