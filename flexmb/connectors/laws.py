"""Load laws: piecewise polynomials of a displacement, and their energy.

A row of `flexmb.tables.arrays.Constants.law` is one piece, of degree five at most.
"""

from flexmb.jit.kernel import by_number, helper
from flexmb.jit.lanes import select, some


@helper
def _one_piece(x, law, start, stop):
    row = start
    while row + 1 < stop and x.real >= law[row + 1, 0]:
        row += 1
    return _piece(law, row)


@helper
def _a_piece_each(x, law, start, stop):
    """Of lanes, each of which may be in another piece."""
    found = _piece(law, start)
    for row in range(start + 1, stop):
        reached, now = x >= law[row, 0], _piece(law, row)
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
def _piece(law, row):
    x = law[row]
    return x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7]


_piece_at = by_number(_one_piece, _a_piece_each)


@helper
def resistance(x, law, start, stop):
    """The load that resists a displacement x, by the rows start .. stop of a law, and the energy stored: (load, J)."""
    left, energy, c5, c4, c3, c2, c1, c0 = _piece_at(x, law, start, stop)
    d = x - left
    load = c0 + d * (c1 + d * (c2 + d * (c3 + d * (c4 + d * c5))))
    stored = c0 + d * (c1 / 2.0 + d * (c2 / 3.0 + d * (c3 / 4.0 + d * (c4 / 5.0 + d * (c5 / 6.0)))))
    return load, energy + d * stored
