"""Derivatives of the power of all forces without a potential, the last row of a Jacobian.

The power of a drive is that of the load that its row of the inverse dynamics has; the loads of springs and dampers are
those of `applied`; a load at a node has the power of its velocity.
"""

from flexmb.jain.derivatives.connected import add_end, add_ends
from flexmb.jain.derivatives.ends import fill_end
from flexmb.jit.duals import rate
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, sweep
from flexmb.spatial.spatial_vector import shift_motion, vec6
from flexmb.spatial.vector import add, cross, mat3, scale, times, vec3
from flexmb.tables.arrays import FORCE, ON_GROUND, WORLD_AXES
from flexmb.tables.features import (
    CONNECTORS,
    COORDINATE_LAWS,
    DAMPERS,
    HINGE_SPRINGS,
    LOADS,
    MODAL_DAMPING,
    MODES,
    MOTORS,
    PRESCRIBED,
)


@sweep
def differentiate_power(c, w, d):
    """Write `work` from `matrix` before its solution: with M in its third part where anything is prescribed."""
    nu = w.u.shape[0]
    for n in range(3 * nu):
        d.work[n] = 0.0
    for j in range(nu):
        place = d.place[j]
        if has(c, DAMPERS):
            d.work[nu + place] -= 2.0 * c.speed[j].damping * w.u[j]
        if has(c, MOTORS) and c.speed[j].motor >= 0:
            d.work[nu + place] += w.function[c.speed[j].motor, 0]
        if has(c, PRESCRIBED) and c.speed[j].prescribed >= 0:
            row = d.matrix[place]
            for n in range(3 * nu):
                d.work[n] += w.u[j] * row[n]
    if has(c, HINGE_SPRINGS):
        for i in range(c.hinge_spring.shape[0]):
            _along(d, nu, d.place[c.hinge_spring[i].speed], d.duals.hinge_spring[i])
    if has(c, COORDINATE_LAWS):
        for i in range(c.coordinate_law.shape[0]):
            _along(d, nu, d.place[c.coordinate_law[i].speed], d.duals.coordinate_law[i])
    for k in range(c.body.shape[0]):
        if has(c, MODES) and has(c, MODAL_DAMPING):
            _modal_damping(c, w, d, k, nu)
        if has(c, LOADS):
            for i in range(c.body[k].load_start, c.body[k].load_stop):
                _load(c, w, d, k, i, nu)
    if has(c, CONNECTORS):
        for i in range(c.connector.shape[0]):
            for side in range(2):
                if c.end[i, side].body != ON_GROUND:
                    fill_end(c, d, side, c.end[i, side].body, c.end[i, side].port)
            add_ends(c, d, i, d.work, d.link[i, 12])


@helper
def _along(d, nu, place, law):
    """The power of a law along a coordinate; `applied` has changed the coordinate along lane 0, the speed along 1."""
    d.work[place] += rate(law.power, 0)
    d.work[nu + place] += rate(law.power, 1)


@helper
def _modal_damping(c, w, d, k, nu):
    first, start, nm = d.places[k].modes, c.body[k].etad_index, c.body[k].modes
    for n in range(nm):
        for i in range(nm):
            if n == i or not c.body[k].uncoupled:
                d.work[nu + first + n] -= (c.damping[k, n, i] + c.damping[k, i, n]) * w.u[start + i]


@helper
def _load(c, w, d, k, i, nu):
    """f . v of a force, t . w of a torque; in World the components of the load stay, on its node they move along."""
    port, zero = c.load[i].port, (0.0, 0.0, 0.0)
    V = shift_motion(vec6(d.port[port].velocity, 0), vec3(d.port[port].position, 0))
    value = scale(w.function[c.load[i].function, 0], vec3(c.load[i].direction, 0))
    in_world = c.load[i].frame == WORLD_AXES
    if not in_world:
        value = times(mat3(d.body[k].rotation, 0), times(mat3(w.port[port].R, 0), value))
    torque, force = (zero, value) if c.load[i].type == FORCE else (value, zero)
    fill_end(c, d, 0, k, port)
    turned = add(cross(V[0], torque), cross(V[1], force)) if in_world else zero
    add_end(d, 0, d.work, (turned, zero), (torque, force), nu)
