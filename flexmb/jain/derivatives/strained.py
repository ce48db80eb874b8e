"""The force of a beam of level exact and the rows of its modes, without its mass matrix: for duals, O(P) a mode.

M_m alpha_m + b_m is applied, never formed. Outward, the sections of `flexmb.levels.section_motion` move with the modal
accelerations too. The force of each point is then that of its whole acceleration, and by the principle of virtual power
the row of mode n is the sum of these forces times the velocities that a unit speed of the mode gives their points:
inward, forces at sections become forces F on the tangents at the Gauss points of their interval, by the transposed
weights, and on the section at its inboard end; then torques t x F on the sections, which each passes to the one before
it. No velocity of a single mode is needed. Points at the root sit on no section: they move with the body frame, and no
mode moves them.

Only a few modes have derivatives at a time, the `seeds` (first, stop). Sums over all modes are the same along all
directions: `sum_strains` has found them before, and what the seeds change is added to them. What acts at ports of the
body, of known constant forces in body axes, may be `held` at their sections: the rows change with the motion that the
modes give these places, too.

Modal masses beside the points, from a matrix that was added, are constant, as is their share of the rows, which is left
out. Only the derivatives of the rows are right.
"""

from flexmb.jit.features import has
from flexmb.jit.kernel import helper, sweep
from flexmb.levels.section_motion import ANGLE, IDENTITY, LINEAR, SQUARE, STRETCH, WHOLE, ZERO3
from flexmb.spatial.magnus import magnus, magnus_bend, magnus_change, magnus_transposed
from flexmb.spatial.rotation import (
    exponential,
    exponential_coefficients,
    in_powers,
    left_jacobian,
    left_jacobian_rate,
    left_jacobian_times,
)
from flexmb.spatial.rows import column3
from flexmb.spatial.scalar import sincos
from flexmb.spatial.spatial_vector import ZERO6, store6, sum6, vec6
from flexmb.spatial.vector import (
    add,
    add3,
    axpy,
    cross,
    dot,
    mat3,
    matmul,
    rotate_sym,
    scale,
    store3,
    store9,
    sub,
    sym6,
    sym_times,
    times,
    times_t,
    vec3,
)
from flexmb.tables.features import BENT_IN_PLANE, BENT_IN_SPACE


@sweep
def strained_force(c, e, k, A, seeds):
    """The force of body k, body axes, to e.body.hinge_force, and the rows of its modes to e.zf.

    Its modal displacements, speeds and accelerations are in e.eta, e.etad and e.etadd, the velocity of its frame in
    e.body; A is the acceleration of the frame.
    """
    first, stop = c.body[k].section_start, c.body[k].section_stop
    turn_sections(c, e, k, seeds)
    for j in range(first, stop):
        place_section(c, e, k, j)
    F = ZERO6
    for j in range(c.body[k].point_start, c.body[k].point_stop):
        F = sum6(F, _load_of_point(c, e, k, j, A))
    store6(e.body[k].hinge_force, 0, F)
    for n in range(c.body[k].modes):
        e.zf[k, n] = 0.0
    for j in range(stop - 1, first - 1, -1):
        _pass_force(c, e, k, j)
    for j in range(first, stop):
        _take_tangent(c, e, k, j)
    for j in range(stop - 1, first - 1, -1):
        if has(c, BENT_IN_PLANE) and c.body[k].planar:
            moment = dot(vec3(c.body[k].bending_axis, 0), vec3(e.at_section[j].torque, 0))
            for n in range(c.body[k].modes):
                e.zf[k, n] += c.section_rows[j, ANGLE, n] * moment
        elif has(c, BENT_IN_SPACE):
            _pass_torque(c, e, k, j)


@sweep
def turn_sections(c, e, k, seeds):
    """R, w, alpha and the tangents of all sections of body k."""
    for j in range(c.body[k].section_start, c.body[k].section_stop):
        if has(c, BENT_IN_PLANE) and c.body[k].planar:
            _turn_about_axis(c, e, k, j, seeds)
        elif has(c, BENT_IN_SPACE):
            _turn(c, e, k, j, seeds)


@sweep
def sum_strains(c, e, k):
    """The rows of all sections of body k times its modal displacements, speeds and accelerations, without their
    derivatives."""
    for j in range(c.body[k].section_start, c.body[k].section_stop):
        rows, own = c.section_rows[j], e.at_section[j]
        for row in range(12):
            found, rate, faster = 0.0, 0.0, 0.0
            for n in range(c.body[k].modes):
                found += rows[row, n] * e.eta[k, n].real
                rate += rows[row, n] * e.etad[k, n].real
                faster += rows[row, n] * e.etadd[k, n].real
            own.displaced[row], own.rates[row], own.accelerations[row] = found, rate, faster


