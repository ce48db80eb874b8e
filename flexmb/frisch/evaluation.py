"""Entry points of Frisch's equations: right-hand side of the equations of motion, accelerations, loads."""

from flexmb.connectors.between import connector_power
from flexmb.connectors.bushings import overturned
from flexmb.frisch.bodies import node_load
from flexmb.frisch.constraint import constraint_loads
from flexmb.frisch.motion import relative_motion
from flexmb.frisch.nests import nest_sums
from flexmb.frisch.partitions import coefficient_matrix
from flexmb.frisch.reduction import reduce, solve
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, kernel
from flexmb.levels.range import is_out_of_range
from flexmb.motion.coordinates import hinge_forces, load_state, speed_power, store_slope
from flexmb.spatial.spatial_vector import dot6, shift_motion, sum6, vec6
from flexmb.spatial.vector import vec3
from flexmb.tables.features import CONNECTORS, FRAME_LAWS
from flexmb.tables.status import CONNECTOR_OVERTURNED, OK, OUT_OF_RANGE


@kernel
def rhs(t, y, dy, c, w):
    """dy/dt of y = [q, u, work] at time t; returns a status code. `work` integrates the non-conservative power."""
    status = accelerations(t, y, c, w)
    if status != OK:
        return status
    store_slope(c, w, _power(c, w), dy)
    return OK


@kernel
def accelerations(t, y, c, w):
    """udot to w.speed.acceleration, drive loads to w.speed.drive; returns a status code."""
    assemble(t, y, c, w)
    for k in range(c.body.shape[0]):
        if is_out_of_range(c, w.modal[k], k):
            w.fault[0] = k
            return OUT_OF_RANGE
    if has(c, FRAME_LAWS):
        i = overturned(c, w)
        if i >= 0:
            w.fault[0] = i
            return CONNECTOR_OVERTURNED
    return solve(c, w)


@kernel
def loads(t, y, c, w):
    """Accelerations, and the loads of hinges and wheels to w.nest.load and w.wheel.torque; returns a status code."""
    status = accelerations(t, y, c, w)
    if status == OK:
        constraint_loads(c, w)
    return status


@kernel
def assemble(t, y, c, w):
    """Partitions and right-hand sides of (111), the transformation and the reduced equations, without solving them."""
    load_state(t, y, c, w)
    hinge_forces(c, w)
    relative_motion(c, w)
    nest_sums(c, w)
    coefficient_matrix(c, w)
    reduce(c, w)


@helper
def _power(c, w):
    """Power of motors, dampers, drives, node loads and modal damping (W)."""
    total = speed_power(c, w)
    for k in range(c.body.shape[0]):
        start = c.body[k].etad_index
        for n in range(c.body[k].modes):
            for m in range(c.body[k].modes):
                total -= w.u[start + n] * c.damping[k, n, m] * w.u[start + m]
        V = vec3(w.nest[k].omega, 0), vec3(w.nest[k].velocity, 0)
        for i in range(c.body[k].load_start, c.body[k].load_stop):
            port, F = node_load(c, w, i)
            total += dot6(F, sum6(shift_motion(V, vec3(w.port[port].r, 0)), vec6(w.port[port].v, 0)))
    if has(c, CONNECTORS):
        total += connector_power(w)
    return total
