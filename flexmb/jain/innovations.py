"""Innovations factorisation M = (1 + H Phi K) D (1 + H Phi K)' of trees, applied and inverted by recursion, O(N).

The factors are what `flexmb.jain.sweeps.inward` leaves: per body first the free wheels, then the modes (D_f), then the
hinge (D_R), each D = L L'; of modes L is that of `flexmb.jain.explicit` times the roots of the pivots. Prescribed
speeds are held: their rows and columns of M are left out. With

    F = (1 + H Phi K) L

    innovations   y = F^-1 T      inward      (55)
    respond       x = F'^-1 y     outward     both together: M^-1 T, (56)
    excite        y = F' x        outward
    synthesise    T = F y         inward      both together: M x, (54)

F is the Cholesky factor of M in the order tip to base, of each body its wheels, modes, hinge speeds. T, y and x are
`speed` of a response, each in place of what it is made from. The first takes the response's forces on bodies and modes
as well: F^-1 (T - H Phi z).
"""

from math import log, sqrt

from flexmb.jain import hinge_solve
from flexmb.jain.accelerations import carried_acceleration, store_origin_acceleration
from flexmb.jain.explicit import LOAD, force_to_parent
from flexmb.jain.forces import add_port_torque
from flexmb.jain.kinematics import motion_column, velocity_sweep
from flexmb.jain.ports import mode_motion
from flexmb.jain.response import port_response
from flexmb.jain.sweeps import inward
from flexmb.jain.wheels import spin_axis, wheel_forces
from flexmb.jit.kernel import helper
from flexmb.levels.body import body_inertia
from flexmb.spatial.spatial_vector import axpy6, dot6, less6, shift_force, store6, vec6
from flexmb.spatial.vector import dot, scale, vec3


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
def innovations(c, w, x):
    """z = Phi z^+, epsilon = T - H z, y = L^-1 epsilon in place of T, z^+ = z + G epsilon (55); uses up the forces."""
    for k in range(c.body.shape[0] - 1, -1, -1):
        innovate(c, w, x, k)


@helper
def innovate(c, w, x, k):
    """What (55) does at body k; x.body[k].force then holds z_R, the force about O that the modes have left."""
    for i in range(c.body[k].wheel_start, c.body[k].wheel_stop):
        j = c.wheel[i].u_index
        if c.speed[j].prescribed < 0:
            _turn_node(c, w, x, k, i, x.speed[j])
            x.speed[j] /= sqrt(c.wheel[i].axial)
        else:
            x.speed[j] = 0.0
    z = _force_at_hinge(c, w, x, k)
    start = c.body[k].etad_index
    for n in range(c.body[k].modes):
        epsilon = x.speed[start + n] - x.zf[k, n]
        for i in range(n):
            epsilon -= w.pff[k, i, n] * x.speed[start + i]
        x.speed[start + n] = w.inverse_pivot[k, n] * epsilon
        z = axpy6(x.speed[start + n], vec6(w.pfr[k, n], 0), z)
    for n in range(c.body[k].modes):
        x.speed[start + n] *= sqrt(w.pff[k, n, n])
    store6(x.body[k].force, 0, z)
    z = hinge_solve.innovate(c, w, x, k, z)
    if c.body[k].parent >= 0:
        force_to_parent(c, w, x, k, z)


@helper
def respond(c, w, x):
    """alpha^+ = Phi' alpha, x = L'^-1 y - G' alpha^+ in place of y, alpha = alpha^+ + H' x: outward half of (56)."""
    for k in range(c.body.shape[0]):
        A = hinge_solve.solve(c, w, x, k, carried_acceleration(c, w, x, k))
        start, nm = c.body[k].etad_index, c.body[k].modes
        for n in range(nm - 1, -1, -1):
            rate = less6(x.speed[start + n] * sqrt(w.pff[k, n, n]), vec6(w.pfr[k, n], 0), A)
            for i in range(n + 1, nm):
                rate -= w.pff[k, n, i] * x.etadd[k, i]
            x.etadd[k, n] = w.inverse_pivot[k, n] * rate
            x.speed[start + n] = x.etadd[k, n]
        store_origin_acceleration(c, w, x, k, A)
        for i in range(c.body[k].wheel_start, c.body[k].wheel_stop):
            j = c.wheel[i].u_index
            if c.speed[j].prescribed < 0:
                x.speed[j] = x.speed[j] / sqrt(c.wheel[i].axial) - _node_acceleration(c, w, x, k, i)
            else:
                x.speed[j] = 0.0


