"""Derivatives of accelerations and of inverse dynamics by displacements, speeds and forces, by recursion: O(N depth).

    w = derivative_workspace(system.constants, system.nq, system.nu)
    status = acceleration_derivatives(t, y, by_displacement, by_speed, by_force, system.constants, w)

`flexmb.entry.tangent` has the same derivatives by dual numbers, one direction after the other. The constants must be
those of the system (`System.constants`), as there.
"""

from __future__ import annotations

from flexmb.hinges import catalogue
from flexmb.jain.derivatives import sweeps
from flexmb.jain.derivatives.applied import subtract_applied
from flexmb.jain.derivatives.tables import ALIKE, IN_ORDER, Derivatives, derivatives
from flexmb.jain.kinematics import pose_sweep, velocity_sweep
from flexmb.jain.sweeps import forward_dynamics
from flexmb.jit.bundle import bundle
from flexmb.jit.duals import rate, seeded
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, kernel
from flexmb.motion.coordinates import load_state
from flexmb.spatial.rotation import quaternion_matrix
from flexmb.tables.arrays import Constants, Workspace
from flexmb.tables.features import CONNECTORS, MODES, PRESCRIBED, QUATERNIONS, WHEELS
from flexmb.tables.status import OK
from flexmb.tables.workspaces import workspace
from flexmb.typing import Index


@bundle
class DerivativeWorkspace:
    """The arrays that an evaluation with derivatives writes; one per thread."""

    sweeps: Workspace
    tables: Derivatives

    @property
    def fault(self) -> Index:
        """(1,) body where an evaluation failed."""
        return self.sweeps.fault

    @property
    def doubt(self) -> Index:
        """(1,) whether an evaluation met a pivot that may consist of rounding errors."""
        return self.sweeps.doubt


def derivative_workspace(c: Constants, nq: int, nu: int) -> DerivativeWorkspace:
    """A workspace of the right sizes."""
    return DerivativeWorkspace(workspace(c, nq, nu), derivatives(c, nq, nu))


@kernel
def acceleration_derivatives(t, y, by_displacement, by_speed, by_force, c, w):
    """Derivatives (nu,nu) of udot at y = [q, u, work] by displacement, speed and force; returns a status code.

    Displacements are along the speeds, see `flexmb.linear.variations`. What is prescribed has rows and columns of
    zeros: it is given as a function of time.
    """
    load_state(t, y, c, w.sweeps)
    status = forward_dynamics(c, w.sweeps)
    if status != OK:
        return status
    sweeps.accelerations(c, w.sweeps, w.tables)
    copy_third(w.tables, 0, by_displacement)
    copy_third(w.tables, 1, by_speed)
    copy_third(w.tables, 2, by_force)
    if has(c, PRESCRIBED):
        for j in range(c.speed.shape[0]):
            if c.speed[j].prescribed >= 0:
                for i in range(c.speed.shape[0]):
                    by_displacement[i, j] = by_speed[i, j] = by_force[i, j] = 0.0
    return OK


@kernel
def inverse_dynamics_derivatives(t, y, rates, by_displacement, by_speed, by_acceleration, c, w):
    """Derivatives (nu,nu) of tau = M rates + c, as `articulated.inverse_dynamics` has it; the last of them is M.

    Here rows and columns of what is prescribed are those of a free coordinate at its place.
    """
    load_state(t, y, c, w.sweeps)
    for j in range(rates.shape[0]):
        w.sweeps.speed[j].acceleration = rates[j]
    velocity_sweep(c, w.sweeps, False, False)
    if has(c, CONNECTORS):
        pose_sweep(c, w.sweeps)
    sweeps.inverse_dynamics(c, w.sweeps, w.tables, True)
    copy_third(w.tables, 0, by_displacement)
    copy_third(w.tables, 1, by_speed)
    copy_third(w.tables, 2, by_acceleration)


@kernel
def stiffness_and_mass(t, y, rates, stiffness, mass, c, w):
    """udot (nu,) at y = [q, u, work], the tangent stiffness (nu,nu) and M; returns a status code.

    The stiffness is how b - T changes by displacements while only what is prescribed accelerates. Rows and columns of
    what is prescribed are as of `inverse_dynamics_derivatives`.
    """
    load_state(t, y, c, w.sweeps)
    status = forward_dynamics(c, w.sweeps)
    if status == OK:
        for j in range(rates.shape[0]):
            rates[j] = w.sweeps.speed[j].acceleration
        sweeps.stop(c, w.sweeps)
        sweeps.inverse_dynamics(c, w.sweeps, w.tables, True)
        subtract_applied(c, w.sweeps, w.tables)
        copy_third(w.tables, 0, stiffness)
        copy_third(w.tables, 2, mass)
    return status


@helper
def copy_third(d, third, out):
    """One third of the columns of `matrix` to out (nu,nu), in the order of u."""
    nu = out.shape[0]
    if d.shape[IN_ORDER]:
        for i in range(nu):
            row = d.matrix[i]
            for j in range(nu):
                out[i, j] = row[third * nu + j]
    else:
        for i in range(nu):
            row = d.matrix[d.place[i]]
            for j in range(nu):
                out[i, j] = row[third * nu + d.place[j]]


