"""Ports of bodies that deform: their motion, and what each mode does to a port relative to its body.

With V_r and A_r of a port relative to the body, the motion J of mode n, and the derivatives a of V_r and b of A_r along
it while the body frame stays,

    displacement    s0 = J    s1 = a - J x V    s2 = V_body x a + b - J x A - s1 x V
    speed           s0 = 0    s1 = J            s2 = V_body x J + b - J x V

with the velocity V and acceleration A of the port. Where the hinge point O sits on a node d that the modes move in the
body, it is the body frame that moves against O, with the motion -J of d. At level ruthless the modes move nothing, and
only their accelerations act.
"""

from flexmb.jain.derivatives.hinges import to_world
from flexmb.jain.derivatives.strained import place_port, sum_strains, turn_sections
from flexmb.jain.derivatives.strips_of import put3_until, put_strips, put_strips_until, strips_of
from flexmb.jain.derivatives.tables import (
    BY_ACCELERATION,
    BY_RATE,
    MOTION,
    MOVED_ROWS,
    SPEED_BY_ACCELERATION,
    SPEED_BY_RATE,
    TURN,
)
from flexmb.jain.ports import mode_motion, move_port
from flexmb.jit.duals import RATES, rate, seeded
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, sweep
from flexmb.jit.strips import width
from flexmb.levels.body import is_at_rest
from flexmb.spatial.cross6 import motion_cross
from flexmb.spatial.rows import column6, strips6
from flexmb.spatial.spatial_vector import ZERO6, axpy6, scale6, shift_motion, store6, sub6, sum6, vec6
from flexmb.spatial.vector import add, cross, mat3, scale, store3, sub, times, vec3
from flexmb.tables.features import SECTIONS


@helper
def clear_ports(c, d, k):
    """No forces and inertia at the ports of body k."""
    for i in range(c.body[k].port_start, c.body[k].port_stop):
        if d.port[i].used:
            for n in range(21):
                d.port[i].inertia[n] = 0.0
            for n in range(18):
                d.port[i].by_rate[n] = 0.0
                d.port[i].by_turn[n] = 0.0
            store6(d.port[i].force, 0, ZERO6)


@sweep
def move_ports(c, w, d, k):
    """Motion of the ports of body k in World axes, and what its modes do to them."""
    R = mat3(d.body[k].rotation, 0)
    V_body, A_body = vec6(d.body[k].velocity, 0), vec6(d.body[k].accel, 0)
    for i in range(c.body[k].port_start, c.body[k].port_stop):
        if d.port[i].used:
            r = add(vec3(d.body[k].origin, 0), times(R, vec3(w.port[i].r, 0)))
            store3(d.port[i].position, 0, r)
            V, A = V_body, A_body
            if c.body[k].modes > 0:
                V_r, A_r = to_world(R, r, vec6(w.port[i].v, 0)), to_world(R, r, _relative_acceleration(c, w, k, i))
                V, A = sum6(V_body, V_r), sum6(sum6(A_body, motion_cross(V_body, V_r)), A_r)
                _change(c, w, d, k, i)
                for n in range(0, c.body[k].modes, width(w)):
                    _seed(c, w, d, k, i, n, (R, r), (V, A))
            store6(d.port[i].velocity, 0, V)
            store6(d.port[i].accel, 0, A)


@helper
def _seed(c, w, d, k, i, n, frame, motion):
    """What a strip of modes does to port i; `frame`: the body's rotation and place, `motion`: V and A of the port."""
    R, r = frame
    V, A = motion
    J, V_body, moved = to_world(R, r, strips6(w, w.port_mode[i], n)), vec6(d.body[k].velocity, 0), d.port_mode[i]
    put_strips(d, moved, MOTION, n, J)
    if is_at_rest(c.body[k].level):
        return
    a, b = to_world(R, r, strips_of(d, d.change, 0, n)), to_world(R, r, strips_of(d, d.change, 6, n))
    s1 = sub6(a, motion_cross(J, V))
    s2 = sub6(sum6(motion_cross(V_body, a), b), sum6(motion_cross(J, A), motion_cross(s1, V)))
    put_strips(d, moved, BY_RATE, n, s1)
    put_strips(d, moved, BY_ACCELERATION, n, s2)
    b = to_world(R, r, strips_of(d, d.change, 12, n))
    put_strips(d, moved, SPEED_BY_ACCELERATION, n, sub6(sum6(motion_cross(V_body, J), b), motion_cross(J, V)))


