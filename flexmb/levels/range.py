"""The range of deflections in which a modal field is meaningful."""

from flexmb.jit.features import has
from flexmb.jit.kernel import helper
from flexmb.jit.lanes import every, kept
from flexmb.levels.body import is_at_rest
from flexmb.tables.features import SECTIONS

RANGE = 10.0  # in sizes of the body: a larger deflection means that the motion has diverged


@helper
def is_out_of_range(c, eta, k):
    """Whether the mean square deflection eta' M_ff eta / m exceeds RANGE^2 times the body's mean square size.

    eta (m,) is zero at level ruthless, whose bodies are never out of range. In lanes the answer is True if all copies
    are; the copies in which the body is so alone get NaN and end by that. At level exact, whose modal masses are unity
    at rest, the deflection is that of the linear beam: ten sizes are three to four full turns of bending.
    """
    if c.body[k].modes == 0 or is_at_rest(c.body[k].level):
        return False
    body = c.body[k].rigid
    limit = RANGE * RANGE * 0.5 * (body[4] + body[5] + body[6])
    diagonal, own = 0.0, 1.0 if has(c, SECTIONS) and c.body[k].section_stop > c.body[k].section_start else 0.0
    for n in range(c.body[k].modes):
        diagonal += eta[n] * (c.mff[k, n, n] + own) * eta[n]
    if every(c.body[k].modes * diagonal.real <= limit.real):  # an upper bound of the sum below, by Cauchy-Schwarz
        return False
    squares = 0.0
    for n in range(c.body[k].modes):
        squares += own * eta[n] * eta[n]
        for i in range(c.body[k].modes):
            squares += eta[n] * c.mff[k, n, i] * eta[i]
    eta[0] = kept(squares.real <= limit.real, eta[0])
    return every(squares.real > limit.real)
