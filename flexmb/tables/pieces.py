"""Piecewise polynomials of degree five in kernels: functions of time by a table, and load laws of a displacement.

A row of a table is one piece (8,): its left end, the integral up to there (for load laws only), and six coefficients
of the distance from the left end, highest power first.
"""

from flexmb.jit.kernel import by_number, helper
from flexmb.jit.lanes import select, some


@helper
def _one_piece(x, table, first, last):
    row = first
    while row + 1 < last and x.real >= table[row + 1, 0].real:
        row += 1
    return _piece(table, row)


@helper
def _a_piece_each(x, table, first, last):
    """The same for lanes, each of which may be in another piece."""
    found = _piece(table, first)
    for row in range(first + 1, last):
        reached, now = x >= table[row, 0], _piece(table, row)
        if not some(reached):
            break
        found = (
            select(reached, now[0], found[0]),
            select(reached, now[1], found[1]),
            select(reached, now[2], found[2]),
            select(reached, now[3], found[3]),
            select(reached, now[4], found[4]),
            select(reached, now[5], found[5]),
            select(reached, now[6], found[6]),
            select(reached, now[7], found[7]),
        )
    return found


@helper
def _piece(table, row):
    x = table[row]
    return x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7]


piece_at = by_number(_one_piece, _a_piece_each)
"""(x, table, first, last): the row of table[first:last] that contains x; the outer rows also apply beyond the ends."""