@sweep
def move_frame(c, w, d, k, R, r, V, A):
    """V and A of the body frame from those of O on a deforming node of the body, and what the modes do to the frame."""
    i = c.body[k].outboard_port
    V_r, A_r = to_world(R, r, vec6(w.port[i].v, 0)), to_world(R, r, _relative_acceleration(c, w, k, i))
    V_body = sub6(V, V_r)
    A_body = sub6(A, sum6(motion_cross(V_body, V_r), A_r))
    _change(c, w, d, k, i)
    for n in range(0, c.body[k].modes, width(w)):
        J = scale6(-1.0, to_world(R, r, strips6(w, w.port_mode[i], n)))
        put_strips(d, d.frame_mode[k], MOTION, n, J)
        if not is_at_rest(c.body[k].level):
            _seed_frame(d, k, n, (R, r), J, (V_r, A_r), (V_body, A_body))
    return V_body, A_body


@helper
def _seed_frame(d, k, n, frame, J, relative, motion):
    """What a strip of modes does to the body frame; the axes of O stay, which turn against those of the body.

    `relative`: velocity and acceleration of O against the body, `motion`: those of the body frame.
    """
    R, r = frame
    V_r, A_r = relative
    V_body, A_body = motion
    moved = d.frame_mode[k]
    change = sum6(to_world(R, r, strips_of(d, d.change, 0, n)), motion_cross(J, V_r))
    dV = scale6(-1.0, change)
    dA = sum6(motion_cross(dV, V_r), motion_cross(V_body, change))
    dA = sum6(dA, sum6(to_world(R, r, strips_of(d, d.change, 6, n)), motion_cross(J, A_r)))
    s1 = sub6(dV, motion_cross(J, V_body))
    put_strips(d, moved, BY_RATE, n, s1)
    s2 = sub6(scale6(-1.0, dA), sum6(motion_cross(J, A_body), motion_cross(s1, V_body)))
    put_strips(d, moved, BY_ACCELERATION, n, s2)
    # speeds: V_r changes by -J, V_body by J
    dA = sum6(motion_cross(J, V_r), motion_cross(V_body, scale6(-1.0, J)))
    dA = sum6(dA, to_world(R, r, strips_of(d, d.change, 12, n)))
    put_strips(d, moved, SPEED_BY_ACCELERATION, n, sub6(scale6(-1.0, dA), motion_cross(J, V_body)))


@sweep
def see_modes(c, d, k):
    """Seeds of the parent's modes as body k sees them at its inboard frame, about its base point."""
    p, i = c.body[k].parent, c.body[k].inboard_port
    moves = 0.0 if is_at_rest(c.body[p].level) else 1.0
    step = vec3(d.body[k].step, 0) if d.places[k].new_point else (0.0, 0.0, 0.0)
    for n in range(0, d.places[k].sees, width(d)):
        slot, count = d.places[k].seen + n, d.places[k].sees - n
        for row in range(MOTION, MOVED_ROWS, 6):
            V = strips_of(d, d.frame_mode[p], row, n)  # zero unless they move O in the body
            if i >= 0:
                V = sum6(V, strips_of(d, d.port_mode[i], row, n))
            V = shift_motion(V, step)
            put_strips_until(d, d.seed, row, slot, count, V)
            if row == MOTION:
                turn = scale(moves, V[0])
                put3_until(d, d.seed, TURN, slot, count, turn)
                put3_until(d, d.seed, SPEED_BY_RATE, slot, count, turn)


