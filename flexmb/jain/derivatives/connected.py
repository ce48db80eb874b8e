"""Connectors between two points: their loads, and how these change along 24 directions, by dual numbers along 21.

Each end has twelve: its rotation and displacement in World axes, s0, and s1 of its velocity. A displacement of both
ends changes no load, so that one of B alone changes it by the opposite of what the same one of A does. The load itself
acts like one that keeps its direction in World. What it changes by acts on all rows of the paths to both ends, for all
sources there.
"""

from flexmb.connectors.between import load_between
from flexmb.jain.derivatives.attached import add_world_load
from flexmb.jain.derivatives.columns import put_until
from flexmb.jain.derivatives.ends import fill_end
from flexmb.jain.derivatives.tables import END_DISPLACED, END_MOTION, END_MOVED, END_SPEED
from flexmb.jit.duals import RATES, rate, seeded
from flexmb.jit.kernel import helper, sweep
from flexmb.jit.strips import strip, width
from flexmb.spatial.rows import strips6
from flexmb.spatial.spatial_vector import ZERO6, dot6, scale6, shift_force, shift_motion, store6, vec6
from flexmb.spatial.vector import add, cross, mat3, matmul, times, vec3
from flexmb.tables.arrays import ON_GROUND

DIRECTIONS = 24
MOVED, OPPOSITE = 3, 15  # the first of three displacements of A, and of B
SEEDED = DIRECTIONS - 3


@sweep
def attach_connectors(c, w, d):
    """Loads of all connectors at their ports, and their derivatives to `link`; needs the World poses in w."""
    for i in range(c.connector.shape[0]):
        for first in range(0, SEEDED, RATES):
            _differentiate(c, w, d, i, first)
        for side in range(2):
            if c.end[i, side].body != ON_GROUND:
                F = _six(d.duals.body[0].hinge_force) if side == 0 else _six(d.duals.body[0].load)
                add_world_load(d, c.end[i, side].port, F)


@helper
def _differentiate(c, w, d, i, first):
    """Seven directions of connector i: forces on the bodies of A and B, about the ends, with the sign of inertia."""
    e = d.duals
    store6(e.body[0].velocity, 0, ZERO6)
    store6(e.body[0].accel, 0, ZERO6)
    store6(e.body[0].bias, 0, ZERO6)
    store6(e.body[0].gain, 0, ZERO6)
    for lane in range(RATES):
        n = _direction(first + lane)
        if n < 6:
            e.body[0].velocity[n] = seeded(e.body[0].velocity[n], lane)
        elif n < 12:
            e.body[0].accel[n - 6] = seeded(e.body[0].accel[n - 6], lane)
        elif n < 18:
            e.body[0].bias[n - 12] = seeded(e.body[0].bias[n - 12], lane)
        else:
            e.body[0].gain[n - 18] = seeded(e.body[0].gain[n - 18], lane)
    A = _end(c, w, d, i, 0, vec6(e.body[0].velocity, 0), vec6(e.body[0].accel, 0))
    B = _end(c, w, d, i, 1, vec6(e.body[0].bias, 0), vec6(e.body[0].gain, 0))
    load_between(c, e, i, A, B)
    on_B = vec6(e.connector[i].load, 0)
    store6(e.body[0].hinge_force, 0, shift_force(on_B, vec3(e.connector[i].arm, 0)))
    store6(e.body[0].load, 0, scale6(-1.0, on_B))
    for lane in range(RATES):
        n = _direction(first + lane)
        for row in range(6):
            d.link[i, row, n] = rate(e.body[0].hinge_force[row], lane)
            d.link[i, 6 + row, n] = rate(e.body[0].load[row], lane)
        d.link[i, 12, n] = rate(e.connector[i].power, lane)
        if MOVED <= n < MOVED + 3:
            for row in range(13):
                d.link[i, row, n + OPPOSITE - MOVED] = -d.link[i, row, n]


@helper
def _direction(seed):
    """Of the 21 that are seeded: all but the displacements of B. Blocks of RATES have no rest."""
    return seed if seed < OPPOSITE else seed + 3


@helper
def _end(c, w, d, i, side, s0, s1):
    """Position, rotation and velocity of an end of connector i, World axes, after small changes s0 and s1."""
    k, port = c.end[i, side].body, c.end[i, side].port
    position, R, V = vec3(c.end[i, side].position, 0), mat3(c.end[i, side].rotation, 0), ZERO6
    if k != ON_GROUND:
        R_body = mat3(w.body[k].pose_rotation, 0)
        position = add(vec3(w.body[k].pose_position, 0), times(R_body, vec3(w.port[port].r, 0)))
        R = matmul(R_body, mat3(w.port[port].R, 0))
        V = shift_motion(vec6(d.port[port].velocity, 0), vec3(d.port[port].position, 0))
    turn, moved = s0
    x, y, z = turn
    turned = matmul((0.0 * x + 1.0, -z, y, z, 0.0 * x + 1.0, -x, -y, x, 0.0 * x + 1.0), R)
    velocity = add(V[0], add(s1[0], cross(turn, V[0]))), add(V[1], add(s1[1], cross(turn, V[1])))
    return add(position, moved), turned, velocity


@helper
def _six(a):
    """The numbers of six duals."""
    return (a[0].real, a[1].real, a[2].real), (a[3].real, a[4].real, a[5].real)


@sweep
def link(c, d):
    """Add the changes of all loads to the rows of the paths to both ends."""
    for i in range(c.connector.shape[0]):
        for side in range(2):
            if c.end[i, side].body != ON_GROUND:
                fill_end(c, d, side, c.end[i, side].body, c.end[i, side].port)
        for side in range(2):
            if c.end[i, side].body != ON_GROUND:
                for place in range(d.speed.shape[0]):
                    _link_row(c, d, i, side, place)


@helper
def _link_row(c, d, i, side, place):
    """The row of one speed that moves an end."""
    a, J = d.end[side], d.passed_row
    moves = False
    for n in range(DIRECTIONS):
        total = 0.0
        for row in range(6):
            total += a[END_MOTION + row, place] * d.link[i, 6 * side + row, n]
        J[n] = total
        moves |= total != 0.0
    if moves:
        add_ends(c, d, i, d.matrix[place], J)


@helper
def add_ends(c, d, i, row, J):
    """row += J (24,) times the changes s0 and s1 of both ends of connector i, by displacement and by speed."""
    nu = d.speed.shape[0]
    for side in range(2):
        if c.end[i, side].body != ON_GROUND:
            add_end(d, side, row, vec6(J, 12 * side), vec6(J, 12 * side + 6), nu)


@helper
def add_end(d, side, row, by_s0, by_s1, nu):
    """row += by_s0 . s0 + by_s1 . s1 of one end, for all displacements, then for all speeds."""
    a = d.end[side]
    for n in range(0, nu, width(d)):
        s0, s1 = strips6(d, a[END_DISPLACED : END_DISPLACED + 6], n), strips6(d, a[END_MOVED : END_MOVED + 6], n)
        put_until(d, row, n, nu - n, strip(d, row, n) + dot6(by_s0, s0) + dot6(by_s1, s1))
        s1 = strips6(d, a[END_SPEED : END_SPEED + 6], n)
        put_until(d, row, nu + n, nu - n, strip(d, row, nu + n) + dot6(by_s1, s1))
