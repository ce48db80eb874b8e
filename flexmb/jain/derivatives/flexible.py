"""The force of a flexible body's own inertia and elasticity, and how it changes: the level's kernels with dual numbers.

The directions are the three components of the angular velocity, then the displacements and the speeds of the modes;
none leaves the body. Accelerations stay: a change s1 = (x, y) adds x x w and 2 x x v to them, with the velocity v of
the origin of the body frame.
"""

from flexmb.jain.derivatives import affine
from flexmb.jain.derivatives.hinges import force_to_world
from flexmb.jain.derivatives.modes import in_body_axes
from flexmb.jain.derivatives.ports import seed_mode
from flexmb.jain.derivatives.strained import strained_force, sum_strains
from flexmb.jain.derivatives.strips_of import put_strips, strips_of
from flexmb.jain.derivatives.tables import MODE_BY_RATE, MODE_BY_TURN, MODE_FORCE, MODE_ROW, MODE_ROWS
from flexmb.jit.duals import RATES, rate, seeded
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, sweep
from flexmb.jit.strips import put, strip, width
from flexmb.levels import exact, full
from flexmb.levels.body import LEVELS, inertia_of_points, is_at_rest
from flexmb.levels.section_motion import move_sections
from flexmb.spatial.inertia import inertia_times, load_inertia, rotate_inertia, shift_inertia, store_inertia
from flexmb.spatial.rows import column3, put3, store_column3, strips3
from flexmb.spatial.spatial_vector import (
    ZERO6,
    add6,
    axpy6,
    plus6,
    scale6,
    shift_motion,
    store6,
    sum6,
    times6_t,
    vec6,
)
from flexmb.spatial.vector import add, cross, mat3, scale, times, vec3
from flexmb.tables.features import LEVEL, OUTBOARD_NODES, SECTIONS

FULL_NUMBER = LEVELS.index(full.LEVEL)
FULL = f"{LEVEL} {FULL_NUMBER}"
EXACT_NUMBER = LEVELS.index(exact.LEVEL)
EXACT = f"{LEVEL} {EXACT_NUMBER}"


@helper
def flexible_force(c, w, d, k):
    """Inertia, `by_rate` and force of body k alone, and the rows and columns of its modes."""
    R, V, A = mat3(d.body[k].rotation, 0), vec6(w.body[k].velocity, 0), _acceleration(d, k)
    if has(c, FULL) and c.body[k].level == FULL_NUMBER and c.body[k].point_start == c.body[k].point_stop:
        _in_floats(c, w, d, k, V, A)
        affine.differentiate(c, w, d, k, V, A)
        _to_world(c, d, d.plain, k, R)
        _elastic_rows(c, d, d.plain, k)
    elif has(c, EXACT) and c.body[k].level == EXACT_NUMBER:
        _in_floats(c, w, d, k, V, A)
        _exact_by_rates(c, w, d, k, V, A)
        _with_the_motion(d.plain, d, c.body[k].modes, k, V)
        _to_world(c, d, d.plain, k, R)
        _elastic_rows(c, d, d.plain, k)
    else:
        _by_duals(c, w, d, k, V, A)
        _with_the_motion(d.duals, d, c.body[k].modes, k, V)
        _to_world(c, d, d.duals, k, R)
        _elastic_rows(c, d, d.duals, k)


@sweep
def _in_floats(c, w, d, k, V, A):
    """The force of body k and its masses, to `plain`."""
    e = d.plain
    store6(e.body[k].velocity, 0, V)
    for n in range(0, c.body[k].modes, width(e)):
        put(e, e.eta[k], n, strip(w, w.eta[k], n))
        put(e, e.etad[k], n, strip(w, w.etad[k], n))
    if has(c, SECTIONS):
        move_sections(c, e, k)
    if has(c, FULL) and c.body[k].level == FULL_NUMBER:
        full.inertia_and_bias(c, e, k)
    elif has(c, EXACT):
        exact.inertia_and_bias(c, e, k)
    _force(c, w, e, k, A)


