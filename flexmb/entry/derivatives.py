"""Derivatives of accelerations and of inverse dynamics by displacements, speeds and forces: O(N depth), then a solution.

    d = derivatives(system.constants, system.nq, system.nu)
    w = workspace(system.constants, system.nq, system.nu)
    status = acceleration_derivatives(t, y, c, w, d, by_displacement, by_speed, by_force)

`flexmb.entry.tangent` has the same derivatives by dual numbers, one direction after the other. The constants must be
those of the system (`System.constants`), as there.
"""

from __future__ import annotations

from flexmb.jain.derivatives import sweeps
from flexmb.jain.kinematics import velocity_sweep
from flexmb.jain.sweeps import forward_dynamics
from flexmb.jit.kernel import helper, kernel
from flexmb.motion.coordinates import load_state
from flexmb.tables.status import OK


@kernel
def acceleration_derivatives(t, y, c, w, d, by_displacement, by_speed, by_force):
    """Derivatives (nu,nu) of udot at y = [q, u, work] by displacement, speed and force; returns a status code.

    Displacements are along the speeds, see `flexmb.linear.variations`. What is prescribed has rows of zeros.
    """
    load_state(t, y, c, w)
    status = forward_dynamics(c, w)
    if status != OK:
        return status
    sweeps.accelerations(c, w, d)
    _copy(d, 0, by_displacement)
    _copy(d, 1, by_speed)
    _copy(d, 2, by_force)
    return OK


@kernel
def inverse_dynamics_derivatives(t, y, rates, c, w, d, by_displacement, by_speed, by_acceleration):
    """Derivatives (nu,nu) of tau = M rates + c by displacement, speed and acceleration, the last of which is M."""
    load_state(t, y, c, w)
    for j in range(rates.shape[0]):
        w.speed[j].acceleration = rates[j]
    velocity_sweep(c, w, False, False)
    sweeps.inverse_dynamics(c, w, d, True)
    _copy(d, 0, by_displacement)
    _copy(d, 1, by_speed)
    _copy(d, 2, by_acceleration)


@helper
def _copy(d, third, out):
    """One third of the columns of `matrix` to out (nu,nu), in the order of u."""
    nu = out.shape[0]
    if d.shape[1]:
        for i in range(nu):
            row = d.matrix[i]
            for j in range(nu):
                out[i, j] = row[third * nu + j]
    else:
        for i in range(nu):
            row = d.matrix[d.place[i]]
            for j in range(nu):
                out[i, j] = row[third * nu + d.place[j]]