@helper
def _relative_acceleration(c, w, k, i):
    """A_r of port i, in body axes, with what the modal accelerations add."""
    w_rel, v_rel = vec6(w.port[i].v, 0)
    alpha, a = vec6(w.port[i].a, 0)
    A = alpha, sub(a, cross(w_rel, v_rel))
    for n in range(c.body[k].modes):
        A = axpy6(w.speed[c.body[k].etad_index + n].acceleration, mode_motion(w, i, n), A)
    return A


@sweep
def _change(c, w, d, k, i):
    """Derivatives of V_r, A_r and the motions of port i to `change` and `bent`; its point moves along, too.

    One more direction, along the speeds of all modes, gives those of A_r by speeds: what A_r has of them is
    sum_jk etad_j etad_k dJ_j/deta_k, with the motion J_j of mode j, so that its derivative by the speed of mode n is
    sum_k etad_k (dJ_k/deta_n + dJ_n/deta_k). The first of these sums is the derivative of V_r by displacement n.
    """
    if is_at_rest(c.body[k].level):
        return
    e, nm = d.duals, c.body[k].modes
    for n in range(nm):
        e.eta[k, n] = w.eta[k, n]
        e.etad[k, n] = w.etad[k, n]
    if has(c, SECTIONS) and c.port[i].section >= 0:
        _change_at_section(c, w, d, k, i)
        return
    for first in range(0, nm + 1, RATES):
        count = min(RATES, nm + 1 - first)
        for lane in range(count):
            if first + lane < nm:
                seed_mode(e, k, nm, first + lane, lane)
            else:
                _seed_along_speeds(w, e, k, nm, lane)
        move_port(c, e, k, i)
        _store_relative(c, w, d, k, i)
        for lane in range(count):
            if first + lane < nm:
                _keep_displacement(c, d, k, i, first + lane, lane)
            else:
                _keep_speeds(d, i, nm, lane)
        for n in range(nm):
            e.eta[k, n] = w.eta[k, n]


@sweep
def _change_at_section(c, w, d, k, i):
    """The same where a section of level exact carries port i; of its motions, `flexmb.jain.derivatives.flexible.bend`
    finds what displacements do to the rows."""
    e, nm, moves = d.duals, c.body[k].modes, False
    for n in range(nm):
        e.etadd[k, n] = w.speed[c.body[k].etad_index + n].acceleration
        moves = moves or w.etad[k, n] != 0.0
        for row in range(6):
            d.change[12 + row, n] = 0.0  # A_r is quadratic in the speeds
    sum_strains(c, e, k)
    for first in range(0, 2 * nm if moves else nm, nm):
        for start in range(0, nm, RATES):
            count = min(RATES, nm - start)
            for lane in range(count):
                seed_mode(e, k, nm, first + start + lane, lane)
            _move_at_section(c, e, k, i, (start, start + count))
            for lane in range(count):
                if first == 0:
                    _keep_change(d, k, i, start + lane, lane)
                    e.eta[k, start + lane] = w.eta[k, start + lane]
                else:
                    for row in range(6):
                        d.change[12 + row, start + lane] = rate(e.body[k].accel[row], lane)
                    e.etad[k, start + lane] = w.etad[k, start + lane]


@helper
def _move_at_section(c, e, k, i, seeds):
    """Position and V_r of port i, and A_r as `_store_relative` stores it, with the modal accelerations."""
    at = e.section[c.port[i].section]
    turn_sections(c, e, k, seeds)
    place_port(c, e, k, c.port[i].section)
    omega, alpha, arm = vec3(at.omega, 0), vec3(at.alpha, 0), times(mat3(at.R, 0), vec3(c.port[i].offset, 0))
    swing = cross(omega, arm)
    v = add(vec3(at.v, 0), swing)
    a = add(vec3(at.a, 0), add(cross(alpha, arm), cross(omega, swing)))
    store3(e.port[i].r, 0, add(vec3(at.r, 0), arm))
    store6(e.port[i].v, 0, (omega, v))
    store6(e.body[k].accel, 0, (alpha, sub(a, cross(omega, v))))


