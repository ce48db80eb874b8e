"""The regressor of inverse dynamics: RATES columns in one evaluation, with unit rates of as many parameters."""

from flexmb.entry.articulated import inverse_dynamics
from flexmb.jit.duals import RATES, rate, seeded
from flexmb.jit.kernel import helper, kernel
from flexmb.jit.strips import ROW
from flexmb.parameters.inertia import COUPLING, DAMPING, GYRATION, MASS, MOMENT, RIGID, STIFFNESS


@kernel
def regressor(t, y, rates, Y, places, c, w, x):
    """Y (nu,P) = d tau/d(tables) at y = [q, u, work] and rates (nu,), for the numbers of the tables at these places.

    c: constants in duals, whose derivatives are zero before and after.
    """
    w.time[0] = t
    for i in range(y.shape[0]):
        w.state[i] = y[i]
    place = places.place
    parameters = place.shape[0]
    for first in range(0, parameters, RATES):
        count = min(RATES, parameters - first)
        for lane in range(count):
            _seed(c, place, first + lane, lane)
        inverse_dynamics(w.time[0], w.state, rates, c, w, x.tau, x.hinges)
        for lane in range(count):
            _seed(c, place, first + lane, -1)
            for j in range(rates.shape[0]):
                Y[j, first + lane] = rate(x.tau[j], lane)


@helper
def _seed(c, place, p, lane):
    """Give the number at a place a unit rate in a lane; without any rate for a negative lane."""
    table, k, row, i, j = place[p, 0], place[p, 1], place[p, 2], place[p, 3], place[p, 4]
    if table == RIGID:
        c.body[k].rigid[i] = _unit(c.body[k].rigid[i], lane)
    elif table == MASS:
        c.mff[k, i, j] = _unit(c.mff[k, i, j], lane)
        c.mff[k, j, i] = c.mff[k, i, j]
    elif table == STIFFNESS:
        c.stiffness[k, i, j] = _unit(c.stiffness[k, i, j], lane)
        c.stiffness[k, j, i] = c.stiffness[k, i, j]
    elif table == DAMPING:
        c.damping[k, i, j] = _unit(c.damping[k, i, j], lane)
        c.damping[k, j, i] = c.damping[k, i, j]
    elif table == COUPLING:
        c.mfr[k, i, j] = _unit(c.mfr[k, i, j], lane)
    elif table == GYRATION:
        c.gyration[k, i, j] = _unit(c.gyration[k, i, j], lane)
    elif table == MOMENT:
        at = i * ROW + j % ROW
        c.product[row, j // ROW, 0, at] = _unit(c.product[row, j // ROW, 0, at], lane)


@helper
def _unit(x, lane):
    """The number alone, with a unit rate in a lane that is not negative."""
    y = x - x + x.real
    if lane >= 0:
        y = seeded(y, lane)
    return y