@helper
def excite(c, w, x):
    """alpha^+ = Phi' alpha, y = L' (x + G' alpha^+) in place of x, alpha = alpha^+ + H' x: what `respond` undoes."""
    for k in range(c.body.shape[0]):
        A = hinge_solve.excite(c, w, x, k, carried_acceleration(c, w, x, k))
        start, nm = c.body[k].etad_index, c.body[k].modes
        for n in range(nm):
            x.etadd[k, n] = x.speed[start + n]
            total = dot6(vec6(w.pfr[k, n], 0), A)
            for i in range(n, nm):
                total += w.pff[k, n, i] * x.speed[start + i]
            x.speed[start + n] = total / sqrt(w.pff[k, n, n])
        store_origin_acceleration(c, w, x, k, A)
        for i in range(c.body[k].wheel_start, c.body[k].wheel_stop):
            j = c.wheel[i].u_index
            if c.speed[j].prescribed < 0:
                x.speed[j] = sqrt(c.wheel[i].axial) * (x.speed[j] + _node_acceleration(c, w, x, k, i))
            else:
                x.speed[j] = 0.0


@helper
def synthesise(c, w, x):
    """epsilon = L y, T = epsilon + H z in place of y, z^+ = z + G epsilon: undoes `innovations`. x has no forces."""
    for k in range(c.body.shape[0] - 1, -1, -1):
        for i in range(c.body[k].wheel_start, c.body[k].wheel_stop):
            j = c.wheel[i].u_index
            if c.speed[j].prescribed < 0:
                x.speed[j] *= sqrt(c.wheel[i].axial)
                _turn_node(c, w, x, k, i, x.speed[j])
            else:
                x.speed[j] = 0.0
        z = _force_at_hinge(c, w, x, k)
        start = c.body[k].etad_index
        for n in range(c.body[k].modes):
            x.speed[start + n] /= sqrt(w.pff[k, n, n])
            z = axpy6(x.speed[start + n], vec6(w.pfr[k, n], 0), z)
        for n in range(c.body[k].modes - 1, -1, -1):
            T = x.zf[k, n]
            for i in range(n + 1):
                T += w.pff[k, i, n] * x.speed[start + i]
            x.speed[start + n] = T
        z = hinge_solve.synthesise(c, w, x, k, z)
        if c.body[k].parent >= 0:
            force_to_parent(c, w, x, k, z)


@helper
def add_to_modes(c, w, x, k):
    """Further forces T on the modes have the innovations y: what `inward` left is as if they had been there."""
    for n in range(c.body[k].modes):
        w.pfr[k, n, LOAD] -= x.speed[c.body[k].etad_index + n] * sqrt(w.pff[k, n, n])


@helper
def log_determinant(c, w):
    """log det M = log det D, the other factors being unit triangular (54)."""
    total = 0.0
    for k in range(c.body.shape[0]):
        for i in range(c.body[k].wheel_start, c.body[k].wheel_stop):
            if c.speed[c.wheel[i].u_index].prescribed < 0:
                total += log(c.wheel[i].axial)
        for n in range(c.body[k].modes):
            total += log(w.pff[k, n, n])
        total += hinge_solve.log_determinant(c, w, k)
    return total


@helper
def _turn_node(c, w, x, k, i, torque):
    """z += G epsilon of wheel i: its torque about its axis, on the node that carries it."""
    add_port_torque(c, w, x, k, c.wheel[i].port, scale(torque, spin_axis(c, w, i)))


@helper
def _node_acceleration(c, w, x, k, i):
    """q . alpha of the node that carries wheel i."""
    alpha, _ = port_response(c, w, x, k, c.wheel[i].port)
    return dot(spin_axis(c, w, i), alpha)


@helper
def _force_at_hinge(c, w, x, k):
    """z_r about O; where O is on a node that deforms, z_f - [Pi_d]' z_r stays for the modes (45)."""
    z = vec6(x.body[k].force, 0)
    i = c.body[k].outboard_port
    if i >= 0:
        z = shift_force(z, scale(-1.0, vec3(w.port[i].r, 0)))
        for n in range(c.body[k].modes):
            x.zf[k, n] -= dot6(mode_motion(w, i, n), z)
    return z


@helper
def project(c, w, x, k):
    """T - H z of body k's own speeds in place of T; all of z goes on to the parent (36), (41).

    x.body[k].force then holds z about O, body axes. w has the poses and the motions of the ports.
    """
    z = _force_at_hinge(c, w, x, k)
    store6(x.body[k].force, 0, z)
    for n in range(c.body[k].modes):
        x.speed[c.body[k].etad_index + n] -= x.zf[k, n]
    for n in range(c.body[k].nv):
        x.speed[c.body[k].u_index + n] -= dot6(motion_column(c, w, k, n), z)
    if c.body[k].parent >= 0:
        force_to_parent(c, w, x, k, z)
