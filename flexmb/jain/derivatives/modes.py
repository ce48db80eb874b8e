"""Rows and columns of the modes of a body.

What sits on a port moves with it: the mode n with the motion J there adds J'[I D E] of all that is attached to its row,
and X = I s2 + D s1 + E s0 + s0 x* F to its column, of which every mode i of the body feels J_i . X, and the change of
its own motion J_i on F. Where the modes move the body frame against O, the whole body with all that it carries is one
more thing that they move.
"""

from flexmb.jain.derivatives.columns import inboard_columns_of_modes, put_until
from flexmb.jain.derivatives.rows import BY_RATES, BY_SPEED, by_angle, row_by_angle
from flexmb.jain.derivatives.strips_of import put_strips, put_strips_until, six_of, strips_of
from flexmb.jain.derivatives.tables import (
    BY_ACCELERATION,
    BY_RATE,
    MODE_BY_RATE,
    MODE_BY_TURN,
    MODE_FORCE,
    MODE_ROW,
    MOTION,
    SPEED_BY_ACCELERATION,
)
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, sweep
from flexmb.jit.strips import strip, width
from flexmb.levels.body import is_at_rest
from flexmb.spatial.cross6 import force_cross, motion_cross
from flexmb.spatial.inertia import inertia_times, load_inertia
from flexmb.spatial.rows import column3, put3, strips3, strips6
from flexmb.spatial.spatial_vector import dot6, shift_force, sum6, times6_t, vec6
from flexmb.spatial.vector import add, dot, mat3, scale, vec3
from flexmb.tables.features import CONNECTORS, LOADS, OUTBOARD_NODES


@sweep
def mode_rows(c, d, k, masses):
    """Rows and columns of the modes of body k, and those of its hinge and all inboard in its modes' rows."""
    nm, first, mode = c.body[k].modes, d.places[k].modes, d.mode[k]
    outboard = has(c, OUTBOARD_NODES) and c.body[k].outboard_port >= 0
    for n in range(0, nm, width(d)):
        put_strips_until(d, d.force, 0, first + n, nm - n, strips_of(d, mode, MODE_FORCE, n))
        put_strips_until(d, d.force, BY_SPEED, first + n, nm - n, strips_of(d, mode, MODE_FORCE + 6, n))
        put_strips_until(d, d.force, BY_RATES, first + n, nm - n, strips_of(d, mode, MODE_ROW, n))
        for i in range(c.body[k].port_start, c.body[k].port_stop):
            if d.port[i].used:
                _at_port(c, d, k, i, n, masses)
    if outboard:
        for n in range(0, nm, width(d)):
            _move_frame(c, d, k, n)
        for n in range(0, nm, width(d)):
            _add_rows(c, d, mode, n, d.body[k], strips_of(d, d.frame_mode[k], MOTION, n))
    inboard_columns_of_modes(c, d, k, nm, masses)


@helper
def _add_rows(c, d, mode, n, moved, J):
    """Add J'[I D E] of what moves with J to the rows of a strip of modes."""
    inertia = inertia_times(load_inertia(moved.inertia, 0), J)
    put_strips(d, mode, MODE_ROW, n, sum6(strips_of(d, mode, MODE_ROW, n), inertia))
    put3(d, mode, MODE_BY_RATE, n, add(strips3(d, mode, MODE_BY_RATE, n), row_by_angle(moved.by_rate, J)))
    if has(c, LOADS) or has(c, CONNECTORS):
        put3(d, mode, MODE_BY_TURN, n, add(strips3(d, mode, MODE_BY_TURN, n), row_by_angle(moved.by_turn, J)))


@helper
def _changes(c, d, moved, seeds, n, J):
    """Changes of the force on what moves with the seeds of a strip of modes: by displacement and by speed."""
    inertia, D = load_inertia(moved.inertia, 0), moved.by_rate
    s1 = strips3(d, seeds, BY_RATE, n)
    X = sum6(inertia_times(inertia, strips_of(d, seeds, BY_ACCELERATION, n)), by_angle(D, s1))
    X = sum6(X, force_cross(J, vec6(moved.force, 0)))
    if has(c, LOADS) or has(c, CONNECTORS):
        X = sum6(X, by_angle(moved.by_turn, J[0]))
    s2 = strips_of(d, seeds, SPEED_BY_ACCELERATION, n)
    return X, sum6(inertia_times(inertia, s2), by_angle(D, J[0]))


