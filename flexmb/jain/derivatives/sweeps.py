"""Derivatives of M udot + b - T for known accelerations, and from them those of the accelerations."""

from flexmb.jain.derivatives.applied import subtract_applied
from flexmb.jain.derivatives.bodies import own_force
from flexmb.jain.derivatives.motion import move
from flexmb.jain.derivatives.rows import inward
from flexmb.jain.derivatives.solve import solve
from flexmb.jit.kernel import kernel


@kernel
def inverse_dynamics(c, w, d, masses):
    """Derivatives of M udot + b to `matrix`, in the order of places; M beside them if `masses`.

    Needs poses and rotations in w, and udot in w.speed.acceleration.
    """
    for i in range(d.matrix.shape[0]):
        row = d.matrix[i]
        for j in range(3 * d.matrix.shape[0]):
            row[j] = 0.0
    for k in range(c.body.shape[0]):
        move(c, w, d, k)
        own_force(c, w, d, k)
    for k in range(c.body.shape[0] - 1, -1, -1):
        inward(c, w, d, k, masses)


@kernel
def accelerations(c, w, d):
    """Derivatives of udot by displacement, speed and force to `matrix`, after forward dynamics in w."""
    inverse_dynamics(c, w, d, False)
    subtract_applied(c, w, d)
    nu = w.u.shape[0]
    for place in range(nu):
        d.matrix[place, 2 * nu + place] = -1.0
    solve(c, w, d, 3 * nu)
