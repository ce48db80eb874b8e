"""Rank-revealing factorisation of Lambda^-1 = B'B: B P = Q R with column pivoting, never B'B itself.

Modified Gram-Schmidt; its R is as good as Householder's, and only R is used to solve (the semi-normal equations). A row
is counted as dependent on those chosen before it when what is left of it is below `DEPENDENT` times how far the ports
of its closure move by themselves, cw.size of `flexmb.closure.sizes`, rotations weighed with a length of the scene. On a
closed configuration what is left of a redundant row is round-off and the residual of the assembly, 1e-12 or less.
"""

from math import sqrt

from flexmb.jit.kernel import helper

DEPENDENT = 1e-9


@helper
def norm(x):
    total = 0.0
    for i in range(x.shape[0]):
        total += x[i] * x[i]
    return sqrt(total)


@helper
def choose_rows(cc, cw):
    """Order the rows by pivot and count the independent ones, at most cw.rank[0] if that is not negative.

    Returns whether as many as cw.rank[0] were found; a negative cw.rank[0] receives the number.
    """
    rows = cc.row.shape[0]
    wanted = cw.rank[0]
    for r in range(rows):
        cw.chosen[r] = r
        for j in range(cw.half.shape[1]):
            cw.basis[r, j] = cw.half[r, j]
    found = 0
    while found < rows and found != wanted:
        best, at = DEPENDENT, -1
        for i in range(found, rows):
            r = cw.chosen[i]
            if cw.size[r] > 0.0:  # ports that nothing moves have rows of zeros
                left = cc.weight[r] * norm(cw.basis[r]) / cw.size[r]
                if left > best:
                    best, at = left, i
        if at < 0:
            break
        cw.chosen[found], cw.chosen[at] = cw.chosen[at], cw.chosen[found]
        first = cw.chosen[found]
        length = norm(cw.basis[first])
        for i in range(found + 1, rows):
            r = cw.chosen[i]
            _orthogonalise(cw.basis[r], cw.basis[first], length * length)
        found += 1
    if wanted < 0:
        cw.rank[0] = found
        return True
    return found == wanted


@helper
def _orthogonalise(x, along, squared):
    """x -= along (along . x) / squared; returns the coefficient."""
    total = 0.0
    for j in range(x.shape[0]):
        total += along[j] * x[j]
    total /= squared
    for j in range(x.shape[0]):
        x[j] -= total * along[j]
    return total


@helper
def factorise(cc, cw):
    """R of the chosen rows; returns -1, or the row that depends on those before it."""
    for a in range(cw.rank[0]):
        row = cw.chosen[a]
        length = orthonormalise(cw, a, row)
        if not cc.weight[row] * length > DEPENDENT * cw.size[row]:
            return row
    return -1


@helper
def orthonormalise(cw, a, row):
    """Make a row the one numbered a of the basis, after those before it: column a of R; returns its pivot."""
    x = cw.basis[a]
    for j in range(x.shape[0]):
        x[j] = cw.half[row, j]
    for b in range(a):
        cw.factor[b, a] = _orthogonalise(x, cw.basis[b], 1.0)
    length = norm(x)
    cw.factor[a, a] = length
    for j in range(x.shape[0]):
        x[j] /= length
    return length


@helper
def solve(cw):
    """Loads of the chosen rows from R'R f = cw.scratch (by chosen row), into cw.row.load; those of the others are 0."""
    rank, R, b = cw.rank[0], cw.factor, cw.scratch
    for a in range(rank):
        for m in range(a):
            b[a] -= R[m, a] * b[m]
        b[a] /= R[a, a]
    for a in range(rank - 1, -1, -1):
        for m in range(a + 1, rank):
            b[a] -= R[a, m] * b[m]
        b[a] /= R[a, a]
    for r in range(cw.row.shape[0]):
        cw.row[r].load = 0.0
    for a in range(rank):
        cw.row[cw.chosen[a]].load = b[a]
