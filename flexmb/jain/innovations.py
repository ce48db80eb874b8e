"""Innovations factorisation M = (1 + H Phi K) D (1 + H Phi K)' of trees, applied and inverted by recursion, O(N).

The factors are what `flexmb.jain.sweeps.inward` leaves: per body first the free wheels, then the modes (D_f), then the
hinge (D_R), each D = L L'. Prescribed speeds are held: their rows and columns of M are left out. With

    F = (1 + H Phi K) L

    innovations   y = F^-1 T      inward      (55)
    respond       x = F'^-1 y     outward     both together: M^-1 T, (56)
    excite        y = F' x        outward
    synthesise    T = F y         inward      both together: M x, (54)

F is the Cholesky factor of M in the order tip to base, of each body its wheels, modes, hinge speeds. T, y and x are
`applied`, `innovation` and `acceleration` of a response's speeds.
"""

from math import log, sqrt

from flexmb.hinges.catalogue import REVOLUTE
from flexmb.jain.explicit import force_to_parent
from flexmb.jain.kinematics import carried_acceleration, motion_column, store_origin_acceleration, velocity_sweep
from flexmb.jain.sweeps import SINGLE, inward
from flexmb.jain.wheels import wheel_forces
from flexmb.jit.kernel import helper
from flexmb.levels.body import body_inertia
from flexmb.spatial.spatial_vector import shift_force
from flexmb.spatial.vector import add, add3, axpy, cross, dot, mat3, scale, times, vec3


@helper
def factorise(c, w):
    """Factors of M at the configuration in w.q; False where a D is not positive definite, w.fault names the body."""
    for j in range(w.u.shape[0]):
        w.u[j] = 0.0
        w.speed[j].applied = 0.0
    velocity_sweep(c, w, False, False)
    for k in range(c.body.shape[0]):
        body_inertia(c, w, k)
        wheel_forces(c, w, k)
    return inward(c, w)


@helper
def clear(c, x):
    """No forces."""
    for k in range(c.body.shape[0]):
        clear_body(c, x, k)
    for j in range(x.speed.shape[0]):
        x.speed[j].applied = 0.0


@helper
def clear_body(c, x, k):
    """No forces on body k and its modes."""
    for i in range(6):
        x.body[k].force[i] = 0.0
    for n in range(c.body[k].modes):
        x.mode[k, n].zf = 0.0


@helper
def push(c, w, x, k, port, F):
    """Add a load [tau; f] at a port of body k, body axes: A [tau; f] with A = [Pi'; phi] of (14), (15)."""
    tau, f = F
    for n in range(c.body[k].modes):
        x.mode[k, n].zf -= dot(vec3(w.port_mode[port, n].W, 0), tau) + dot(vec3(w.port_mode[port, n].L, 0), f)
    tau, f = shift_force((tau, f), vec3(w.port[port].r, 0))
    add3(x.body[k].force, 0, scale(-1.0, tau))
    add3(x.body[k].force, 3, scale(-1.0, f))


@helper
def port_response(c, w, x, k, port):
    """Acceleration (alpha, a) of a port of body k that the forces cause, body axes."""
    alpha = vec3(x.body[k].accel, 0)
    a = add(vec3(x.body[k].accel, 3), cross(alpha, vec3(w.port[port].r, 0)))
    for n in range(c.body[k].modes):
        alpha = axpy(x.mode[k, n].etadd, vec3(w.port_mode[port, n].W, 0), alpha)
        a = axpy(x.mode[k, n].etadd, vec3(w.port_mode[port, n].L, 0), a)
    return alpha, a


