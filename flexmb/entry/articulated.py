"""Entry points of the compiled recursion: right-hand side, accelerations, and everything observable at one state."""

from flexmb.jain import inverse
from flexmb.jain.accelerations import acceleration_sweep
from flexmb.jain.balance import energy_and_momentum, power
from flexmb.jain.kinematics import pose_sweep, velocity_sweep
from flexmb.jain.loads import drive_loads, hinge_loads, wheel_load
from flexmb.jain.ports import port_acceleration, port_velocity
from flexmb.jain.sweeps import forward_dynamics
from flexmb.jit.kernel import helper, kernel
from flexmb.motion.coordinates import load_state, store_slope
from flexmb.spatial.vector import add, mat3, matmul, store3, store9, times, vec3
from flexmb.tables.status import OK


@kernel
def rhs(t, y, dy, c, w):
    """dy/dt of y = [q, u, work] at time t; returns a status code. `work` collects the non-conservative power."""
    load_state(t, y, c, w)
    status = forward_dynamics(c, w)
    if status != OK:
        return status
    drive_loads(c, w)
    store_slope(c, w, power(c, w), dy)
    return OK


@kernel
def accelerations(t, y, c, w):
    """udot into w.speed.acceleration; returns a status code."""
    load_state(t, y, c, w)
    return forward_dynamics(c, w)


@kernel
def inverse_dynamics(t, y, rates, c, w, tau, loads):
    """tau (nu,) = M rates + c: inertia, gravity, elasticity and node loads.

    loads (N,6): what each hinge then transmits, [torque; force] on the body about O, World axes.
    """
    load_state(t, y, c, w)
    for j in range(rates.shape[0]):
        w.speed[j].acceleration = rates[j]
    inverse.inverse_dynamics(c, w, tau)
    pose_sweep(c, w)
    world_loads(c, w, loads)


@kernel
def observe(t, y, marker_body, marker_port, c, w, markers, loads, wheel_loads, energy, momentum):
    """Everything observable at one state; w.speed is filled as well. Returns a status code.

    Loads are those of the model: a ruthless body shows them at its rest shape. loads (N,6) and wheel_loads (W,6):
    [torque; force] in World axes; markers, energy and momentum as in `observe_motion`.
    """
    load_state(t, y, c, w)
    status = forward_dynamics(c, w)
    if status != OK:
        return status
    drive_loads(c, w)
    pose_sweep(c, w)
    hinge_loads(c, w)
    world_loads(c, w, loads)
    _observe_motion(c, w, marker_body, marker_port, markers, wheel_loads, energy, momentum)
    return OK


@kernel
def observe_motion(t, y, rates, marker_body, marker_port, c, w, markers, wheel_loads, energy, momentum):
    """What follows from the state and given accelerations `rates` (nu,) by kinematics and bodies' own momentum.

    markers (K,24): position, R_World_marker (9), velocity (6), classical acceleration (6) in World axes, with the true
    deformation; wheel_loads (W,6); energy (4,), momentum (6,) as in flexmb.jain.balance.
    """
    load_state(t, y, c, w)
    for j in range(rates.shape[0]):
        w.speed[j].acceleration = rates[j]
    velocity_sweep(c, w, False, False)
    pose_sweep(c, w)
    acceleration_sweep(c, w)
    _observe_motion(c, w, marker_body, marker_port, markers, wheel_loads, energy, momentum)


@helper
def _observe_motion(c, w, marker_body, marker_port, markers, wheel_loads, energy, momentum):
    """Needs the velocity, pose and acceleration sweeps as the equations of motion see the state."""
    _world_wheel_loads(c, w, wheel_loads)
    velocity_sweep(c, w, False, True)
    energy_and_momentum(c, w, energy, momentum)
    velocity_sweep(c, w, True, True)
    pose_sweep(c, w)
    acceleration_sweep(c, w)
    for i in range(marker_port.shape[0]):
        k = marker_body[i]
        port = marker_port[i]
        R = mat3(w.body[k].pose_rotation, 0)
        omega, v = port_velocity(w, k, port)
        alpha, a = port_acceleration(c, w, k, port)
        store3(markers[i], 0, add(vec3(w.body[k].pose_position, 0), times(R, vec3(w.port[port].r, 0))))
        store9(markers[i], 3, matmul(R, mat3(w.port[port].R, 0)))
        store3(markers[i], 12, times(R, omega))
        store3(markers[i], 15, times(R, v))
        store3(markers[i], 18, times(R, alpha))
        store3(markers[i], 21, add(times(R, a), vec3(c.gravity, 0)))


@helper
def world_loads(c, w, loads):
    """w.body.load of every body in World axes."""
    for k in range(c.body.shape[0]):
        R = mat3(w.body[k].pose_rotation, 0)
        store3(loads[k], 0, times(R, vec3(w.body[k].load, 0)))
        store3(loads[k], 3, times(R, vec3(w.body[k].load, 3)))


@helper
def _world_wheel_loads(c, w, loads):
    """Loads on all wheels in World axes."""
    for k in range(c.body.shape[0]):
        R = mat3(w.body[k].pose_rotation, 0)
        for i in range(c.body[k].wheel_start, c.body[k].wheel_stop):
            tau, f = wheel_load(c, w, k, i)
            store3(loads[i], 0, times(R, tau))
            store3(loads[i], 3, times(R, f))
