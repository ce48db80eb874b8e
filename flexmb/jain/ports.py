"""Motion of ports: frames fixed to points of a body that may deform, to which hinges, wheels and loads are attached."""

from flexmb.jit.features import has
from flexmb.jit.kernel import helper
from flexmb.jit.strips import strip, width
from flexmb.levels.field import field_motion, second_order_motion
from flexmb.levels.section_motion import section_point_motion
from flexmb.spatial.rows import column6, strips6, total6
from flexmb.spatial.spatial_vector import ZERO6, axpy6, shift_motion, store6, sum6, vec6
from flexmb.spatial.vector import add, cross, mat3, matmul, scale, store3, store9, vec3
from flexmb.tables.features import SECOND_ORDER, SECTIONS


@helper
def move_port(c, w, k, i):
    """Pose and relative motion of port i of body k, from w.eta and w.etad, at level exact from its sections."""
    if c.body[k].modes == 0:
        return  # the pose of a rigid body's port is constant, and the workspace was made with it
    x = vec3(c.port[i].position, 0)
    offset = vec3(c.port[i].offset, 0)
    row, section = c.port[i].second, c.port[i].section
    if has(c, SECTIONS) and section >= 0:
        r, R, w_rel, v_rel, alpha, a = section_point_motion(c, w, k, section, offset, w.port_mode[i])
    elif has(c, SECOND_ORDER) and row >= 0:
        r, R, w_rel, v_rel, alpha, a = second_order_motion(
            x, offset, c.port_mode[i], c.second_shape[row], w.eta[k], w.etad[k], c.body[k].modes, w.port_mode[i]
        )
    else:
        r, R, w_rel, v_rel, alpha, a = field_motion(
            w, x, offset, c.port_mode[i], w.eta[k], w.etad[k], c.body[k].modes, w.port_mode[i]
        )
    store3(w.port[i].r, 0, r)
    store9(w.port[i].R, 0, matmul(R, mat3(c.port[i].frame, 0)))
    store6(w.port[i].v, 0, (w_rel, v_rel))
    store6(w.port[i].a, 0, (alpha, a))


@helper
def mode_motion(w, i, n):
    """Column n of Pi_i: velocity of port i relative to its body at unit speed of mode n, body axes."""
    return column6(w.port_mode[i], n)


@helper
def moved_by_modes(c, w, x, k, i):
    """Pi_i etaddot: the part of the acceleration of port i that the modal accelerations in x cause, body axes."""
    A = ZERO6
    for n in range(0, c.body[k].modes, width(w)):
        A = axpy6(strip(w, x.etadd[k], n), strips6(w, w.port_mode[i], n), A)
    return total6(w, A)


@helper
def port_velocity(w, k, i):
    """Velocity of port i of body k, body axes (5)."""
    return sum6(shift_motion(vec6(w.body[k].velocity, 0), vec3(w.port[i].r, 0)), vec6(w.port[i].v, 0))


@helper
def port_bias(w, k, i):
    """Acceleration of port i when the body origin has none and etaddot = 0, body axes.

    The relative acceleration of the field, w x w_rel and w x (w x r) + 2 w x v_rel.
    """
    omega = vec3(w.body[k].velocity, 0)
    w_rel, v_rel = vec6(w.port[i].v, 0)
    inner = add(cross(omega, vec3(w.port[i].r, 0)), scale(2.0, v_rel))
    return sum6(vec6(w.port[i].a, 0), (cross(omega, w_rel), cross(omega, inner)))


@helper
def port_acceleration(c, w, k, i):
    """Acceleration of port i relative to free fall, body axes."""
    A = sum6(port_bias(w, k, i), shift_motion(vec6(w.body[k].accel, 0), vec3(w.port[i].r, 0)))
    return sum6(A, moved_by_modes(c, w, w, k, i))