@helper
def _seed_along_speeds(w, e, k, nm, lane):
    """A displacement of all modes by their speeds."""
    for n in range(nm):
        unit = seeded(e.eta[k, n], lane) - e.eta[k, n]
        e.eta[k, n] += w.etad[k, n] * unit


@helper
def _keep_speeds(d, i, nm, lane):
    """Derivatives of A_r by speeds from those of the motions along the speeds, about the port's point as it is now."""
    e = d.duals
    moved = (rate(e.port[i].r[0], lane), rate(e.port[i].r[1], lane), rate(e.port[i].r[2], lane))
    for n in range(nm):
        J = e.port_mode[i, 0, n].real, e.port_mode[i, 1, n].real, e.port_mode[i, 2, n].real
        v = cross(moved, J)
        for row in range(3):
            d.change[12 + row, n] = d.change[row, n] + rate(e.port_mode[i, row, n], lane)
            d.change[15 + row, n] = d.change[3 + row, n] + rate(e.port_mode[i, 3 + row, n], lane) + v[row]


@helper
def seed_mode(e, k, nm, n, lane):
    """Direction n < nm is a displacement of that mode, nm + n the change of its speed."""
    if n < nm:
        e.eta[k, n] = seeded(e.eta[k, n], lane)
    else:
        e.etad[k, n - nm] = seeded(e.etad[k, n - nm], lane)


@helper
def _store_relative(c, w, d, k, i):
    """A_r of duals, to their body's acceleration, which is not needed otherwise."""
    e = d.duals
    w_rel, v_rel = vec6(e.port[i].v, 0)
    alpha, a = vec6(e.port[i].a, 0)
    A = alpha, sub(a, cross(w_rel, v_rel))
    for n in range(c.body[k].modes):
        A = axpy6(w.speed[c.body[k].etad_index + n].acceleration, column6(e.port_mode[i], n), A)
    store6(e.body[k].accel, 0, A)


@helper
def _keep_change(d, k, i, n, lane):
    """Those of V_r and A_r by displacement n, as spatial vectors about the port's point as it is now."""
    e = d.duals
    moved = (rate(e.port[i].r[0], lane), rate(e.port[i].r[1], lane), rate(e.port[i].r[2], lane))
    for row in range(3):
        d.change[row, n] = rate(e.port[i].v[row], lane)
        d.change[6 + row, n] = rate(e.body[k].accel[row], lane)
    spin = (e.port[i].v[0].real, e.port[i].v[1].real, e.port[i].v[2].real)
    alpha = (e.body[k].accel[0].real, e.body[k].accel[1].real, e.body[k].accel[2].real)
    v, a = cross(moved, spin), cross(moved, alpha)
    for row in range(3):
        d.change[3 + row, n] = rate(e.port[i].v[3 + row], lane) + v[row]
        d.change[9 + row, n] = rate(e.body[k].accel[3 + row], lane) + a[row]


@helper
def _keep_displacement(c, d, k, i, n, lane):
    """The derivatives along one lane as spatial vectors about the port's point as it is now."""
    e = d.duals
    _keep_change(d, k, i, n, lane)
    moved = (rate(e.port[i].r[0], lane), rate(e.port[i].r[1], lane), rate(e.port[i].r[2], lane))
    for j in range(c.body[k].modes):
        mode = (e.port_mode[i, 0, j].real, e.port_mode[i, 1, j].real, e.port_mode[i, 2, j].real)
        v = cross(moved, mode)
        for row in range(3):
            d.bent[i, j, row, n] = rate(e.port_mode[i, row, j], lane)
            d.bent[i, j, 3 + row, n] = rate(e.port_mode[i, 3 + row, j], lane) + v[row]
