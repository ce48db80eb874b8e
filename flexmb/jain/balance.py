"""Energy, momentum and power of a system, from the modal mass matrices that the equations of motion use."""

from flexmb.connectors.along_hinges import evaluate_along_hinges, stored_along_hinges
from flexmb.connectors.between import connector_power, stored_in_connectors
from flexmb.jain.connected import evaluate_connectors
from flexmb.jain.forces import load_at_port
from flexmb.jain.ports import port_velocity
from flexmb.jain.wheels import spin_axis
from flexmb.jit.duals import nonzero
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, sweep
from flexmb.levels.body import body_inertia
from flexmb.motion.coordinates import speed_power
from flexmb.spatial.inertia import inertia_times, load_inertia
from flexmb.spatial.rotation import rotation_vector
from flexmb.spatial.spatial_vector import add6, axpy6, dot6, shift_force, times6, vec6
from flexmb.spatial.vector import add, axpy, dot, mat3, scale, times, vec3
from flexmb.tables.features import (
    ARMATURES,
    BALL_SPRINGS,
    CONNECTORS,
    COORDINATE_LAWS,
    HINGE_SPRINGS,
    LOADS,
    MODAL_DAMPING,
    MODES,
    SPRINGS,
    WHEELS,
)

KINETIC, STRAIN, SPRING, GRAVITY = range(4)


@sweep
def energy_and_momentum(c, w, energy, momentum):
    """energy (4,) kinetic, strain, spring, gravity in J; momentum (6,) [angular about the World origin; linear].

    Armatures have kinetic energy, but no momentum. Needs the velocity and pose sweeps of this state. Overwrites
    w.body.inertia, w.body.force, w.pff, w.pfr, w.zf, and what connectors write.
    """
    for i in range(4):
        energy[i] = 0.0
    for i in range(6):
        momentum[i] = 0.0
    for k in range(c.body.shape[0]):
        body_inertia(c, w, k)
        _body(c, w, k, energy, momentum)
    if has(c, ARMATURES):
        for j in range(w.u.shape[0]):
            energy[KINETIC] += 0.5 * c.speed[j].armature * w.u[j] * w.u[j]
    if has(c, SPRINGS):
        for j in range(w.u.shape[0]):
            i = c.speed[j].coordinate
            if i >= 0:
                stretch = w.q[i] - c.speed[j].rest
                energy[SPRING] += 0.5 * c.speed[j].stiffness * (stretch * stretch)
    if has(c, BALL_SPRINGS):
        for k in range(c.body.shape[0]):
            if nonzero(c.body[k].ball_spring):
                i = c.body[k].q_index
                theta = rotation_vector(w.q[i], w.q[i + 1], w.q[i + 2], w.q[i + 3])
                energy[SPRING] += 0.5 * c.body[k].ball_spring * dot(theta, theta)
    if has(c, HINGE_SPRINGS) or has(c, COORDINATE_LAWS):
        evaluate_along_hinges(c, w)
        energy[SPRING] += stored_along_hinges(c, w)
    if has(c, CONNECTORS):
        evaluate_connectors(c, w)
        energy[SPRING] += stored_in_connectors(w)


@helper
def _body(c, w, k, energy, momentum):
    """Add the shares of body k and its wheels.

    Kinetic energy 1/2 [etadot; V]' M_m [etadot; V], momentum h = M_rf etadot + M_rr V about the body origin. M_m holds
    the wheels as if they did not spin, so that each adds its spin alone: I thetad (thetad/2 + q.w) and I thetad q.
    """
    M_rr, V = load_inertia(w.body[k].inertia, 0), vec6(w.body[k].velocity, 0)
    h = inertia_times(M_rr, V)
    twice = dot6(h, V)
    if has(c, MODES):
        for n in range(c.body[k].modes):
            M_fr, etad = vec6(w.pfr[k, n], 0), w.etad[k, n]
            twice += 2.0 * etad * dot6(M_fr, V)
            h = axpy6(etad, M_fr, h)
            eta = w.q[c.body[k].eta_index + n]
            for i in range(c.body[k].modes):
                twice += etad * w.pff[k, n, i] * w.etad[k, i]
                energy[STRAIN] += 0.5 * eta * c.stiffness[k, n, i] * w.q[c.body[k].eta_index + i]
    if has(c, WHEELS):
        for i in range(c.body[k].wheel_start, c.body[k].wheel_stop):
            axial, axis, spin = c.wheel[i].axial, spin_axis(c, w, i), w.u[c.wheel[i].u_index]
            omega, _ = port_velocity(w, k, c.wheel[i].port)
            twice += axial * spin * (spin + 2.0 * dot(axis, omega))
            h = axpy(axial * spin, axis, h[0]), h[1]
    energy[KINETIC] += 0.5 * twice
    R_WB, p_WB = mat3(w.body[k].pose_rotation, 0), vec3(w.body[k].pose_position, 0)  # of the body frame in World
    _, coupling, mass = M_rr
    s = (coupling[7], coupling[2], coupling[3])  # first moment: the coupling block of a rigid inertia is skew(s)
    energy[GRAVITY] -= dot(vec3(c.gravity, 0), add(scale(mass[0], p_WB), times(R_WB, s)))
    add6(momentum, 0, shift_force(times6(R_WB, h), p_WB))


@helper
def power(c, w):
    """Power in W of all forces without a potential: motors, dampers, drives, loads, modal damping, friction."""
    total = speed_power(c, w)
    for k in range(c.body.shape[0]):
        if has(c, MODAL_DAMPING):
            for n in range(c.body[k].modes):
                start, stop = (n, n + 1) if c.body[k].uncoupled else (0, c.body[k].modes)
                for i in range(start, stop):
                    total -= w.u[c.body[k].etad_index + n] * c.damping[k, n, i] * w.u[c.body[k].etad_index + i]
        if has(c, LOADS):
            for i in range(c.body[k].load_start, c.body[k].load_stop):
                port, F = load_at_port(c, w, k, i)
                total += dot6(F, port_velocity(w, k, port))
    if has(c, CONNECTORS):
        total += connector_power(w)
    return total
