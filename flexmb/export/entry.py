"""The functions that exported code consists of: they take states by address and length, tables as bundles."""

from flexmb.entry.articulated import slope
from flexmb.entry.observation import observe_bodies, observe_free_motion
from flexmb.jit.objects import reals_at
from flexmb.motion.coordinates import put_back
from flexmb.tables.status import OK


def rates(t, y, dy, count, c, w):
    """dy/dt to dy (count,) of the state y (count,) = [q, u, work] at time t (s); returns a status code."""
    return slope(t, reals_at(y, count), reals_at(dy, count), c, w)


def outputs(t, y, dy, count, c, w, out):
    """The same, with everything observable in the arrays of `out`."""
    status = slope(t, reals_at(y, count), reals_at(dy, count), c, w)
    if status != OK:
        return status
    observe_free_motion(c, w, out)
    observe_bodies(c, w, out)
    return OK


def settle(t, y, count, c):
    """Give quaternions in y (count,) unit length, prescribed coordinates and speeds the values of their functions."""
    put_back(t, reals_at(y, count), c)
    return OK