@sweep
def _by_duals(c, w, d, k, V, A):
    """The derivatives of the force and of the rows of the modes, along one direction in each lane."""
    nm = c.body[k].modes
    _enter(c, w, d.duals, k, V)
    if is_at_rest(c.body[k].level):
        _no_rows(d, k, nm)
    _along(c, w, d, k, A, 0, 3 if is_at_rest(c.body[k].level) else 3 + 2 * nm)


@helper
def _enter(c, w, e, k, V):
    """The state of body k to the workspace of duals."""
    store6(e.body[k].velocity, 0, V)
    for n in range(c.body[k].modes):
        e.eta[k, n], e.etad[k, n] = w.eta[k, n], w.etad[k, n]
        e.etadd[k, n] = w.speed[c.body[k].etad_index + n].acceleration


@sweep
def _along(c, w, d, k, A, start, stop):
    """The same along the directions start .. stop, at level exact of one kind."""
    e, nm = d.duals, c.body[k].modes
    for first in range(start, stop, RATES):
        count = min(RATES, stop - first)
        for lane in range(count):
            _seed(e, k, nm, first + lane, lane)
        if has(c, EXACT) and c.body[k].level == EXACT_NUMBER:
            mode = first - 3 if first < 3 + nm else first - 3 - nm
            strained_force(c, e, k, A, (max(mode, 0), mode + count if first >= 3 else 0))
        else:
            inertia_of_points(c, e, k)
            _force(c, w, e, k, A)
        for lane in range(count):
            _keep(c, w, d, k, first + lane, lane)


@sweep
def _exact_by_rates(c, w, d, k, V, A):
    """At level exact, outward: by angular velocity and speeds. By displacements see `bend`."""
    nm, first, nu = c.body[k].modes, d.places[k].modes, d.speed.shape[0]
    moves = V[0][0] != 0.0 or V[0][1] != 0.0 or V[0][2] != 0.0
    for n in range(nm):
        moves = moves or w.etad[k, n] != 0.0
    if moves:
        _enter(c, w, d.duals, k, V)
        sum_strains(c, d.duals, k)
        _along(c, w, d, k, A, 0, 3)
        _along(c, w, d, k, A, 3 + nm, 3 + 2 * nm)
        return
    for i in range(6):  # the force is quadratic in all rates
        for n in range(3):
            d.local[i, n] = 0.0
        for n in range(nm):
            d.mode[k, MODE_FORCE + 6 + i, n] = 0.0
    for i in range(nm):
        for n in range(3):
            d.mode[k, MODE_BY_RATE + n, i] = 0.0
        for n in range(nm):
            d.matrix[first + i, nu + first + n] = 0.0


@helper
def bend(c, w, d, k):
    """At level exact, inward, before the answers of the ports of body k: what its displacements change."""
    if has(c, EXACT) and c.body[k].level == EXACT_NUMBER and c.body[k].modes > 0:
        _exact_by_displacements(c, w, d, k)


@sweep
def _exact_by_displacements(c, w, d, k):
    """The rows and the force by displacements, of the rows also what the ports carry."""
    R, origin, A = mat3(d.body[k].rotation, 0), vec3(d.body[k].origin, 0), _acceleration(d, k)
    e, nm, first, whole = d.duals, c.body[k].modes, d.places[k].modes, vec6(d.body[k].force, 0)
    _enter(c, w, e, k, vec6(w.body[k].velocity, 0))
    sum_strains(c, e, k)
    for j in range(c.body[k].section_start, c.body[k].section_stop):
        store6(e.at_section[j].held, 0, ZERO6)
    for i in range(c.body[k].port_start, c.body[k].port_stop):
        if d.port[i].used:
            whole = sum6(whole, vec6(d.port[i].force, 0))
            _hold(c, e, i, in_body_axes(R, origin, vec6(d.port[i].force, 0)))
    if has(c, OUTBOARD_NODES) and c.body[k].outboard_port >= 0:
        _hold(c, e, c.body[k].outboard_port, in_body_axes(R, origin, scale6(-1.0, whole)))
    _along(c, w, d, k, A, 3, 3 + nm)
    for n in range(0, nm, width(d)):
        put_strips(d, d.mode[k], MODE_FORCE, n, force_to_world(R, origin, strips_of(d, d.mode[k], MODE_FORCE, n)))
    for i in range(nm):
        for n in range(nm):
            d.matrix[first + i, first + n] += c.stiffness[k, i, n]


