"""Modes and wheels in the solution for many columns: the same steps as `flexmb.jain.innovations` takes for one."""

from flexmb.jain.derivatives.attached import wheel_axis
from flexmb.jain.derivatives.blocks import along, block, less, plus, plus6, put_block, scaled
from flexmb.jain.derivatives.tables import MOTION
from flexmb.jit.kernel import helper
from flexmb.spatial.rows import column3, column6
from flexmb.spatial.spatial_vector import vec6
from flexmb.spatial.vector import add, dot


@helper
def release_wheels(c, w, d, k, at, z):
    """y = -T of the wheels of body k, and what their torques add to z and to the modes."""
    zero = (0.0, 0.0, 0.0)
    for i in range(c.body[k].wheel_start, c.body[k].wheel_stop):
        row = d.matrix[d.places[k].wheels + i - c.body[k].wheel_start]
        T = block(d, row, at)
        if c.speed[c.wheel[i].u_index].prescribed >= 0:
            put_block(d, row, at, scaled(0.0, T))
        else:
            y, axis = scaled(-1.0, T), wheel_axis(c, w, d, k, i)
            put_block(d, row, at, y)
            z = plus6((axis, zero), y, z)
            for n in range(c.body[k].modes):
                mode = d.matrix[d.places[k].modes + n]
                put_block(d, mode, at, plus(dot(_turn(d, k, c.wheel[i].port, n), axis), y, block(d, mode, at)))
    return z


@helper
def answer_wheels(c, w, d, k, at, A):
    """x = y / I - q . alpha of the nodes of the free wheels."""
    zero = (0.0, 0.0, 0.0)
    for i in range(c.body[k].wheel_start, c.body[k].wheel_stop):
        if c.speed[c.wheel[i].u_index].prescribed < 0:
            row, axis = d.matrix[d.places[k].wheels + i - c.body[k].wheel_start], wheel_axis(c, w, d, k, i)
            x = less(scaled(1.0 / c.wheel[i].axial, block(d, row, at)), along((axis, zero), A))
            for n in range(c.body[k].modes):
                turn = -dot(_turn(d, k, c.wheel[i].port, n), axis)
                x = plus(turn, block(d, d.matrix[d.places[k].modes + n], at), x)
            put_block(d, row, at, x)


@helper
def _turn(d, k, port, n):
    """Angular velocity of a port of body k at unit speed of mode n while O is at rest."""
    return add(column3(d.port_mode[port], MOTION, n), column3(d.frame_mode[k], MOTION, n))


@helper
def release_modes(c, w, d, k, at, z):
    """D^-1 epsilon of the modes of body k, and z + L^-1 P_fr of them."""
    first = d.places[k].modes
    for n in range(c.body[k].modes):
        y = scaled(-1.0, block(d, d.matrix[first + n], at))
        for i in range(n):
            y = plus(-w.pff[k, i, n], block(d, d.matrix[first + i], at), y)
        y = scaled(w.inverse_pivot[k, n], y)
        put_block(d, d.matrix[first + n], at, y)
        z = plus6(vec6(d.gain[first + n], 0), y, z)
    return z


@helper
def answer_modes(c, w, d, k, at, A):
    """Accelerations of the modes of body k from the acceleration A of O."""
    first, nm = d.places[k].modes, c.body[k].modes
    for n in range(nm - 1, -1, -1):
        row = d.matrix[first + n]
        x = less(scaled(w.pff[k, n, n], block(d, row, at)), along(vec6(d.gain[first + n], 0), A))
        for i in range(n + 1, nm):
            x = plus(-w.pff[k, n, i], block(d, d.matrix[first + i], at), x)
        put_block(d, row, at, scaled(w.inverse_pivot[k, n], x))


@helper
def load_modes(c, d, k, at, z):
    """What the force of body k does to the modes of its parent."""
    p = c.body[k].parent
    for n in range(d.places[k].sees):
        row = d.matrix[d.places[p].modes + n]
        force = along(column6(d.seed, d.places[k].seen + n), z)
        put_block(d, row, at, plus(1.0, block(d, row, at), force))


@helper
def moved_by_modes(c, d, k, at, A):
    """A and the acceleration of the inboard port of body k by the modes of its parent."""
    p = c.body[k].parent
    for n in range(d.places[k].sees):
        x = block(d, d.matrix[d.places[p].modes + n], at)
        A = plus6(column6(d.seed, d.places[k].seen + n), x, A)
    return A
