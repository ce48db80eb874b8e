"""Motion of the sections of a beam of level exact, from its strains; `flexmb.modal.strain_field` has the equations.

All components are in body axes, relative to the body, whose frame is fixed to the root. R is the rotation of a section
from its unloaded position. Velocities and accelerations are the exact derivatives of the discrete map from eta to R and
r, so that the sum over the inertia points is the kinetic energy of a true motion, whatever the number of points:

    w_j = w_i + R_i J_l(Omega) Omega'        alpha_j = alpha_i + w_i x (w_j - w_i) + R_i (J_l' Omega' + J_l Omega'')

with section i before j, Omega of `flexmb.spatial.magnus`, Omega'' at etaddot = 0. W and L are angular and linear
velocity at unit modal speeds.
"""

from flexmb.jit.features import has
from flexmb.jit.kernel import helper
from flexmb.jit.strips import strip, total, width
from flexmb.spatial.magnus import magnus, magnus_bend, magnus_change
from flexmb.spatial.rotation import (
    exponential,
    exponential_coefficients,
    in_powers,
    left_jacobian,
    left_jacobian_rate,
    left_jacobian_times,
)
from flexmb.spatial.rows import put3, put6, strips3, strips6, total3
from flexmb.spatial.scalar import sincos
from flexmb.spatial.spatial_vector import ZERO6
from flexmb.spatial.vector import (
    add,
    axpy,
    cross,
    dot,
    mat3,
    matmul,
    scale,
    store3,
    store9,
    sub,
    times,
    vec3,
)
from flexmb.tables.features import BENT_IN_PLANE, BENT_IN_SPACE

ZERO3 = ZERO6[0]
IDENTITY = 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0
WHOLE, LINEAR, SQUARE, STRETCH = 0, 3, 6, 9  # rows of `section_rows`; in the plane row ANGLE alone has the turn
ANGLE = 0


@helper
def move_sections(c, w, k):
    """Rotation and position of all sections of body k, their velocities, accelerations and W, L, from w.eta, w.etad."""
    if has(c, BENT_IN_PLANE) and c.body[k].planar:
        for j in range(c.body[k].section_start, c.body[k].section_stop):
            _turn_about_axis(c, w, k, j)
    elif has(c, BENT_IN_SPACE):
        for j in range(c.body[k].section_start, c.body[k].section_stop):
            _turn(c, w, k, j)
    for j in range(c.body[k].section_start, c.body[k].section_stop):
        _place(c, w, k, j)


@helper
def _turn(c, w, k, j):
    """R, w, alpha and W of section j from those of the section before."""
    i = c.section[j].before
    rows = c.section_rows[j]
    whole, linear, square = ZERO3, ZERO3, ZERO3
    whole_rate, linear_rate, square_rate = ZERO3, ZERO3, ZERO3
    for n in range(0, c.body[k].modes, width(w)):
        eta, etad = strip(w, w.eta[k], n), strip(w, w.etad[k], n)
        first, second, third = strips3(w, rows, WHOLE, n), strips3(w, rows, LINEAR, n), strips3(w, rows, SQUARE, n)
        whole, whole_rate = axpy(eta, first, whole), axpy(etad, first, whole_rate)
        linear, linear_rate = axpy(eta, second, linear), axpy(etad, second, linear_rate)
        square, square_rate = axpy(eta, third, square), axpy(etad, third, square_rate)
    whole, linear, square = total3(w, whole), total3(w, linear), total3(w, square)
    whole_rate, linear_rate, square_rate = total3(w, whole_rate), total3(w, linear_rate), total3(w, square_rate)
    turn, at = magnus(whole, linear, square)
    rate = magnus_change(at, whole_rate, linear_rate, square_rate)
    bias = magnus_bend(at, whole_rate, linear_rate, square_rate)
    p = exponential_coefficients(dot(turn, turn))
    R, omega, alpha = IDENTITY, ZERO3, ZERO3
    if i >= 0:
        R, omega, alpha = mat3(w.section[i].R, 0), vec3(w.section[i].omega, 0), vec3(w.section[i].alpha, 0)
    J = matmul(R, left_jacobian(turn, p))
    more = times(J, rate)
    bent = times(R, add(left_jacobian_rate(turn, p, rate), left_jacobian_times(turn, p, bias)))
    alpha = add(alpha, add(cross(omega, more), bent))
    for n in range(0, c.body[k].modes, width(w)):
        first, second, third = strips3(w, rows, WHOLE, n), strips3(w, rows, LINEAR, n), strips3(w, rows, SQUARE, n)
        W = times(J, magnus_change(at, first, second, third))
        if i >= 0:
            W = add(W, strips3(w, w.section_mode[i], 0, n))
        put3(w, w.section_mode[j], 0, n, W)
    _bend(c, w, k, j, matmul(R, exponential(turn, p)), add(omega, more), alpha)