@helper
def innovations(c, w, x):
    """z = Phi z^+, epsilon = T - H z, y = L^-1 epsilon, z^+ = z + G epsilon (55). Overwrites the forces in x."""
    for k in range(c.body.shape[0] - 1, -1, -1):
        for i in range(c.body[k].wheel_start, c.body[k].wheel_stop):
            j = c.wheel[i].u_index
            x.speed[j].innovation = 0.0
            if c.speed[j].prescribed < 0:
                x.speed[j].innovation = x.speed[j].applied / sqrt(c.wheel[i].axial)
                _turn_node(c, w, x, k, i, x.speed[j].applied)
        tau, f = _force_at_hinge(c, w, x, k)
        start = c.body[k].etad_index
        for n in range(c.body[k].modes):
            y = x.speed[start + n].applied - x.mode[k, n].zf
            for i in range(n):
                y -= w.pff[k, n, i] * x.speed[start + i].innovation
            y /= w.pff[k, n, n]
            x.speed[start + n].innovation = y
            tau = axpy(y, vec3(w.mode[k, n].pfr, 0), tau)
            f = axpy(y, vec3(w.mode[k, n].pfr, 3), f)
        tau, f = _hinge_innovations(c, w, x, k, tau, f)
        if c.body[k].parent >= 0:
            force_to_parent(c, w, x, k, (tau, f))


@helper
def respond(c, w, x):
    """alpha^+ = Phi' alpha, x = L'^-1 y - G' alpha^+, alpha = alpha^+ + H' x: the outward half of (56)."""
    for k in range(c.body.shape[0]):
        alpha, a = carried_acceleration(c, w, x, k)
        _hinge_response(c, w, x, k, alpha, a)
        alpha, a = _across_hinge(c, w, x, k, alpha, a)
        start, nm = c.body[k].etad_index, c.body[k].modes
        for n in range(nm - 1, -1, -1):
            y = x.speed[start + n].innovation - dot(vec3(w.mode[k, n].pfr, 0), alpha)
            y -= dot(vec3(w.mode[k, n].pfr, 3), a)
            for i in range(n + 1, nm):
                y -= w.pff[k, i, n] * x.mode[k, i].etadd
            x.mode[k, n].etadd = y / w.pff[k, n, n]
            x.speed[start + n].acceleration = x.mode[k, n].etadd
        store_origin_acceleration(c, w, x, k, (alpha, a))
        for i in range(c.body[k].wheel_start, c.body[k].wheel_stop):
            j = c.wheel[i].u_index
            x.speed[j].acceleration = 0.0
            if c.speed[j].prescribed < 0:
                along = _node_acceleration(c, w, x, k, i)
                x.speed[j].acceleration = x.speed[j].innovation / sqrt(c.wheel[i].axial) - along


@helper
def excite(c, w, x):
    """alpha^+ = Phi' alpha, y = L' (x + G' alpha^+), alpha = alpha^+ + H' x: what `respond` undoes."""
    for k in range(c.body.shape[0]):
        alpha, a = carried_acceleration(c, w, x, k)
        _hinge_excitation(c, w, x, k, alpha, a)
        alpha, a = _across_hinge(c, w, x, k, alpha, a)
        start, nm = c.body[k].etad_index, c.body[k].modes
        for n in range(nm):
            x.mode[k, n].etadd = x.speed[start + n].acceleration
            y = dot(vec3(w.mode[k, n].pfr, 0), alpha) + dot(vec3(w.mode[k, n].pfr, 3), a)
            for i in range(n, nm):
                y += w.pff[k, i, n] * x.speed[start + i].acceleration
            x.speed[start + n].innovation = y
        store_origin_acceleration(c, w, x, k, (alpha, a))
        for i in range(c.body[k].wheel_start, c.body[k].wheel_stop):
            j = c.wheel[i].u_index
            x.speed[j].innovation = 0.0
            if c.speed[j].prescribed < 0:
                along = _node_acceleration(c, w, x, k, i)
                x.speed[j].innovation = sqrt(c.wheel[i].axial) * (x.speed[j].acceleration + along)


