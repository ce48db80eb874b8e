"""Innovations factorisation M = (1 + H Phi K) D (1 + H Phi K)' of trees, applied and inverted by recursion, O(N).

`flexmb.jain.sweeps.inward` computes the factors: in each body first those of the free wheels, then of the modes (D_f),
then of the hinge (D_R), each D = L L'. The L of the modes is that of `flexmb.jain.explicit` times the square roots of
the pivots. Rows and columns of prescribed speeds are left out of M. With

    F = (1 + H Phi K) L

    innovations   y = F^-1 T      inward      (55)
    respond       x = F'^-1 y     outward     both together: M^-1 T, (56)
    excite        y = F' x        outward
    synthesise    T = F y         inward      both together: M x, (54)

F is the Cholesky factor of M in the order tip to base, in each body wheels, modes, hinge speeds. T, y and x are `speed`
of a `Response`, in which each overwrites the one it is computed from. `innovations` includes the forces z on bodies and
modes in the response: y = F^-1 (T - H Phi z).
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
from flexmb.jit.kernel import helper, kernel
from flexmb.levels.body import body_inertia
from flexmb.spatial.spatial_vector import axpy6, dot6, less6, shift_force, store6, vec6
from flexmb.spatial.vector import dot, scale, vec3


@helper
def factorise(c, w):
    """Factors of M at the configuration in w.q; False where a D is not positive definite: w.fault names the body."""
    inertias(c, w)
    return inward(c, w)


@kernel
def inertias(c, w):
    """M_m of every body at the configuration in w.q, before any elimination."""
    for j in range(w.u.shape[0]):  # the sweeps also eliminate bias forces, which are unwanted here
        w.u[j] = 0.0
        w.speed[j].applied = 0.0
    velocity_sweep(c, w, False, False)
    for k in range(c.body.shape[0]):
        body_inertia(c, w, k)
        wheel_forces(c, w, k)


@helper
def innovations(c, w, x):
    """z = Phi z^+, epsilon = T - H z, T := y = L^-1 epsilon, z^+ = z + G epsilon (55); overwrites the forces in x."""
    for k in range(c.body.shape[0] - 1, -1, -1):
        innovate(c, w, x, k)


@helper
def innovate(c, w, x, k):
    """(55) at body k. x.body[k].force is then z_R, the force about O after the elimination of the modes."""
    for i in range(c.body[k].wheel_start, c.body[k].wheel_stop):
        j = c.wheel[i].u_index
        if c.speed[j].prescribed < 0:
            _turn_node(c, w, x, k, i, x.speed[j])
            x.speed[j] /= sqrt(c.wheel[i].axial)
        else:
            x.speed[j] = 0.0
    z = _force_at_hinge(c, w, x, k)
    start = c.body[k].etad_index
    # `explicit` leaves D L' in pff, which multiplies D^-1 epsilon: `speed` is that first, and the roots of the pivots
    # follow in a loop of their own.
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
    """alpha^+ = Phi' alpha, y := x = L'^-1 y - G' alpha^+, alpha = alpha^+ + H' x: the outward half of (56)."""
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
    """alpha^+ = Phi' alpha, x := y = L' (x + G' alpha^+), alpha = alpha^+ + H' x: the inverse of `respond`."""
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
    """epsilon = L y, y := T = epsilon + H z, z^+ = z + G epsilon: the inverse of `innovations`; needs z = 0 in x."""
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
    """Add generalised forces on the modes to those that `sweeps.inward` has seen; x.speed holds their innovations y."""
    for n in range(c.body[k].modes):
        w.pfr[k, n, LOAD] -= x.speed[c.body[k].etad_index + n] * sqrt(w.pff[k, n, n])


@helper
def log_determinant(c, w):
    """log det M = log det D, because the other factors are unit triangular (54)."""
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
    """z += G epsilon of wheel i: a torque about its axis on the node that carries it."""
    add_port_torque(c, w, x, k, c.wheel[i].port, scale(torque, spin_axis(c, w, i)))


@helper
def _node_acceleration(c, w, x, k, i):
    """q . alpha of the node that carries wheel i."""
    alpha, _ = port_response(c, w, x, k, c.wheel[i].port)
    return dot(spin_axis(c, w, i), alpha)


@helper
def _force_at_hinge(c, w, x, k):
    """z_r about O; where O sits on a node that deforms, also z_f := z_f - [Pi_d]' z_r (45)."""
    z = vec6(x.body[k].force, 0)
    i = c.body[k].outboard_port
    if i >= 0:
        z = shift_force(z, scale(-1.0, vec3(w.port[i].r, 0)))
        for n in range(c.body[k].modes):
            x.zf[k, n] -= dot6(mode_motion(w, i, n), z)
    return z


@helper
def project(c, w, x, k):
    """T := T - H z for the speeds of body k; all of z is passed to the parent (36), (41), without any elimination.

    x.body[k].force is then z about O, body axes. Poses and port motions are read from w.
    """
    z = _force_at_hinge(c, w, x, k)
    store6(x.body[k].force, 0, z)
    for n in range(c.body[k].modes):
        x.speed[c.body[k].etad_index + n] -= x.zf[k, n]
    for n in range(c.body[k].nv):
        x.speed[c.body[k].u_index + n] -= dot6(motion_column(c, w, k, n), z)
    if c.body[k].parent >= 0:
        force_to_parent(c, w, x, k, z)
