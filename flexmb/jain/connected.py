"""Connectors in the sweeps. Each acts between two ports, or a port and the ground, as forces on bodies and modes."""

from flexmb.connectors.between import load_between
from flexmb.connectors.bushings import overturned
from flexmb.jain.forces import add_port_force
from flexmb.jain.ports import port_velocity
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, sweep
from flexmb.spatial.spatial_vector import ZERO6, scale6, shift_force, times6, times6_t, vec6
from flexmb.spatial.vector import add, mat3, matmul, times, vec3
from flexmb.tables.arrays import ON_GROUND
from flexmb.tables.features import FRAME_LAWS
from flexmb.tables.status import CONNECTOR_OVERTURNED, OK


@sweep
def evaluate_connectors(c, w):
    """Write the loads, energies and powers of all connectors between frames to w.connector.

    Needs the velocity and pose sweeps.
    """
    for i in range(c.connector.shape[0]):
        load_between(c, w, i, _end(c, w, i, 0), _end(c, w, i, 1))


@sweep
def connect(c, w):
    """Subtract the loads of all connectors from the bias forces of the bodies that they join; returns a status code."""
    evaluate_connectors(c, w)
    if has(c, FRAME_LAWS):
        i = overturned(c, w)
        if i >= 0:
            w.fault[0] = i
            return CONNECTOR_OVERTURNED
    for i in range(c.connector.shape[0]):
        on_B = vec6(w.connector[i].load, 0)
        _add_force(c, w, i, 1, scale6(-1.0, on_B))
        _add_force(c, w, i, 0, shift_force(on_B, vec3(w.connector[i].arm, 0)))
    return OK


@helper
def _end(c, w, i, side):
    """Position, rotation and velocity of an end of connector i, World axes."""
    k, port = c.end[i, side].body, c.end[i, side].port
    if k == ON_GROUND:
        return vec3(c.end[i, side].position, 0), mat3(c.end[i, side].rotation, 0), ZERO6
    R = mat3(w.body[k].pose_rotation, 0)
    position = add(vec3(w.body[k].pose_position, 0), times(R, vec3(w.port[port].r, 0)))
    return position, matmul(R, mat3(w.port[port].R, 0)), times6(R, port_velocity(w, k, port))


@helper
def _add_force(c, w, i, side, F):
    """Add a force F about an end of connector i, World axes, to the bias force of the body at that end."""
    k = c.end[i, side].body
    if k != ON_GROUND:
        add_port_force(c, w, w, k, c.end[i, side].port, times6_t(mat3(w.body[k].pose_rotation, 0), F))