@helper
def _turn_about_axis(c, w, k, j):
    """The same where all sections turn about one axis: the angles add up."""
    axis, rows = vec3(c.body[k].bending_axis, 0), c.section_rows[j]
    angle, rate = 0.0, 0.0
    for n in range(0, c.body[k].modes, width(w)):
        slope = strip(w, rows[ANGLE], n)
        angle = strip(w, w.eta[k], n) * slope + angle
        rate = strip(w, w.etad[k], n) * slope + rate
        put3(w, w.section_mode[j], 0, n, scale(slope, axis))
    sine, cosine = sincos(total(w, angle))
    # 1 + sin axis~ + (1 - cos) axis~^2
    R = in_powers(axis, sine, 1.0 - cosine)
    _bend(c, w, k, j, R, scale(total(w, rate), axis), ZERO3)


@helper
def _bend(c, w, k, j, R, omega, alpha):
    """Store the turn of section j, and at Gauss points the tangent, its derivatives and its columns."""
    store9(w.section[j].R, 0, R)
    store3(w.section[j].omega, 0, omega)
    store3(w.section[j].alpha, 0, alpha)
    g = c.section[j].gauss
    if g < 0:
        return
    rows = c.section_rows[j]
    stretch, stretch_rate = ZERO3, ZERO3
    if c.body[k].stretching:
        for n in range(0, c.body[k].modes, width(w)):
            shape = strips3(w, rows, STRETCH, n)
            stretch = axpy(strip(w, w.eta[k], n), shape, stretch)
            stretch_rate = axpy(strip(w, w.etad[k], n), shape, stretch_rate)
        stretch, stretch_rate = total3(w, stretch), times(R, total3(w, stretch_rate))
    at_rest = vec3(c.section[j].tangent, 0)
    tangent = times(R, add(at_rest, stretch))
    store3(w.tangent[g].change, 0, sub(tangent, at_rest))
    turning = add(cross(omega, tangent), scale(2.0, stretch_rate))
    store3(w.tangent[g].acceleration, 0, add(cross(alpha, tangent), cross(omega, turning)))
    for n in range(0, c.body[k].modes, width(w)):
        column = cross(strips3(w, w.section_mode[j], 0, n), tangent)
        if c.body[k].stretching:
            column = add(column, times(R, strips3(w, rows, STRETCH, n)))
        put3(w, w.tangent_mode[g], 0, n, column)


@helper
def _place(c, w, k, j):
    """Position of section j, its velocity and acceleration and L: those of its base, and the tangents at the Gauss
    points of its interval, integrated."""
    weight, i, first, stop = c.section_weight[j], c.section[j].base, c.section[j].own_start, c.section[j].own_stop
    r, a = vec3(c.section[j].arm, 0), ZERO3
    if i >= 0:
        r, a = add(r, vec3(w.section[i].r, 0)), vec3(w.section[i].a, 0)
    for g in range(first, stop):
        r = axpy(weight[g - first], vec3(w.tangent[g].change, 0), r)
        a = axpy(weight[g - first], vec3(w.tangent[g].acceleration, 0), a)
    v = ZERO3
    for n in range(0, c.body[k].modes, width(w)):
        L = ZERO3
        if i >= 0:
            L = strips3(w, w.section_mode[i], 3, n)
        for g in range(first, stop):
            L = axpy(weight[g - first], strips3(w, w.tangent_mode[g], 0, n), L)
        put3(w, w.section_mode[j], 3, n, L)
        v = axpy(strip(w, w.etad[k], n), L, v)
    store3(w.section[j].r, 0, r)
    store3(w.section[j].v, 0, total3(w, v))
    store3(w.section[j].a, 0, a)


@helper
def section_point_motion(c, w, k, j, offset, columns):
    """Motion of a point fixed to section j at `offset` (3), in body axes at rest; as `flexmb.levels.field` returns it.

    The sections must have been moved. Writes columns (6,m) [W; L] of the point.
    """
    R, omega, alpha = mat3(w.section[j].R, 0), vec3(w.section[j].omega, 0), vec3(w.section[j].alpha, 0)
    arm = times(R, offset)
    swing = cross(omega, arm)
    for n in range(0, c.body[k].modes, width(w)):
        W, L = strips6(w, w.section_mode[j], n)
        put6(w, columns, n, (W, add(L, cross(W, arm))))
    a = add(vec3(w.section[j].a, 0), add(cross(alpha, arm), cross(omega, swing)))
    return add(vec3(w.section[j].r, 0), arm), R, omega, add(vec3(w.section[j].v, 0), swing), alpha, a