@helper
def synthesise(c, w, x):
    """epsilon = L y, T = epsilon + H z, z^+ = z + G epsilon: what `innovations` undoes. x holds no other forces."""
    for k in range(c.body.shape[0] - 1, -1, -1):
        for i in range(c.body[k].wheel_start, c.body[k].wheel_stop):
            j = c.wheel[i].u_index
            x.speed[j].applied = 0.0
            if c.speed[j].prescribed < 0:
                x.speed[j].applied = sqrt(c.wheel[i].axial) * x.speed[j].innovation
                _turn_node(c, w, x, k, i, x.speed[j].applied)
        tau, f = _force_at_hinge(c, w, x, k)
        start = c.body[k].etad_index
        for n in range(c.body[k].modes):
            T = x.mode[k, n].zf
            for i in range(n + 1):
                T += w.pff[k, n, i] * x.speed[start + i].innovation
            x.speed[start + n].applied = T
            y = x.speed[start + n].innovation
            tau = axpy(y, vec3(w.mode[k, n].pfr, 0), tau)
            f = axpy(y, vec3(w.mode[k, n].pfr, 3), f)
        tau, f = _hinge_forces(c, w, x, k, tau, f)
        if c.body[k].parent >= 0:
            force_to_parent(c, w, x, k, (tau, f))


@helper
def log_determinant(c, w):
    """log det M = log det D, the other factors being unit triangular (54)."""
    total = 0.0
    for k in range(c.body.shape[0]):
        for i in range(c.body[k].wheel_start, c.body[k].wheel_stop):
            if c.speed[c.wheel[i].u_index].prescribed < 0:
                total += log(c.wheel[i].axial)
        for n in range(c.body[k].modes):
            total += 2.0 * log(w.pff[k, n, n])
        if w.body[k].free_count == SINGLE:
            total += log(w.body[k].hinge_factor[0, 0])
        for n in range(w.body[k].free_count):
            total += 2.0 * log(w.body[k].hinge_factor[n, n])
    return total


@helper
def _turn_node(c, w, x, k, i, torque):
    """z += G epsilon of wheel i: its torque about its axis, on the node that carries it."""
    port = c.wheel[i].port
    torque = scale(torque, times(mat3(w.port[port].R, 0), vec3(c.wheel[i].axis, 0)))
    add3(x.body[k].force, 0, torque)
    for n in range(c.body[k].modes):
        x.mode[k, n].zf += dot(vec3(w.port_mode[port, n].W, 0), torque)


@helper
def _node_acceleration(c, w, x, k, i):
    """q . alpha of the node that carries wheel i."""
    alpha, _ = port_response(c, w, x, k, c.wheel[i].port)
    return dot(times(mat3(w.port[c.wheel[i].port].R, 0), vec3(c.wheel[i].axis, 0)), alpha)


@helper
def _force_at_hinge(c, w, x, k):
    """z_r about O; where O is on a node that deforms, z_f - [Pi_d]' z_r stays for the modes (45)."""
    tau, f = vec3(x.body[k].force, 0), vec3(x.body[k].force, 3)
    i = c.body[k].outboard_port
    if i >= 0:
        tau, f = shift_force((tau, f), scale(-1.0, vec3(w.port[i].r, 0)))
        for n in range(c.body[k].modes):
            x.mode[k, n].zf -= dot(vec3(w.port_mode[i, n].W, 0), tau) + dot(vec3(w.port_mode[i, n].L, 0), f)
    return tau, f


@helper
def _hinge_innovations(c, w, x, k, tau, f):
    """y of the hinge; returns z^+."""
    j, free = c.body[k].u_index, w.body[k].free_count
    D, G = w.body[k].hinge_factor, w.body[k].hinge_gain
    if free == SINGLE:
        epsilon = x.speed[j].applied - (tau[2] if c.body[k].hinge_kind == REVOLUTE else f[2])
        x.speed[j].innovation = epsilon / sqrt(D[0, 0])
        return axpy(epsilon, vec3(G[0], 0), tau), axpy(epsilon, vec3(G[0], 3), f)
    for n in range(c.body[k].nv):
        x.speed[j + n].innovation = 0.0
    for n in range(free):
        angular, linear = motion_column(c, w, k, w.body[k].free_speed[n])
        y = x.speed[j + w.body[k].free_speed[n]].applied - dot(angular, tau) - dot(linear, f)
        for i in range(n):
            y -= D[n, i] * x.speed[j + w.body[k].free_speed[i]].innovation
        x.speed[j + w.body[k].free_speed[n]].innovation = y / D[n, n]
    return _gained(w, x, k, j, tau, f)


