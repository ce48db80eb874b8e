"""Inertia that turns with one point of a body, summed at every evaluation: turning points, wheels, beams of strains.

Angular momentum and force are those of the point's exact motion; nothing is truncated.
"""

from flexmb.jit.features import has
from flexmb.jit.kernel import helper
from flexmb.jit.strips import ROW, add_across, put, strip, width
from flexmb.levels.field import field_motion, second_order_motion
from flexmb.levels.section_motion import section_point_motion
from flexmb.spatial.inertia import add_inertia, rigid_inertia, store_inertia
from flexmb.spatial.rows import column6, strips6
from flexmb.spatial.spatial_vector import ZERO6, plus6
from flexmb.spatial.vector import add, add3, cross, dot, rotate_sym, scale, store3, sym6, sym_add, sym_times, vec3
from flexmb.tables.features import SECTIONS


@helper
def clear_inertia(c, w, k):
    """No rigid inertia, coupling and bias of body k."""
    zero = ZERO6[0]
    store_inertia(w.body[k].inertia, 0, rigid_inertia(0.0, zero, ZERO6[0] + ZERO6[1]))
    store3(w.body[k].force, 0, zero)
    store3(w.body[k].force, 3, zero)
    for n in range(0, c.body[k].modes, width(w)):
        put(w, w.zf[k], n, 0.0)
    for n in range(c.body[k].modes):
        for i in range(0, ROW, width(w)):
            put(w, w.pfr[k, n], i, 0.0)


@helper
def add_points(c, w, k):
    """Add the points of body k."""
    for j in range(c.body[k].point_start, c.body[k].point_stop):
        add_point(c, w, k, j)
    complete_masses(c, w, k)


@helper
def complete_masses(c, w, k):
    """The modal masses below the strips of the diagonal, which `add_point` leaves out, from those above."""
    for n in range(width(w), c.body[k].modes):
        for i in range(n - n % width(w)):
            w.pff[k, n, i] = w.pff[k, i, n]


@helper
def add_point(c, w, k, j):
    """Add point j to body k: mass mu with its centre at R p from the point, inertia R J R' about that centre.

    Of the modal masses what is above the diagonal, and the strips on it; `complete_masses` adds the rest.
    """
    nm = c.body[k].modes
    omega = vec3(w.body[k].velocity, 0)
    mass = c.point[j].mass
    x = vec3(c.point[j].position, 0)
    offset = vec3(c.point[j].offset, 0)
    row, section = c.point[j].second, c.point[j].section
    if has(c, SECTIONS) and section >= 0:
        r, rotation, w_rel, v_rel, alpha_rel, a_rel = section_point_motion(c, w, k, section, offset, w.point_mode)
    elif row >= 0:
        r, rotation, w_rel, v_rel, alpha_rel, a_rel = second_order_motion(
            x, offset, c.point_mode[j], c.second_shape[row], w.eta[k], w.etad[k], nm, w.point_mode
        )
    else:
        r, rotation, w_rel, v_rel, alpha_rel, a_rel = field_motion(
            w, x, offset, c.point_mode[j], w.eta[k], w.etad[k], nm, w.point_mode
        )
    inertia = rotate_sym(rotation, sym6(c.point[j].inertia, 0))
    # about the body origin: the mass mu at r, and the central inertia
    s = scale(mass, r)
    r2 = dot(r, r)
    steiner = (
        mass * (r2 - r[0] * r[0]),
        mass * (r2 - r[1] * r[1]),
        mass * (r2 - r[2] * r[2]),
        -mass * r[0] * r[1],
        -mass * r[0] * r[2],
        -mass * r[1] * r[2],
    )
    add_inertia(w.body[k].inertia, 0, rigid_inertia(mass, s, sym_add(inertia, steiner)))
    # force and torque left at wdot = vdot = etaddot = 0
    spin = add(omega, w_rel)
    acceleration = add(cross(omega, add(cross(omega, r), scale(2.0, v_rel))), a_rel)
    force = scale(mass, acceleration)
    turning = add(alpha_rel, cross(omega, w_rel))
    torque = add(sym_times(inertia, turning), cross(spin, sym_times(inertia, spin)))
    add3(w.body[k].force, 0, add(cross(r, force), torque))
    add3(w.body[k].force, 3, force)
    for n in range(0, nm, width(w)):
        W, L = strips6(w, w.point_mode, n)
        at_mode = add(scale(mass, cross(r, L)), sym_times(inertia, W)), scale(mass, L)
        add_across(w, w.pfr[k], n, at_mode)
        put(w, w.zf[k], n, strip(w, w.zf[k], n) + dot(L, force) + dot(W, torque))
    for n in range(nm):
        W, L = column6(w.point_mode, n)
        momentum = sym_times(inertia, W), scale(mass, L)
        for i in range(n - n % width(w), nm, width(w)):
            put(w, w.pff[k, n], i, plus6(strip(w, w.pff[k, n], i), momentum, strips6(w, w.point_mode, i)))
