"""The range of deflections in which a modal field is meaningful."""

from flexmb.jit.features import has
from flexmb.jit.kernel import helper
from flexmb.jit.lanes import every, kept
from flexmb.levels.body import is_at_rest
from flexmb.tables.features import SECTIONS

RANGE = 10.0  # in sizes of the body: a larger deflection means that the motion has diverged
ONE_TURN = 2.4  # the same of a straight beam bent to a circle, as a linear beam: 2 pi sqrt(3 / 20)


@helper
def is_out_of_range(c, eta, k):
    """Whether the mean square deflection eta' M_ff eta / m exceeds RANGE^2 times the body's mean square size.

    A beam of level exact deflects by its own size at most, and may be wound up as far as its points follow: by a turn
    from one to the next. There eta'eta / m is the deflection of the linear beam with the same strains, whose modes have
    unit masses at rest: that of `ONE_TURN` for every turn of a uniform beam with constant curvature.

    eta (m,) is zero at level ruthless, whose bodies are never out of range. In lanes the answer is True if all copies
    are; the copies in which the body is so alone get NaN and end by that.
    """
    if c.body[k].modes == 0 or is_at_rest(c.body[k].level):
        return False
    body = c.body[k].rigid
    size = 0.5 * (body[4] + body[5] + body[6])
    limit = RANGE * RANGE * size
    if has(c, SECTIONS) and c.body[k].section_stop > c.body[k].section_start:
        wound = ONE_TURN * (c.body[k].section_stop - c.body[k].section_start)
        return _is_beyond(_squares(c, eta, k), wound * wound * size, eta)
    diagonal = 0.0
    for n in range(c.body[k].modes):
        diagonal += eta[n] * c.mff[k, n, n] * eta[n]
    if every(c.body[k].modes * diagonal.real <= limit.real):  # an upper bound of the sum below, by Cauchy-Schwarz
        return False
    squares = 0.0
    for n in range(c.body[k].modes):
        for i in range(c.body[k].modes):
            squares += eta[n] * c.mff[k, n, i] * eta[i]
    return _is_beyond(squares, limit, eta)


@helper
def _squares(c, eta, k):
    """eta'eta."""
    squares = 0.0
    for n in range(c.body[k].modes):
        squares += eta[n] * eta[n]
    return squares


@helper
def _is_beyond(squares, limit, eta):
    eta[0] = kept(squares.real <= limit.real, eta[0])
    return every(squares.real > limit.real)