@helper
def _sum(c, j, row, known, x, seeds):
    """Three rows of section j times one number x (m,) of each mode; `known` (12,): those of `sum_strains`."""
    found = vec3(known, row)
    for n in range(seeds[0], seeds[1]):
        found = axpy(x[n] - x[n].real, column3(c.section_rows[j], row, n), found)
    return found


@sweep
def _integrals(c, j, known, x, seeds):
    """Those of the three integrals of the curvature."""
    whole, linear = _sum(c, j, WHOLE, known, x, seeds), _sum(c, j, LINEAR, known, x, seeds)
    return whole, linear, _sum(c, j, SQUARE, known, x, seeds)


@sweep
def _turn(c, e, k, j, seeds):
    """R, w and alpha of section j from those of the section before."""
    i, own = c.section[j].before, e.at_section[j]
    whole, linear, square = _integrals(c, j, own.displaced, e.eta[k], seeds)
    store3(own.whole, 0, whole)
    store3(own.linear, 0, linear)
    store3(own.square, 0, square)
    turn, at = magnus(whole, linear, square)
    whole, linear, square = _integrals(c, j, own.rates, e.etad[k], seeds)
    rate, bent = magnus_change(at, whole, linear, square), magnus_bend(at, whole, linear, square)
    whole, linear, square = _integrals(c, j, own.accelerations, e.etadd[k], seeds)
    bent = add(bent, magnus_change(at, whole, linear, square))
    p = exponential_coefficients(dot(turn, turn))
    R, omega, alpha = IDENTITY, ZERO3, ZERO3
    if i >= 0:
        R, omega, alpha = mat3(e.section[i].R, 0), vec3(e.section[i].omega, 0), vec3(e.section[i].alpha, 0)
    more = times(R, left_jacobian_times(turn, p, rate))
    bent = times(R, add(left_jacobian_rate(turn, p, rate), left_jacobian_times(turn, p, bent)))
    alpha = add(alpha, add(cross(omega, more), bent))
    _bend(c, e, k, j, matmul(R, exponential(turn, p)), add(omega, more), alpha, seeds)


@sweep
def _turn_about_axis(c, e, k, j, seeds):
    """The same where all sections turn about one axis."""
    axis, own = vec3(c.body[k].bending_axis, 0), e.at_section[j]
    angle, rate, bent = own.displaced[ANGLE], own.rates[ANGLE], own.accelerations[ANGLE]
    for n in range(seeds[0], seeds[1]):
        slope = c.section_rows[j, ANGLE, n]
        angle += (e.eta[k, n] - e.eta[k, n].real) * slope
        rate += (e.etad[k, n] - e.etad[k, n].real) * slope
        bent += (e.etadd[k, n] - e.etadd[k, n].real) * slope
    sine, cosine = sincos(angle)
    _bend(c, e, k, j, in_powers(axis, sine, 1.0 - cosine), scale(rate, axis), scale(bent, axis), seeds)


@sweep
def _bend(c, e, k, j, R, omega, alpha, seeds):
    """Store the turn of section j, and at Gauss points the change of the tangent, its rate and its acceleration."""
    store9(e.section[j].R, 0, R)
    store3(e.section[j].omega, 0, omega)
    store3(e.section[j].alpha, 0, alpha)
    g, own = c.section[j].gauss, e.at_section[j]
    if g < 0:
        return
    at_rest = vec3(c.section[j].tangent, 0)
    stretched, rate, faster = at_rest, ZERO3, ZERO3
    if c.body[k].stretching:
        stretched = add(at_rest, _sum(c, j, STRETCH, own.displaced, e.eta[k], seeds))
        rate = times(R, _sum(c, j, STRETCH, own.rates, e.etad[k], seeds))
        faster = times(R, _sum(c, j, STRETCH, own.accelerations, e.etadd[k], seeds))
    tangent = times(R, stretched)
    store3(e.tangent[g].change, 0, sub(tangent, at_rest))
    turning = cross(omega, tangent)
    store3(own.rate, 0, add(turning, rate))
    turning = cross(omega, add(turning, scale(2.0, rate)))
    store3(e.tangent[g].acceleration, 0, add(add(cross(alpha, tangent), turning), faster))


@sweep
def place_port(c, e, k, j):
    """The same, of section j and the bases before it alone: it carries a port."""
    for i in range(c.body[k].section_start, j):
        if c.section[i].gauss < 0:
            place_section(c, e, k, i)
    place_section(c, e, k, j)