@helper
def _gained(w, x, k, j, tau, f):
    """z + G epsilon of a general hinge: G L = P H' L'^-1 is what is kept."""
    for n in range(w.body[k].free_count):
        y = x.speed[j + w.body[k].free_speed[n]].innovation
        tau = axpy(y, vec3(w.body[k].hinge_gain[n], 0), tau)
        f = axpy(y, vec3(w.body[k].hinge_gain[n], 3), f)
    return tau, f


@helper
def _hinge_response(c, w, x, k, alpha, a):
    """Accelerations of the hinge's speeds from its innovations and alpha^+."""
    j, free = c.body[k].u_index, w.body[k].free_count
    D, G = w.body[k].hinge_factor, w.body[k].hinge_gain
    if free == SINGLE:
        carried = dot(vec3(G[0], 0), alpha) + dot(vec3(G[0], 3), a)
        x.speed[j].acceleration = x.speed[j].innovation / sqrt(D[0, 0]) - carried
        return
    for n in range(c.body[k].nv):
        x.speed[j + n].acceleration = 0.0
    for n in range(free - 1, -1, -1):
        s = x.speed[j + w.body[k].free_speed[n]].innovation - dot(vec3(G[n], 0), alpha) - dot(vec3(G[n], 3), a)
        for i in range(n + 1, free):
            s -= D[i, n] * x.speed[j + w.body[k].free_speed[i]].acceleration
        x.speed[j + w.body[k].free_speed[n]].acceleration = s / D[n, n]


@helper
def _hinge_excitation(c, w, x, k, alpha, a):
    """Innovations of the hinge from the accelerations of its speeds and alpha^+."""
    j, free = c.body[k].u_index, w.body[k].free_count
    D, G = w.body[k].hinge_factor, w.body[k].hinge_gain
    if free == SINGLE:
        carried = dot(vec3(G[0], 0), alpha) + dot(vec3(G[0], 3), a)
        x.speed[j].innovation = sqrt(D[0, 0]) * (x.speed[j].acceleration + carried)
        return
    for n in range(free):
        y = dot(vec3(G[n], 0), alpha) + dot(vec3(G[n], 3), a)
        for i in range(n, free):
            y += D[i, n] * x.speed[j + w.body[k].free_speed[i]].acceleration
        x.speed[j + w.body[k].free_speed[n]].innovation = y


@helper
def _hinge_forces(c, w, x, k, tau, f):
    """T of the hinge from its innovations and z; returns z^+."""
    j, free = c.body[k].u_index, w.body[k].free_count
    D, G = w.body[k].hinge_factor, w.body[k].hinge_gain
    if free == SINGLE:
        epsilon = sqrt(D[0, 0]) * x.speed[j].innovation
        x.speed[j].applied = epsilon + (tau[2] if c.body[k].hinge_kind == REVOLUTE else f[2])
        return axpy(epsilon, vec3(G[0], 0), tau), axpy(epsilon, vec3(G[0], 3), f)
    for n in range(c.body[k].nv):
        x.speed[j + n].applied = 0.0
    for n in range(free):
        angular, linear = motion_column(c, w, k, w.body[k].free_speed[n])
        T = dot(angular, tau) + dot(linear, f)
        for i in range(n + 1):
            T += D[n, i] * x.speed[j + w.body[k].free_speed[i]].innovation
        x.speed[j + w.body[k].free_speed[n]].applied = T
    return _gained(w, x, k, j, tau, f)


@helper
def _across_hinge(c, w, x, k, alpha, a):
    """alpha^+ + H' x over the hinge's free speeds."""
    j, free = c.body[k].u_index, w.body[k].free_count
    if free == SINGLE:
        rate = x.speed[j].acceleration
        if c.body[k].hinge_kind == REVOLUTE:
            return (alpha[0], alpha[1], alpha[2] + rate), a
        return alpha, (a[0], a[1], a[2] + rate)
    for n in range(free):
        angular, linear = motion_column(c, w, k, w.body[k].free_speed[n])
        rate = x.speed[j + w.body[k].free_speed[n]].acceleration
        alpha = axpy(rate, angular, alpha)
        a = axpy(rate, linear, a)
    return alpha, a
