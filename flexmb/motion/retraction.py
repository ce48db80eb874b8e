"""Retraction: coordinates after a finite motion at constant speeds, q o exp(increment), for Lie-group integrators."""

from flexmb.hinges import catalogue
from flexmb.jit.features import has
from flexmb.jit.kernel import kernel, sweep
from flexmb.tables.features import QUATERNIONS


@kernel
def move(y, increment, result, c):
    """Write the coordinates of y after a unit of time at the constant speeds `increment` (nu,) to result.

    Quaternions are multiplied by the exact exponential of the rotation vector in outboard axes. The translation of a
    free hinge, whose velocity is constant in turning axes, follows the screw motion.
    """
    move_by(y, increment, result, c)


@sweep
def move_by(y, increment, result, c):
    """`move` as a part of other kernels."""
    for k in range(c.body.shape[0]):
        i, j = c.body[k].q_index, c.body[k].u_index
        if not has(c, QUATERNIONS) or c.body[k].quaternion < 0:
            for n in range(c.body[k].nv):
                result[i + n] = y[i + n] + increment[j + n]
        else:
            catalogue.retract(c, c.body[k].hinge_kind, y, i, increment, j, result)
        for n in range(c.body[k].modes):
            i, j = c.body[k].eta_index + n, c.body[k].etad_index + n
            result[i] = y[i] + increment[j]
    for n in range(c.wheel.shape[0]):
        i, j = c.wheel[n].q_index, c.wheel[n].u_index
        result[i] = y[i] + increment[j]
