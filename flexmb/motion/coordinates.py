"""Coordinates and speeds: taken from the integrator's vector, their rates, and the forces of springs and motors.

The recursion and Frisch's equations share this module.
"""

from flexmb.connectors.along_hinges import add_loads_along_hinges, power_along_hinges
from flexmb.hinges import catalogue
from flexmb.jit.duals import nonzero
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, kernel, sweep
from flexmb.jit.lanes import some
from flexmb.spatial.rotation import rotation_vector
from flexmb.spatial.scalar import sqrt
from flexmb.tables.features import (
    BALL_SPRINGS,
    COORDINATE_LAWS,
    DAMPERS,
    FUNCTIONS,
    HINGE_SPRINGS,
    MODES,
    MOTORS,
    PRESCRIBED,
    QUATERNIONS,
    SPRINGS,
    WHEELS,
)
from flexmb.tables.functions import evaluate


@helper
def load_state(t, y, c, w):
    """Set w.q and w.u from y = [q, u, ...], and the functions of time at t.

    Prescribed coordinates and speeds take the values of their functions, and quaternions are normalised, so that the
    drift of an integrator in either does not enter the forces.
    """
    nq = w.q.shape[0]
    for i in range(nq):
        w.q[i] = y[i]
    for j in range(w.u.shape[0]):
        w.u[j] = y[nq + j]
    if has(c, FUNCTIONS):
        evaluate_functions(t, c, w)
    if has(c, PRESCRIBED):
        for j in range(w.u.shape[0]):
            f = c.speed[j].prescribed
            if f >= 0:
                w.q[c.speed[j].coordinate] = w.function[f, 0]
                w.u[j] = w.function[f, 1]
    if has(c, QUATERNIONS):
        for i in range(nq):
            w.raw[i] = y[i]
        normalise_quaternions(w.q, c)


@helper
def evaluate_functions(t, c, w):
    """Write the values, rates and accelerations of all functions of time to w.function."""
    for f in range(c.function.shape[0]):
        value, rate, acceleration = evaluate(
            c.function[f].kind, c.function[f].data, c.function[f].start, c.function[f].stop, c.table, t
        )
        w.function[f, 0] = value
        w.function[f, 1] = rate
        w.function[f, 2] = acceleration


@helper
def normalise_quaternions(q, c):
    """Scale every hinge quaternion in q to unit length."""
    for k in range(c.body.shape[0]):
        i = c.body[k].quaternion
        if i >= 0:
            s = 1.0 / sqrt(q[i] * q[i] + q[i + 1] * q[i + 1] + q[i + 2] * q[i + 2] + q[i + 3] * q[i + 3])
            for n in range(4):
                q[i + n] *= s


@kernel
def project(t, y, c):
    """Project y to the configuration manifold: unit quaternions, prescribed coordinates and speeds as given."""
    put_back(t, y, c)


@sweep
def put_back(t, y, c):
    """`project` as a part of other kernels."""
    if has(c, QUATERNIONS):
        normalise_quaternions(y, c)
    if has(c, PRESCRIBED):
        _prescribe(t, y, c)


@helper
def _prescribe(t, y, c):
    """Set prescribed coordinates and speeds in y to the values and rates of their functions."""
    nu = c.speed.shape[0]
    nq = y.shape[0] - nu - 1
    for j in range(nu):
        f = c.speed[j].prescribed
        if f >= 0:
            value, rate, _ = evaluate(
                c.function[f].kind, c.function[f].data, c.function[f].start, c.function[f].stop, c.table, t
            )
            y[c.speed[j].coordinate] = value
            y[nq + j] = rate


@helper
def configuration_rate(c, w, rate):
    """Write qdot(q, u) to `rate`; quaternions are not normalised, so that their norm is an invariant of the flow."""
    for k in range(c.body.shape[0]):
        catalogue.rate(c, c.body[k].hinge_kind, w.raw, c.body[k].q_index, w.u, c.body[k].u_index, rate)
        if has(c, MODES):
            for n in range(c.body[k].modes):
                rate[c.body[k].eta_index + n] = w.u[c.body[k].etad_index + n]
    if has(c, WHEELS):
        for i in range(c.wheel.shape[0]):
            rate[c.wheel[i].q_index] = w.u[c.wheel[i].u_index]


@helper
def store_slope(c, w, power, dy):
    """dy/dt of y = [q, u, work]: the rates of q and u, and the power, whose integral is `work`."""
    configuration_rate(c, w, dy)
    nq, nu = w.q.shape[0], w.u.shape[0]
    for j in range(nu):
        dy[nq + j] = w.speed[j].acceleration
    dy[nq + nu] = power


@helper
def hinge_forces(c, w):
    """Write the forces of springs, dampers, friction and motors of hinges and wheels to w.speed.applied."""
    if not (
        has(c, DAMPERS) or has(c, SPRINGS) or has(c, MOTORS) or has(c, BALL_SPRINGS)
        or has(c, HINGE_SPRINGS) or has(c, COORDINATE_LAWS)
    ):  # fmt: skip
        return  # the workspace was made with zeros
    for j in range(w.u.shape[0]):
        force = 0.0
        if has(c, DAMPERS):
            force -= c.speed[j].damping * w.u[j]
        if has(c, SPRINGS):
            i = c.speed[j].coordinate
            if i >= 0:
                force -= c.speed[j].stiffness * (w.q[i] - c.speed[j].rest)
        if has(c, MOTORS):
            f = c.speed[j].motor
            if f >= 0:
                force += w.function[f, 0]
        w.speed[j].applied = force
    if has(c, BALL_SPRINGS):
        _ball_springs(c, w)
    if has(c, HINGE_SPRINGS) or has(c, COORDINATE_LAWS):
        add_loads_along_hinges(c, w)


@helper
def _ball_springs(c, w):
    """Subtract the torques of the isotropic springs of spherical hinges from w.speed.applied."""
    for k in range(c.body.shape[0]):
        if some(nonzero(c.body[k].ball_spring)):
            i = c.body[k].q_index
            theta = rotation_vector(w.q[i], w.q[i + 1], w.q[i + 2], w.q[i + 3])
            for n in range(3):
                w.speed[c.body[k].u_index + n].applied -= c.body[k].ball_spring * theta[n]


@helper
def speed_power(c, w):
    """Power in W of all dampers, motors, drives and friction along the speeds."""
    total = 0.0
    for j in range(w.u.shape[0]):
        rate = w.u[j]
        if has(c, DAMPERS):
            total -= c.speed[j].damping * rate * rate
        if has(c, MOTORS):
            f = c.speed[j].motor
            if f >= 0:
                total += w.function[f, 0] * rate
        if has(c, PRESCRIBED) and c.speed[j].prescribed >= 0:
            total += w.speed[j].drive * rate
    if has(c, HINGE_SPRINGS) or has(c, COORDINATE_LAWS):
        total += power_along_hinges(c, w)
    return total
