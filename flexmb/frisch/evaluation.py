"""Entry points of Frisch's route: right-hand side of the motion, accelerations, loads."""

from flexmb.frisch.bodies import node_load
from flexmb.frisch.constraint import constraint_loads
from flexmb.frisch.motion import relative_motion
from flexmb.frisch.nests import nest_sums
from flexmb.frisch.partitions import coefficient_matrix
from flexmb.frisch.reduction import reduce, solve
from flexmb.jit.kernel import helper, kernel
from flexmb.levels.range import is_out_of_range
from flexmb.motion.coordinates import configuration_rate, hinge_forces, load_state
from flexmb.spatial.vector import add, cross, dot, vec3
from flexmb.tables.status import OK, OUT_OF_RANGE


@kernel
def rhs(t, y, dy, c, w):
    """dy/dt of y = [q, u, work] at time t; returns a status code. `work` collects the non-conservative power."""
    status = _solution(t, y, c, w)
    if status != OK:
        return status
    configuration_rate(c, w)
    nq, nu = w.q.shape[0], w.u.shape[0]
    for i in range(nq):
        dy[i] = w.rate[i]
    for j in range(nu):
        dy[nq + j] = w.speed[j].acceleration
    dy[nq + nu] = _power(c, w)
    return OK


@kernel
def accelerations(t, y, c, w):
    """udot into w.speed.acceleration, drive loads into w.speed.drive; returns a status code."""
    return _solution(t, y, c, w)


@kernel
def loads(t, y, c, w):
    """Accelerations, and the loads of hinges and wheels into w.nest.load and w.wheel.torque; returns a status code."""
    status = _solution(t, y, c, w)
    if status == OK:
        constraint_loads(c, w)
    return status


@kernel
def assemble(t, y, c, w):
    """Partitions and right sides of (111), the transformation and the reduced equations, without solving them."""
    _kinematics(t, y, c, w)
    _equations(c, w)


@helper
def _solution(t, y, c, w):
    """Equations and their solution; a status code."""
    _kinematics(t, y, c, w)
    for k in range(c.body.shape[0]):
        if is_out_of_range(c, w, k):
            w.fault[0] = k
            return OUT_OF_RANGE
    _equations(c, w)
    return solve(c, w)


@helper
def _kinematics(t, y, c, w):
    load_state(t, y, c, w)
    hinge_forces(c, w)
    relative_motion(c, w)


@helper
def _equations(c, w):
    nest_sums(c, w)
    coefficient_matrix(c, w)
    reduce(c, w)


@helper
def _power(c, w):
    """Power (W) of motors, dampers, drives, node loads and modal damping."""
    total = 0.0
    for j in range(w.u.shape[0]):
        rate = w.u[j]
        total -= c.speed[j].damping * rate * rate
        f = c.speed[j].motor
        if f >= 0:
            total += w.function[f, 0] * rate
        if c.speed[j].prescribed >= 0:
            total += w.speed[j].drive * rate
    for k in range(c.body.shape[0]):
        start = c.body[k].etad_index
        for n in range(c.body[k].modes):
            for m in range(c.body[k].modes):
                total -= w.u[start + n] * c.pair[k, n, m].damping * w.u[start + m]
        omega, v = vec3(w.nest[k].omega, 0), vec3(w.nest[k].velocity, 0)
        for i in range(c.body[k].load_start, c.body[k].load_stop):
            port, tau, f = node_load(c, w, i)
            moved = add(add(v, cross(omega, vec3(w.port[port].r, 0))), vec3(w.port[port].v, 0))
            total += dot(tau, add(omega, vec3(w.port[port].w, 0))) + dot(f, moved)
    return total