@helper
def _hold(c, e, i, F):
    """Let a force (6) about the body origin act at the section of port i; the modes do not move other ports."""
    if c.port[i].section >= 0:
        add6(e.at_section[c.port[i].section].held, 0, F)


@helper
def _no_rows(d, k, nm):
    """The modes' rows of their own displacements and speeds, without elasticity, at rest shape."""
    first, nu = d.places[k].modes, d.speed.shape[0]
    for i in range(nm):
        for n in range(nm):
            d.matrix[first + i, first + n] = 0.0
            d.matrix[first + i, nu + first + n] = 0.0


@helper
def _with_the_motion(e, d, nm, k, V):
    """Add what the changes x x w and 2 x x v of the acceleration do to `local` and to the rows of the modes."""
    inertia = _inertia(e, k)
    for j in range(3):
        x = (1.0 if j == 0 else 0.0, 1.0 if j == 1 else 0.0, 1.0 if j == 2 else 0.0)
        torque, force = inertia_times(inertia, (cross(x, V[0]), scale(2.0, cross(x, V[1]))))
        for i in range(3):
            d.local[i, j] += torque[i]
            d.local[3 + i, j] += force[i]
    for n in range(nm):
        # M_fr . (x x w, 2 x x v) = x . (w x angular part + 2 v x linear part)
        M_fr = _six(e.pfr[k, n], 0)
        change = add(cross(V[0], M_fr[0]), scale(2.0, cross(V[1], M_fr[1])))
        store_column3(d.mode[k], MODE_BY_RATE, n, add(column3(d.mode[k], MODE_BY_RATE, n), change))


@helper
def _acceleration(d, k):
    """Classical acceleration of the origin of body k, relative to free fall, body axes."""
    R, origin = mat3(d.body[k].rotation, 0), vec3(d.body[k].origin, 0)
    V, A = shift_motion(vec6(d.body[k].velocity, 0), origin), shift_motion(vec6(d.body[k].accel, 0), origin)
    return times6_t(R, (A[0], add(A[1], cross(V[0], V[1]))))


@helper
def _seed(e, k, nm, n, lane):
    if n < 3:
        e.body[k].velocity[n] = seeded(e.body[k].velocity[n], lane)
    else:
        seed_mode(e, k, nm, n - 3, lane)


@helper
def _force(c, w, e, k, A):
    """f_m = M_m alpha_m + b_m, as `flexmb.jain.inverse` has it, of another workspace e: to its hinge_force and zf."""
    nm, first = c.body[k].modes, c.body[k].etad_index
    F = inertia_times(load_inertia(e.body[k].inertia, 0), A)
    for n in range(nm):
        M_fr = vec6(e.pfr[k, n], 0)
        F = axpy6(w.speed[first + n].acceleration, M_fr, F)
        row = plus6(e.zf[k, n], M_fr, A)
        for i in range(nm):
            row += e.pff[k, n, i] * w.speed[first + i].acceleration
        e.zf[k, n] = row
    store6(e.body[k].hinge_force, 0, F)
    for i in range(6):
        e.body[k].hinge_force[i] += e.body[k].force[i]


