"""Load laws: piecewise polynomials of a displacement, and their energy."""

from flexmb.jit.kernel import helper
from flexmb.tables.pieces import piece_at


@helper
def resistance(x, law, start, stop):
    """The load that resists a displacement x, by the rows start .. stop of a law, and the energy stored: (load, J)."""
    left, energy, c5, c4, c3, c2, c1, c0 = piece_at(x, law, start, stop)
    d = x - left
    load = c0 + d * (c1 + d * (c2 + d * (c3 + d * (c4 + d * c5))))
    stored = c0 + d * (c1 / 2.0 + d * (c2 / 3.0 + d * (c3 / 4.0 + d * (c4 / 5.0 + d * (c5 / 6.0)))))
    return load, energy + d * stored
