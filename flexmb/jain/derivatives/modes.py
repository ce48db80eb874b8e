"""Rows and columns of the modes of a body.

What sits on a port moves with it: the mode n with the motion J there adds J'[I D E] of all that is attached to its row,
and X = I s2 + D s1 + E s0 + s0 x* F to its column, of which every mode i of the body feels J_i . X, and the change of
its own motion J_i on F. Where the modes move the body frame against O, the whole body with all that it carries is one
more thing that they move.
"""

from flexmb.jain.derivatives.columns import inboard_columns
from flexmb.jain.derivatives.rows import BY_RATES, BY_SPEED, by_angle, put_force, row_by_angle, six_of
from flexmb.jit.features import has
from flexmb.jit.kernel import helper
from flexmb.levels.body import is_at_rest
from flexmb.spatial.cross6 import force_cross, motion_cross
from flexmb.spatial.inertia import inertia_times, load_inertia
from flexmb.spatial.spatial_vector import add6, dot6, shift_force, sum6, times6_t, vec6
from flexmb.spatial.vector import add3, dot, mat3, scale, vec3
from flexmb.tables.features import CONNECTORS, LOADS, OUTBOARD_NODES


@helper
def mode_rows(c, d, k, masses):
    """Rows and columns of the modes of body k, and those of its hinge and all inboard in its modes' rows."""
    nm, first = c.body[k].modes, d.places[k].modes
    for n in range(nm):
        mode = d.mode[k, n]
        put_force(d, 0, first + n, vec6(mode.force, 0))
        put_force(d, BY_SPEED, first + n, vec6(mode.force, 6))
        put_force(d, BY_RATES, first + n, vec6(mode.row, 0))
    for i in range(c.body[k].port_start, c.body[k].port_stop):
        if d.port[i].used:
            for n in range(nm):
                _at_port(c, d, k, i, n, masses)
    if has(c, OUTBOARD_NODES) and c.body[k].outboard_port >= 0:
        for n in range(nm):
            _move_frame(c, d, k, n)
        for n in range(nm):
            _add_rows(c, d, d.mode[k, n], d.body[k], vec6(d.frame_mode[k, n].motion, 0))
    for n in range(nm):
        mode = d.mode[k, n]
        l1, l0 = vec3(mode.by_rate, 0), vec3(mode.by_turn, 0)
        inboard_columns(
            c, d, first + n, d.places[k].run, d.places[k].end, vec6(mode.row, 0), l1, l0, masses
        )


@helper
def _add_rows(c, d, mode, moved, J):
    """Add J'[I D E] of what moves with J to the row of a mode."""
    add6(mode.row, 0, inertia_times(load_inertia(moved.inertia, 0), J))
    add3(mode.by_rate, 0, row_by_angle(moved.by_rate, J))
    if has(c, LOADS) or has(c, CONNECTORS):
        add3(mode.by_turn, 0, row_by_angle(moved.by_turn, J))


@helper
def _changes(c, moved, seeds, J):
    """Changes of the force on what moves with the seeds of a mode: by its displacement and by its speed."""
    inertia, D = load_inertia(moved.inertia, 0), moved.by_rate
    X = sum6(inertia_times(inertia, vec6(seeds.by_acceleration, 0)), by_angle(D, vec3(seeds.by_rate, 0)))
    X = sum6(X, force_cross(J, vec6(moved.force, 0)))
    if has(c, LOADS) or has(c, CONNECTORS):
        X = sum6(X, by_angle(moved.by_turn, J[0]))
    speed = sum6(inertia_times(inertia, vec6(seeds.speed_by_acceleration, 0)), by_angle(D, J[0]))
    return X, speed


@helper
def _at_port(c, d, k, i, n, masses):
    """What mode n does to all that is attached to port i."""
    first, nu, seeds, port = d.places[k].modes, d.speed.shape[0], d.port_mode[i, n], d.port[i]
    at, J = first + n, vec6(seeds.motion, 0)
    inertia = inertia_times(load_inertia(port.inertia, 0), J)
    _add_rows(c, d, d.mode[k, n], port, J)
    _add_force(d, BY_RATES, at, inertia)
    if masses:
        for j in range(c.body[k].modes):
            d.matrix[first + j, 2 * nu + at] += dot6(vec6(d.port_mode[i, j].motion, 0), inertia)
    if is_at_rest(c.body[k].level):
        return
    X, speed = _changes(c, port, seeds, J)
    _add_force(d, 0, at, X)
    _add_force(d, BY_SPEED, at, speed)
    F = in_body_axes(mat3(d.body[k].rotation, 0), vec3(port.position, 0), vec6(port.force, 0))
    for j in range(c.body[k].modes):
        Pi = vec6(d.port_mode[i, j].motion, 0)
        d.matrix[first + j, at] += dot6(Pi, X) + dot6(vec6(d.bent[i, n, j], 0), F)
        d.matrix[first + j, nu + at] += dot6(Pi, speed)


@helper
def _move_frame(c, d, k, n):
    """What mode n does to the body frame, and with it to the body and all that it carries."""
    first, nu, seeds, own = d.places[k].modes, d.speed.shape[0], d.frame_mode[k, n], d.body[k]
    at, J, at_rest = first + n, vec6(seeds.motion, 0), is_at_rest(c.body[k].level)
    s2, s2_speed, s1 = vec6(seeds.by_acceleration, 0), vec6(seeds.speed_by_acceleration, 0), vec3(seeds.by_rate, 0)
    _add_force(d, BY_RATES, at, inertia_times(load_inertia(own.inertia, 0), J))
    if not at_rest:
        X, speed = _changes(c, own, seeds, J)
        _add_force(d, 0, at, X)
        _add_force(d, BY_SPEED, at, speed)
    X, speed, inertia = six_of(d.force, 0, at), six_of(d.force, BY_SPEED, at), six_of(d.force, BY_RATES, at)
    F = vec6(own.force, 0)
    F_body = in_body_axes(mat3(own.rotation, 0), vec3(own.position, 0), F)
    for j in range(c.body[k].modes):
        mode, J_j = d.mode[k, j], vec6(d.frame_mode[k, j].motion, 0)
        row = vec6(mode.row, 0)
        d.matrix[first + j, 2 * nu + at] += dot6(row, J) + dot6(J_j, inertia)
        d.matrix[first + j, at] += dot6(J_j, X)
        d.matrix[first + j, nu + at] += dot6(J_j, speed)
        if not at_rest:
            l1, l0 = vec3(mode.by_rate, 0), vec3(mode.by_turn, 0)
            change = dot6(motion_cross(J, J_j), F) - dot6(vec6(d.bent[c.body[k].outboard_port, n, j], 0), F_body)
            d.matrix[first + j, at] += dot6(row, s2) + dot(l1, s1) + dot(l0, J[0]) + change
            d.matrix[first + j, nu + at] += dot6(row, s2_speed) + dot(l1, J[0])


@helper
def in_body_axes(R, r, F):
    """A force about the base point in World axes, about a point at r in body axes."""
    return times6_t(R, shift_force(F, scale(-1.0, r)))


@helper
def _add_force(d, row, place, F):
    """Add a force to column `place` of `force`, from row `row` on."""
    put_force(d, row, place, sum6(six_of(d.force, row, place), F))
