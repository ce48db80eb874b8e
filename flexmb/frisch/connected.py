"""Connectors in the nested-body equations: loads at nodes (80), (81) on bodies and modes, as in `load_terms`."""

from flexmb.connectors.between import load_between
from flexmb.frisch.tables import NO_LOADS_ON_MODES
from flexmb.jit.kernel import helper
from flexmb.spatial.rows import column6
from flexmb.spatial.spatial_vector import ZERO6, dot6, scale6, shift_force, shift_motion, sum6, vec6
from flexmb.spatial.vector import add, add3, mat3, vec3
from flexmb.tables.arrays import ON_GROUND


@helper
def connector_terms(c, w):
    """Add the loads of all connectors to the right-hand sides of the bodies that they join."""
    for i in range(c.connector.shape[0]):
        load_between(c, w, i, _end(c, w, i, 0), _end(c, w, i, 1))
        on_B = vec6(w.connector[i].load, 0)
        _add_force(c, w, i, 1, on_B)
        _add_force(c, w, i, 0, scale6(-1.0, shift_force(on_B, vec3(w.connector[i].arm, 0))))


@helper
def _end(c, w, i, side):
    """Position, rotation and velocity of an end of connector i, World axes."""
    k, port = c.end[i, side].body, c.end[i, side].port
    if k == ON_GROUND:
        return vec3(c.end[i, side].position, 0), mat3(c.end[i, side].rotation, 0), ZERO6
    r, carried = vec3(w.port[port].r, 0), (vec3(w.nest[k].omega, 0), vec3(w.nest[k].velocity, 0))
    velocity = sum6(shift_motion(carried, r), vec6(w.port[port].v, 0))
    return add(vec3(w.nest[k].origin, 0), r), mat3(w.port[port].R, 0), velocity


@helper
def _add_force(c, w, i, side, F):
    """Add a force F about an end of connector i, World axes, to the body at that end and to its modes."""
    k, port = c.end[i, side].body, c.end[i, side].port
    if k == ON_GROUND:
        return
    torque, force = shift_force(F, vec3(w.port[port].r, 0))
    add3(w.nest[k].force, 0, force)
    add3(w.nest[k].torque, 0, torque)
    if c.printed[NO_LOADS_ON_MODES] == 0:
        for n in range(c.body[k].modes):
            w.mode[k, n].row += dot6(column6(w.port_mode[port], n), F)
