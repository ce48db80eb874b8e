"""Rank-revealing factorisation of Lambda^-1 = B'B: B P = Q R with column pivoting, never B'B itself.

Modified Gram-Schmidt; its R is as good as Householder's, and only R is used to solve (the semi-normal equations). A row
is counted as dependent on those chosen before it when what is left of it is below `DEPENDENT` times the size of its
closure's rows, rotations weighed with a length of the scene. On a closed configuration what is left of a redundant row
is round-off and the residual of the assembly, 1e-12 or less.
"""

from math import sqrt

from flexmb.kernel import helper

DEPENDENT = 1e-9
ROUND_OFF = 2.0**-46  # rows this small beside the largest of the scene are what rounding leaves of nothing


@helper
def _norm(x):
    total = 0.0
    for value in x:
        total += value * value
    return sqrt(total)


@helper
def closure_sizes(cc, cw):
    """The size of every row's closure: root of the sum of squares over its weighted rows, into cw.scratch."""
    largest = 0.0
    for i in range(cc.closure.shape[0]):
        total = 0.0
        for r in range(cc.closure[i].row_start, cc.closure[i].row_stop):
            total += (cc.weight[r] * _norm(cw.half[r])) ** 2
        size = sqrt(total)
        largest = max(largest, size)
        for r in range(cc.closure[i].row_start, cc.closure[i].row_stop):
            cw.scratch[r] = size
    for r in range(cc.row.shape[0]):  # a closure of parts that cannot move has rows of round-off only
        cw.scratch[r] = max(cw.scratch[r], ROUND_OFF / DEPENDENT * largest)


@helper
def choose_rows(cc, cw):
    """Order the rows by pivot and count the independent ones, at most cw.rank[0] if that is not negative.

    Returns whether as many as cw.rank[0] were found; a negative cw.rank[0] receives the number.
    """
    rows = cc.row.shape[0]
    closure_sizes(cc, cw)
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
            if cw.scratch[r] > 0.0:
                left = cc.weight[r] * _norm(cw.basis[r]) / cw.scratch[r]
                if left > best:
                    best, at = left, i
        if at < 0:
            break
        cw.chosen[found], cw.chosen[at] = cw.chosen[at], cw.chosen[found]
        first = cw.chosen[found]
        length = _norm(cw.basis[first])
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
    closure_sizes(cc, cw)
    for a in range(cw.rank[0]):
        row = cw.chosen[a]
        x = cw.basis[a]
        for j in range(x.shape[0]):
            x[j] = cw.half[row, j]
        for b in range(a):
            cw.factor[b, a] = _orthogonalise(x, cw.basis[b], 1.0)
        length = _norm(x)
        if not cc.weight[row] * length > DEPENDENT * cw.scratch[row]:
            return row
        cw.factor[a, a] = length
        for j in range(x.shape[0]):
            x[j] /= length
    return -1


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