@kernel
def jacobian(t, y, J, c, w):
    """J (n,n) = d(dy/dt)/dy at y = [q, u, work] (n,), row by row as `rhs` orders them; returns a status code."""
    load_state(t, y, c, w.sweeps)
    status = forward_dynamics(c, w.sweeps)
    if status == OK:
        sweeps.accelerations_and_power(c, w.sweeps, w.tables)
        store_jacobian(c, w, J)
    return status


@helper
def store_jacobian(c, w, J):
    """J as `jacobian` has it from what `accelerations_and_power` has left in w."""
    n, nq, nu = J.shape[0], w.sweeps.q.shape[0], w.sweeps.u.shape[0]
    for i in range(nq):
        for j in range(n):
            J[i, j] = 0.0
    for i in range(nu):
        row = w.tables.matrix[w.tables.place[i]]
        by_coordinates(c, w, row, J[nq + i], nq)
    by_coordinates(c, w, w.tables.work, J[n - 1], nq)
    for k in range(c.body.shape[0]):
        _coordinates(c, w, k, J, nq)
    if has(c, WHEELS):
        for i in range(c.wheel.shape[0]):
            J[c.wheel[i].q_index, nq + c.wheel[i].u_index] = 1.0
    if has(c, PRESCRIBED):
        for j in range(nu):
            if c.speed[j].prescribed >= 0:
                _hold(J, c.speed[j].coordinate, n)
                _hold(J, nq + j, n)


@helper
def _hold(J, i, n):
    """Row and column i are zero."""
    for j in range(n):
        J[i, j] = J[j, i] = 0.0


@helper
def by_coordinates(c, w, row, out, nq):
    """The derivatives by displacements and speeds in `row`, by coordinates and speeds in the order of y to `out`."""
    d, nu = w.tables, w.sweeps.u.shape[0]
    out[nq + nu] = 0.0
    if d.shape[ALIKE]:
        for j in range(2 * nu):
            out[j] = row[j]
        return
    for j in range(nu):
        out[nq + j] = row[nu + d.place[j]]
    for k in range(c.body.shape[0]):
        i, place = c.body[k].q_index, d.places[k].hinge
        if has(c, QUATERNIONS) and c.body[k].quaternion >= 0:
            _by_quaternion(c, w, k, row, out)
        else:
            for n in range(c.body[k].nv):
                out[i + n] = row[place + n]
        if has(c, MODES):
            for n in range(c.body[k].modes):
                out[c.body[k].eta_index + n] = row[d.places[k].modes + n]
    if has(c, WHEELS):
        for i in range(c.wheel.shape[0]):
            out[c.wheel[i].q_index] = row[d.place[c.wheel[i].u_index]]


@helper
def _by_quaternion(c, w, k, row, out):
    """By the coordinates of a free or spherical hinge: xi = 2 vec(q* dq) / |q| for q of any length, and R' dx."""
    q, raw, i, place = w.sweeps.q, w.sweeps.raw, c.body[k].quaternion, w.tables.places[k].hinge
    length2 = raw[i] * raw[i] + raw[i + 1] * raw[i + 1] + raw[i + 2] * raw[i + 2] + raw[i + 3] * raw[i + 3]
    s, x, y, z = (
        2.0 * raw[i] / length2, 2.0 * raw[i + 1] / length2, 2.0 * raw[i + 2] / length2, 2.0 * raw[i + 3] / length2,
    )  # fmt: skip
    a, b, e = row[place], row[place + 1], row[place + 2]
    out[i] = -(a * x + b * y + e * z)
    out[i + 1] = a * s - b * z + e * y
    out[i + 2] = a * z + b * s - e * x
    out[i + 3] = -a * y + b * x + e * s
    first = c.body[k].q_index
    if i > first:
        R = quaternion_matrix(q[i], q[i + 1], q[i + 2], q[i + 3])
        a, b, e = row[place + 3], row[place + 4], row[place + 5]
        for n in range(3):
            out[first + n] = R[3 * n] * a + R[3 * n + 1] * b + R[3 * n + 2] * e


@helper
def _coordinates(c, w, k, J, nq):
    """Rows of the rates of the coordinates of body k."""
    i, j = c.body[k].q_index, c.body[k].u_index
    if has(c, QUATERNIONS) and c.body[k].quaternion >= 0:
        rates_of_quaternion(c, w, k, J, nq)
    else:
        for n in range(c.body[k].nv):
            J[i + n, nq + j + n] = 1.0
    if has(c, MODES):
        for n in range(c.body[k].modes):
            J[c.body[k].eta_index + n, nq + c.body[k].etad_index + n] = 1.0


@helper
def rates_of_quaternion(c, w, k, J, nq):
    """The hinge's own function of its coordinates, not normalised, and its speeds by dual numbers."""
    e, i, j, nv = w.tables.duals, c.body[k].q_index, c.body[k].u_index, c.body[k].nv
    for speeds in range(2):
        for n in range(nv + 1):
            e.q[i + n] = w.sweeps.raw[i + n]
            if speeds == 0:
                e.q[i + n] = seeded(e.q[i + n], n)
        for n in range(nv):
            e.u[j + n] = w.sweeps.u[j + n]
            if speeds == 1:
                e.u[j + n] = seeded(e.u[j + n], n)
        catalogue.rate(c, c.body[k].hinge_kind, e.q, i, e.u, j, e.rate)
        for m in range(nv + 1):
            for n in range(nv if speeds == 1 else nv + 1):
                J[i + m, nq + j + n if speeds == 1 else i + n] = rate(e.rate[i + m], n)