@helper
def _at_port(c, d, k, i, n, masses):
    """What a strip of modes does to all that is attached to port i."""
    first, nm, nu, seeds, port = d.places[k].modes, c.body[k].modes, d.speed.shape[0], d.port_mode[i], d.port[i]
    at, J = first + n, strips_of(d, seeds, MOTION, n)
    inertia = inertia_times(load_inertia(port.inertia, 0), J)
    _add_rows(c, d, d.mode[k], n, port, J)
    _add_force(d, BY_RATES, at, nm - n, inertia)
    if masses:
        for j in range(nm):
            _add_to_row(d, first + j, 2 * nu + at, nm - n, dot6(six_of(seeds, MOTION, j), inertia))
    if is_at_rest(c.body[k].level):
        return
    X, speed = _changes(c, d, port, seeds, n, J)
    _add_force(d, 0, at, nm - n, X)
    _add_force(d, BY_SPEED, at, nm - n, speed)
    F = in_body_axes(mat3(d.body[k].rotation, 0), vec3(port.position, 0), vec6(port.force, 0))
    for j in range(nm):
        Pi = six_of(seeds, MOTION, j)
        _add_to_row(d, first + j, at, nm - n, dot6(Pi, X) + dot6(F, strips6(d, d.bent[i, j], n)))
        _add_to_row(d, first + j, nu + at, nm - n, dot6(Pi, speed))


@helper
def _move_frame(c, d, k, n):
    """What a strip of modes does to the body frame, and with it to the body and all that it carries."""
    first, nm, nu, seeds, own = d.places[k].modes, c.body[k].modes, d.speed.shape[0], d.frame_mode[k], d.body[k]
    at, J, at_rest = first + n, strips_of(d, seeds, MOTION, n), is_at_rest(c.body[k].level)
    s2, s2_speed = strips_of(d, seeds, BY_ACCELERATION, n), strips_of(d, seeds, SPEED_BY_ACCELERATION, n)
    s1 = strips3(d, seeds, BY_RATE, n)
    _add_force(d, BY_RATES, at, nm - n, inertia_times(load_inertia(own.inertia, 0), J))
    if not at_rest:
        X, speed = _changes(c, d, own, seeds, n, J)
        _add_force(d, 0, at, nm - n, X)
        _add_force(d, BY_SPEED, at, nm - n, speed)
    X, speed = strips_of(d, d.force, 0, at), strips_of(d, d.force, BY_SPEED, at)
    inertia = strips_of(d, d.force, BY_RATES, at)
    F = vec6(own.force, 0)
    F_body = in_body_axes(mat3(own.rotation, 0), vec3(own.position, 0), F)
    for j in range(nm):
        J_j, row = six_of(seeds, MOTION, j), six_of(d.mode[k], MODE_ROW, j)
        _add_to_row(d, first + j, 2 * nu + at, nm - n, dot6(row, J) + dot6(J_j, inertia))
        _add_to_row(d, first + j, at, nm - n, dot6(J_j, X))
        _add_to_row(d, first + j, nu + at, nm - n, dot6(J_j, speed))
        if not at_rest:
            l1, l0 = column3(d.mode[k], MODE_BY_RATE, j), column3(d.mode[k], MODE_BY_TURN, j)
            change = dot6(F, motion_cross(J, J_j)) - dot6(F_body, strips6(d, d.bent[c.body[k].outboard_port, j], n))
            change += dot6(row, s2) + dot(l1, s1) + dot(l0, J[0])
            _add_to_row(d, first + j, at, nm - n, change)
            _add_to_row(d, first + j, nu + at, nm - n, dot6(row, s2_speed) + dot(l1, J[0]))


@helper
def _add_to_row(d, place, column, count, x):
    """Add the first `count` elements of a strip to a row of `matrix`."""
    row = d.matrix[place]
    put_until(d, row, column, count, strip(d, row, column) + x)


@helper
def in_body_axes(R, r, F):
    """A force about the base point in World axes, about a point at r in body axes."""
    return times6_t(R, shift_force(F, scale(-1.0, r)))


@helper
def _add_force(d, row, place, count, F):
    """Add forces to the first `count` columns of `force` from `place` on, in six rows from `row` on."""
    put_strips_until(d, d.force, row, place, count, sum6(strips_of(d, d.force, row, place), F))
