"""Wheels and node loads: what they add at their ports, and the rows and columns of the wheels.

A wheel with the spin h = I thetad q acts on its node with the torque I thetadd q + w x h, which changes by s1 x h with
the node's angular velocity. Its own row is that of I (thetadd + q . alpha). A load F that keeps its direction in World
turns against the body, if that turns by x: it changes by -(x x F) in the body's axes.
"""

from flexmb.jain.derivatives.columns import inboard_columns
from flexmb.jain.derivatives.rows import BY_RATES, BY_SPEED, put_force
from flexmb.jain.derivatives.tables import BY_ACCELERATION, BY_RATE, MOTION, SPEED_BY_ACCELERATION
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, sweep
from flexmb.levels.body import is_at_rest
from flexmb.spatial.rows import column3
from flexmb.spatial.spatial_vector import ZERO6, add6
from flexmb.spatial.vector import add, add3, cross, dot, mat3, matmul, scale, times, vec3
from flexmb.tables.arrays import FORCE, WORLD_AXES
from flexmb.tables.features import LOADS, WHEELS


@sweep
def attach(c, w, d, k):
    """Forces of the wheels and loads of body k at their ports, and how they change."""
    if has(c, LOADS):
        for i in range(c.body[k].load_start, c.body[k].load_stop):
            _attach_load(c, w, d, k, i)
    if has(c, WHEELS):
        for i in range(c.body[k].wheel_start, c.body[k].wheel_stop):
            _attach_wheel(c, w, d, k, i)


@helper
def _attach_load(c, w, d, k, i):
    """The force of a load counts as one of inertia: with the opposite sign."""
    port = c.load[i].port
    zero, r = (0.0, 0.0, 0.0), vec3(d.port[port].position, 0)
    load = scale(-w.function[c.load[i].function, 0], vec3(c.load[i].direction, 0))
    in_world = c.load[i].frame == WORLD_AXES
    if not in_world:
        load = times(_port_rotation(w, d, k, port), load)
    torque, force = (zero, load) if c.load[i].type == FORCE else (load, zero)
    if in_world:
        add_world_load(d, port, (torque, force))
    else:
        add6(d.port[port].force, 0, (add(torque, cross(r, force)), force))


@helper
def add_world_load(d, port, F):
    """Add a force about the point of a port that keeps its components in World, with the sign of inertia."""
    r, (torque, force) = vec3(d.port[port].position, 0), F
    add6(d.port[port].force, 0, (add(torque, cross(r, force)), force))
    for j in range(3):
        x = (1.0 if j == 0 else 0.0, 1.0 if j == 1 else 0.0, 1.0 if j == 2 else 0.0)
        change = cross(force, x)
        moment = add(cross(torque, x), cross(r, change))
        for n in range(3):
            d.port[port].by_turn[3 * n + j] += moment[n]
            d.port[port].by_turn[9 + 3 * n + j] += change[n]


@helper
def _attach_wheel(c, w, d, k, i):
    port, j = c.wheel[i].port, c.wheel[i].u_index
    axis, omega = wheel_axis(c, w, d, k, i), vec3(d.port[port].velocity, 0)
    h = scale(c.wheel[i].axial * w.u[j], axis)
    torque = add(scale(c.wheel[i].axial * w.speed[j].acceleration, axis), cross(omega, h))
    add3(d.port[port].force, 0, torque)
    D = d.port[port].by_rate
    D[1] += h[2]
    D[2] -= h[1]
    D[3] -= h[2]
    D[5] += h[0]
    D[6] += h[1]
    D[7] -= h[0]


@helper
def _port_rotation(w, d, k, port):
    """R_World_port."""
    return matmul(mat3(d.body[k].rotation, 0), mat3(w.port[port].R, 0))


@helper
def wheel_axis(c, w, d, k, i):
    """Axis of wheel i, World axes."""
    return times(_port_rotation(w, d, k, c.wheel[i].port), vec3(c.wheel[i].axis, 0))


@sweep
def wheel_rows(c, w, d, k, masses):
    """Rows and columns of the wheels of body k."""
    nu, zero = d.speed.shape[0], (0.0, 0.0, 0.0)
    for i in range(c.body[k].wheel_start, c.body[k].wheel_stop):
        place = d.places[k].wheels + i - c.body[k].wheel_start
        port, axial = c.wheel[i].port, c.wheel[i].axial
        l2 = scale(axial, wheel_axis(c, w, d, k, i))
        l1 = cross(vec3(d.port[port].velocity, 0), l2)
        put_force(d, 0, place, ZERO6)
        put_force(d, BY_SPEED, place, (l1, zero))
        put_force(d, BY_RATES, place, (l2, zero))
        for n in range(c.body[k].modes):
            _with_mode(c, d, k, place, port, n, l2, l1)
        inboard_columns(c, d, place, (d.places[k].run, d.places[k].end), ((l2, zero), l1, zero), masses)
        d.matrix[place, 2 * nu + place] = axial


@helper
def _with_mode(c, d, k, place, port, n, l2, l1):
    """Row of a wheel in the columns of mode n, and the other way round."""
    own, nu, mode, frame = d.places[k].modes + n, d.speed.shape[0], d.port_mode[port], d.frame_mode[k]
    # angular parts; the frame's are zero unless the modes move O in the body
    J = add(column3(mode, MOTION, n), column3(frame, MOTION, n))
    s1 = add(column3(mode, BY_RATE, n), column3(frame, BY_RATE, n))
    s2 = add(column3(mode, BY_ACCELERATION, n), column3(frame, BY_ACCELERATION, n))
    s2_speed = add(column3(mode, SPEED_BY_ACCELERATION, n), column3(frame, SPEED_BY_ACCELERATION, n))
    d.matrix[own, nu + place] = dot(J, l1)
    d.matrix[own, 2 * nu + place] = d.matrix[place, 2 * nu + own] = dot(J, l2)
    if not is_at_rest(c.body[k].level):
        d.matrix[place, own] = dot(l2, s2) + dot(l1, s1)
        d.matrix[place, nu + own] = dot(l2, s2_speed) + dot(l1, J)
