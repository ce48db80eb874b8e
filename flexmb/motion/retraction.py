"""Coordinates moved by finite increments of the speeds' motion, q o exp(increment): for methods on Lie groups."""

from flexmb.hinges import catalogue
from flexmb.jit.kernel import kernel


@kernel
def move(y, increment, result, c):
    """Coordinates of result = those of y moved for a unit of time at the constant speeds `increment` (nu,).

    Quaternions turn about carried axes by their exact exponential; the origin of a free hinge, whose velocity is held
    in turning axes, follows its screw motion.
    """
    for k in range(c.body.shape[0]):
        i, j = c.body[k].q_index, c.body[k].u_index
        if catalogue.quaternion_offset(c.body[k].hinge_kind) < 0:  # asking its kind would take an eighth of a step
            for n in range(c.body[k].nv):
                result[i + n] = y[i + n] + increment[j + n]
        else:
            catalogue.retract(c.body[k].hinge_kind, y, i, increment, j, result)
        for n in range(c.body[k].modes):
            i, j = c.body[k].eta_index + n, c.body[k].etad_index + n
            result[i] = y[i] + increment[j]
    for n in range(c.wheel.shape[0]):
        i, j = c.wheel[n].q_index, c.wheel[n].u_index
        result[i] = y[i] + increment[j]