@helper
def place_section(c, e, k, j):
    """Position of section j, its velocity and acceleration; no load yet but what is held there."""
    r, v, a, i = vec3(c.section[j].arm, 0), ZERO3, ZERO3, c.section[j].base
    if i >= 0:
        r, v, a = add(r, vec3(e.section[i].r, 0)), vec3(e.section[i].v, 0), vec3(e.section[i].a, 0)
    first = _first_own(c, k, j)
    for n in range(c.section[j].own_stop - c.section[j].own_start):
        weight, g = c.section_weight[j, n], c.section[j].own_start + n
        r = axpy(weight, vec3(e.tangent[g].change, 0), r)
        v = axpy(weight, vec3(e.at_section[first + n].rate, 0), v)
        a = axpy(weight, vec3(e.tangent[g].acceleration, 0), a)
    store3(e.section[j].r, 0, r)
    store3(e.section[j].v, 0, v)
    store3(e.section[j].a, 0, a)
    torque, force = vec6(e.at_section[j].held, 0)
    store3(e.at_section[j].force, 0, force)
    store3(e.at_section[j].torque, 0, sub(torque, cross(r, force)))
    store3(e.at_section[j].pull, 0, ZERO3)


@helper
def _first_own(c, k, j):
    """The section at the first Gauss point of the interval of section j: they follow its base."""
    return c.body[k].section_start if c.section[j].base < 0 else c.section[j].base + 1


@sweep
def _load_of_point(c, e, k, j, A):
    """The force of point j (6), about the body origin; it is added to the loads of its section, if it is on one."""
    i, mass, spin = c.point[j].section, c.point[j].mass, vec3(e.body[k].velocity, 0)
    R, r, w_rel, v_rel, alpha, a = IDENTITY, vec3(c.point[j].position, 0), ZERO3, ZERO3, ZERO3, ZERO3
    if i >= 0:
        at = e.section[i]
        R, r, w_rel, v_rel = mat3(at.R, 0), vec3(at.r, 0), vec3(at.omega, 0), vec3(at.v, 0)
        alpha, a = vec3(at.alpha, 0), vec3(at.a, 0)
    arm = times(R, vec3(c.point[j].offset, 0))
    r, swing = add(r, arm), cross(w_rel, arm)
    a = add(a, add(cross(alpha, arm), cross(w_rel, swing)))
    a = add(a, cross(spin, add(cross(spin, r), scale(2.0, add(v_rel, swing)))))
    force = scale(mass, add(a, add(A[1], cross(A[0], r))))
    inertia = rotate_sym(R, sym6(c.point[j].inertia, 0))
    turning, whole = add(add(A[0], alpha), cross(spin, w_rel)), add(spin, w_rel)
    torque = add(sym_times(inertia, turning), cross(whole, sym_times(inertia, whole)))
    if i >= 0:
        add3(e.at_section[i].force, 0, force)
        add3(e.at_section[i].torque, 0, add(torque, cross(arm, force)))
    return add(torque, cross(r, force)), force


@sweep
def _pass_force(c, e, k, j):
    """The force at section j, and at those that it is the base of, to the tangents of its interval and to its base."""
    force, first = vec3(e.at_section[j].force, 0), _first_own(c, k, j)
    for n in range(c.section[j].own_stop - c.section[j].own_start):
        add3(e.at_section[first + n].pull, 0, scale(c.section_weight[j, n], force))
    if c.section[j].base >= 0:
        add3(e.at_section[c.section[j].base].force, 0, force)


@sweep
def _take_tangent(c, e, k, j):
    """What the forces at all sections do by the tangent of section j: a torque on it, and the rows of stretch."""
    g = c.section[j].gauss
    if g < 0:
        return
    force = vec3(e.at_section[j].pull, 0)
    tangent = add(vec3(c.section[j].tangent, 0), vec3(e.tangent[g].change, 0))
    add3(e.at_section[j].torque, 0, cross(tangent, force))
    if c.body[k].stretching:
        along = times_t(mat3(e.section[j].R, 0), force)
        for n in range(c.body[k].modes):
            e.zf[k, n] += dot(column3(c.section_rows[j], STRETCH, n), along)


@sweep
def _pass_torque(c, e, k, j):
    """The rows of the modes that turn section j against the one before, which then carries its torque too."""
    i, own = c.section[j].before, e.at_section[j]
    torque = vec3(own.torque, 0)
    turn, at = magnus(vec3(own.whole, 0), vec3(own.linear, 0), vec3(own.square, 0))
    R = IDENTITY
    if i >= 0:
        R = mat3(e.section[i].R, 0)
        add3(e.at_section[i].torque, 0, torque)
    J = matmul(R, left_jacobian(turn, exponential_coefficients(dot(turn, turn))))
    whole, linear, square = magnus_transposed(at, times_t(J, torque))
    for n in range(c.body[k].modes):
        row = dot(column3(c.section_rows[j], WHOLE, n), whole) + dot(column3(c.section_rows[j], LINEAR, n), linear)
        e.zf[k, n] += row + dot(column3(c.section_rows[j], SQUARE, n), square)
