"""Energy, momentum and power of a whole system, from the same modal mass matrices that move it."""

from flexmb.hinges.catalogue import SPHERICAL
from flexmb.jain.forces import load_vector
from flexmb.jain.ports import port_velocity
from flexmb.jit.kernel import helper
from flexmb.levels.body import body_inertia
from flexmb.spatial.inertia import inertia_times, load_inertia
from flexmb.spatial.rotation import rotation_vector
from flexmb.spatial.vector import add, add3, axpy, cross, dot, mat3, scale, times, vec3

KINETIC, STRAIN, SPRING, GRAVITY = range(4)


@helper
def energy_and_momentum(c, w, energy, momentum):
    """energy (4,) kinetic, strain, spring, gravity in J; momentum (6,) [angular about the World origin; linear].

    Needs the velocity and pose sweeps of this state. Overwrites w.body.inertia, w.body.force, w.pff and w.mode.
    """
    for i in range(4):
        energy[i] = 0.0
    for i in range(6):
        momentum[i] = 0.0
    for k in range(c.body.shape[0]):
        body_inertia(c, w, k)
        _body(c, w, k, energy, momentum)
    for j in range(w.u.shape[0]):
        i = c.speed[j].coordinate
        if i >= 0:
            energy[SPRING] += 0.5 * c.speed[j].stiffness * (w.q[i] - c.speed[j].rest) ** 2
    for k in range(c.body.shape[0]):
        if c.body[k].hinge_kind == SPHERICAL:
            i = c.body[k].q_index
            theta = rotation_vector(w.q[i], w.q[i + 1], w.q[i + 2], w.q[i + 3])
            energy[SPRING] += 0.5 * c.body[k].ball_spring * dot(theta, theta)


@helper
def _body(c, w, k, energy, momentum):
    """1/2 [etadot; V]' M_m [etadot; V] plus wheels; momentum [h; p] = M_rf etadot + M_rr V about the origin."""
    omega, v = vec3(w.body[k].velocity, 0), vec3(w.body[k].velocity, 3)
    h, p = inertia_times(load_inertia(w.body[k].inertia, 0), (omega, v))
    twice = dot(h, omega) + dot(p, v)
    for n in range(c.body[k].modes):
        etad = w.mode[k, n].etad
        coupling = w.mode[k, n].pfr
        angular, linear = vec3(coupling, 0), vec3(coupling, 3)
        twice += 2.0 * etad * (dot(angular, omega) + dot(linear, v))
        h = axpy(etad, angular, h)
        p = axpy(etad, linear, p)
        eta = w.q[c.body[k].eta_index + n]
        for i in range(c.body[k].modes):
            twice += etad * w.pff[k, n, i] * w.mode[k, i].etad
            energy[STRAIN] += 0.5 * eta * c.pair[k, n, i].stiffness * w.q[c.body[k].eta_index + i]
    for i in range(c.body[k].wheel_start, c.body[k].wheel_stop):
        port = c.wheel[i].port
        axial = c.wheel[i].axial
        spin = w.u[c.wheel[i].u_index]
        axis = times(mat3(w.port[port].R, 0), vec3(c.wheel[i].axis, 0))
        node, _ = port_velocity(w, k, port)
        twice += axial * spin * (spin + 2.0 * dot(axis, node))
        h = axpy(axial * spin, axis, h)
    energy[KINETIC] += 0.5 * twice
    R = mat3(w.body[k].pose_rotation, 0)
    origin = vec3(w.body[k].pose_position, 0)
    # first moment: the coupling block of a rigid inertia is skew(s)
    block = w.body[k].inertia
    s = (block[13], block[8], block[9])
    first = add(scale(block[15], origin), times(R, s))
    energy[GRAVITY] -= dot(vec3(c.gravity, 0), first)
    p = times(R, p)
    add3(momentum, 0, add(times(R, h), cross(origin, p)))
    add3(momentum, 3, p)


@helper
def power(c, w):
    """Power of everything that is not conservative: motors, dampers, drives, node loads, modal damping (W)."""
    total = 0.0
    for j in range(w.u.shape[0]):
        rate = w.u[j]
        total -= c.speed[j].damping * rate * rate
        f = c.speed[j].motor
        if f >= 0:
            total += w.function[f, 0] * rate
        if c.speed[j].prescribed >= 0:
            total += w.speed[j].drive * rate
    for k in range(c.body.shape[0]):
        for n in range(c.body[k].modes):
            start, stop = (n, n + 1) if c.body[k].uncoupled else (0, c.body[k].modes)
            for i in range(start, stop):
                total -= w.u[c.body[k].etad_index + n] * c.pair[k, n, i].damping * w.u[c.body[k].etad_index + i]
        for i in range(c.body[k].load_start, c.body[k].load_stop):
            port, tau, f = load_vector(c, w, k, i)
            omega, v = port_velocity(w, k, port)
            total += dot(tau, omega) + dot(f, v)
    return total