@helper
def _keep(c, w, d, k, n, lane):
    """The derivatives along one lane; the seed of this direction is removed."""
    e, nm, nu = d.duals, c.body[k].modes, d.speed.shape[0]
    first = d.places[k].modes
    if n < 3:
        e.body[k].velocity[n] = w.body[k].velocity[n]
        for i in range(6):
            d.local[i, n] = rate(e.body[k].hinge_force[i], lane)
        for i in range(nm):
            d.mode[k, MODE_BY_RATE + n, i] = rate(e.zf[k, i], lane)
        return
    speed = 0 if n < 3 + nm else 1
    n -= 3 + speed * nm
    if speed:
        e.etad[k, n] = w.etad[k, n]
    else:
        e.eta[k, n] = w.eta[k, n]
    for i in range(6):
        d.mode[k, MODE_FORCE + 6 * speed + i, n] = rate(e.body[k].hinge_force[i], lane)
    for i in range(nm):
        d.matrix[first + i, speed * nu + first + n] = rate(e.zf[k, i], lane)


@sweep
def _to_world(c, d, e, k, R):
    """The numbers of the body, which are in e and in body axes, in World axes about the base point."""
    nm, origin = c.body[k].modes, vec3(d.body[k].origin, 0)
    store6(d.body[k].force, 0, force_to_world(R, origin, _six(e.body[k].hinge_force, 0)))
    for j in range(3):
        # R[3j] ..: the unit vector j of World in body axes
        D = axpy6(R[3 * j], _column(d.local, 0), ZERO6)
        D = axpy6(R[3 * j + 2], _column(d.local, 2), axpy6(R[3 * j + 1], _column(d.local, 1), D))
        torque, force = force_to_world(R, origin, D)
        for i in range(3):
            d.body[k].by_rate[3 * i + j] = torque[i]
            d.body[k].by_rate[9 + 3 * i + j] = force[i]
    store_inertia(d.body[k].inertia, 0, shift_inertia(rotate_inertia(R, _inertia(e, k)), origin))
    mode = d.mode[k]
    for n in range(nm):
        M_fr = _six(e.pfr[k, n], 0)
        store_column3(mode, MODE_ROW, n, M_fr[0])
        store_column3(mode, MODE_ROW + 3, n, M_fr[1])
    zero = (0.0, 0.0, 0.0)
    for n in range(0, nm, width(d)):
        put3(d, mode, MODE_BY_RATE, n, times(R, strips3(d, mode, MODE_BY_RATE, n)))
        put3(d, mode, MODE_BY_TURN, n, zero)
        put_strips(d, mode, MODE_ROW, n, force_to_world(R, origin, strips_of(d, mode, MODE_ROW, n)))
        for row in range(MODE_FORCE, MODE_ROWS, 6):
            put_strips(d, mode, row, n, force_to_world(R, origin, strips_of(d, mode, row, n)))


@helper
def _column(a, n):
    return (a[0, n], a[1, n], a[2, n]), (a[3, n], a[4, n], a[5, n])


@helper
def _six(a, i):
    """Six numbers, or those of duals."""
    return (a[i].real, a[i + 1].real, a[i + 2].real), (a[i + 3].real, a[i + 4].real, a[i + 5].real)


@helper
def _inertia(e, k):
    """The numbers of the body's spatial inertia."""
    a = e.body[k].inertia
    return (
        (a[0].real, a[1].real, a[2].real, a[3].real, a[4].real, a[5].real),
        (
            a[6].real, a[7].real, a[8].real, a[9].real, a[10].real, a[11].real, a[12].real, a[13].real, a[14].real,
        ),
        (a[15].real, a[16].real, a[17].real, a[18].real, a[19].real, a[20].real),
    )  # fmt: skip


@helper
def _elastic_rows(c, d, e, k):
    """Stiffness and damping of the modes, and their masses in the third part of `matrix`."""
    first, nm, nu = d.places[k].modes, c.body[k].modes, d.speed.shape[0]
    for i in range(nm):
        for n in range(nm):
            d.matrix[first + i, first + n] += c.stiffness[k, i, n]
            d.matrix[first + i, nu + first + n] += c.damping[k, i, n]
            d.matrix[first + i, 2 * nu + first + n] = e.pff[k, i, n].real
