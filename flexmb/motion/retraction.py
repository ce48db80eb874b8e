"""Retraction: coordinates after a finite motion at constant speeds, q o exp(increment), for Lie-group integrators.

The group is R3 x SO(3) of every free hinge: positions and velocities are added up in the axes of the inboard body,
which for a body that flies are World's, and rotations in those of the outboard one. Linear momentum is a sum of masses
times velocities in World. What is added up in axes that turn, on SE(3), leaves its direction with the error of the
step: Bruels, Cardona, Arnold, Mech. Mach. Theory 48 (2012), 121.
"""

from flexmb.hinges import catalogue
from flexmb.jit.features import has
from flexmb.jit.kernel import kernel, sweep
from flexmb.tables.features import QUATERNIONS


@kernel
def move(y, increment, result, c):
    """Write the coordinates of y after a unit of time at the constant speeds `increment` (nu,) to result.

    Quaternions are multiplied by the exact exponential of the rotation vector in outboard axes. The increment of a free
    hinge's position is in inboard axes.
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


@kernel
def resolve(y, u, x, how, c):
    """Resolve x (nu,) between the axes of speeds and those of increments at y, in place; how: see `flexmb.tables.axes`.

    u (nu,) are the speeds at y, which `RATES` needs: x are then their rates.
    """
    resolve_by(y, u, x, how, c)


@sweep
def resolve_by(y, u, x, how, c):
    """`resolve` as a part of other kernels."""
    if has(c, QUATERNIONS):
        for k in range(c.body.shape[0]):
            if c.body[k].quaternion >= 0:
                catalogue.resolve(c, c.body[k].hinge_kind, y, c.body[k].q_index, u, x, c.body[k].u_index, how)
