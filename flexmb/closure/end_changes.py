"""What every source of motion does to the two frames of a closure: s0, s1 and s2 of `flexmb.jain.derivatives.motion`.

All are in World axes about the origin of frame B; those of A are those of the point of A's body that is there. The
motion of both ends by one source, a displacement, a change of speed or of acceleration of all that it carries, does
nothing to the closure: its rows depend on the difference of the two, in which sources inboard of both ends cancel.
"""

from flexmb.closure.tables import ON_GROUND
from flexmb.jain.derivatives.strips_of import put_strips, six_of, strips_of
from flexmb.jain.derivatives.tables import BY_ACCELERATION, BY_RATE, MOTION, SPEED_BY_ACCELERATION
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, sweep
from flexmb.jit.strips import width
from flexmb.levels.body import is_at_rest
from flexmb.spatial.rows import column6
from flexmb.spatial.spatial_vector import ZERO6, shift_motion, sub6, sum6, vec6
from flexmb.spatial.vector import add, mat3, plus_cross, sub, times, vec3
from flexmb.tables.features import CONNECTORS, LOADS, MODES, OUTBOARD_NODES, WHEELS

# Rows of the changes of an end, six each: its motion at unit speed; s0, s1 and s2 of a displacement; s1 and s2 of a
# change of speed.
MOVING, DISPLACED, BY_PLACE, HURRIED_BY_PLACE, BY_SPEED, HURRIED_BY_SPEED, CHANGES = 0, 6, 12, 18, 24, 30, 36


@helper
def has_ports(c):
    """Whether the derivatives have places, motions and forces of ports, beside those of bodies."""
    return has(c, MODES) or has(c, LOADS) or has(c, WHEELS) or has(c, CONNECTORS)


@helper
def place_of(c, w, d, side):
    """Vector from the base point of an end's body to the end, World axes."""
    k, i = side.body, side.port
    if has_ports(c):
        return vec3(d.port[i].position, 0)
    R, r = mat3(d.body[k].rotation, 0), vec3(d.body[k].position, 0)
    if has(c, OUTBOARD_NODES) and c.body[k].outboard_port >= 0:
        r = sub(r, times(R, vec3(w.port[c.body[k].outboard_port].r, 0)))
    return add(r, times(R, vec3(w.port[i].r, 0)))


@helper
def motion_of(c, w, d, side, r):
    """Velocity and acceleration [angular; of the point], relative to free fall, of what is at r from the base point of
    the body of an end and moves with this end."""
    if side.body == ON_GROUND:
        return ZERO6, (ZERO6[0], vec3(w.ground, 0))
    if has_ports(c):
        V, A = vec6(d.port[side.port].velocity, 0), vec6(d.port[side.port].accel, 0)
    else:
        V, A = vec6(d.body[side.body].velocity, 0), vec6(d.body[side.body].accel, 0)
    V, A = shift_motion(V, r), shift_motion(A, r)
    return V, (A[0], plus_cross(A[1], V[0], V[1]))


@sweep
def fill(c, d, a, side, r):
    """Write the changes of what is at r from the base point of an end's body to a (CHANGES,nu), by place."""
    for row in range(CHANGES):
        for n in range(a.shape[1]):
            a[row, n] = 0.0
    k = side.body
    if has(c, MODES) and k >= 0:
        _by_own_modes(c, d, a, k, side.port, r)
    while k >= 0:
        for n in range(c.body[k].nv):
            _by_slot(d, a, d.places[k].slot + n, d.places[k].hinge + n, r, 1.0)
        p = c.body[k].parent
        if has(c, MODES):
            for n in range(d.places[k].sees):
                moves = 0.0 if is_at_rest(c.body[p].level) else 1.0
                _by_slot(d, a, d.places[k].seen + n, d.places[p].modes + n, r, moves)
        if p >= 0 and d.places[k].new_point:
            r = add(r, vec3(d.body[k].step, 0))
        k = p


@helper
def _by_slot(d, a, slot, place, r, moves):
    J = shift_motion(column6(d.seed, slot), r)
    _store(a, MOVING, place, J, 1.0)
    _store(a, DISPLACED, place, J, moves)
    _store(a, BY_PLACE, place, shift_motion(six_of(d.seed, BY_RATE, slot), r), 1.0)
    _store(a, HURRIED_BY_PLACE, place, shift_motion(six_of(d.seed, BY_ACCELERATION, slot), r), 1.0)
    _store(a, BY_SPEED, place, J, moves)
    _store(a, HURRIED_BY_SPEED, place, shift_motion(six_of(d.seed, SPEED_BY_ACCELERATION, slot), r), 1.0)


@helper
def _by_own_modes(c, d, a, k, port, r):
    """By the modes of the body itself."""
    moves = 0.0 if is_at_rest(c.body[k].level) else 1.0
    for n in range(c.body[k].modes):
        place = d.places[k].modes + n
        J = _of_mode(d, k, port, MOTION, n, r)
        _store(a, MOVING, place, J, 1.0)
        _store(a, DISPLACED, place, J, moves)
        _store(a, BY_PLACE, place, _of_mode(d, k, port, BY_RATE, n, r), 1.0)
        _store(a, HURRIED_BY_PLACE, place, _of_mode(d, k, port, BY_ACCELERATION, n, r), 1.0)
        _store(a, BY_SPEED, place, J, moves)
        _store(a, HURRIED_BY_SPEED, place, _of_mode(d, k, port, SPEED_BY_ACCELERATION, n, r), 1.0)


@helper
def _of_mode(d, k, port, row, n, r):
    """What mode n does to a port of its body, with what it does to the body frame."""
    return shift_motion(sum6(six_of(d.port_mode[port], row, n), six_of(d.frame_mode[k], row, n)), r)


@helper
def _store(a, row, place, V, s):
    for i in range(3):
        a[row + i, place] = s * V[0][i]
        a[row + 3 + i, place] = s * V[1][i]


@sweep
def difference(d, end):
    """end[2] = end[1] - end[0]: the changes of B seen from A."""
    for n in range(0, d.speed.shape[0], width(d)):
        for row in range(0, CHANGES, 6):
            put_strips(d, end[2], row, n, sub6(strips_of(d, end[1], row, n), strips_of(d, end[0], row, n)))
