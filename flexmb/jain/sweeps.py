"""Articulated-body forward dynamics of trees with rigid and flexible bodies, O(N): Jain & Rodriguez (63), (64).

In each body the modes are eliminated first, by one of `flexmb.jain.variants`, then the hinge: D of (51), of order
n_m + n_r, is thus replaced by D_f of order n_m and D_R of order n_r <= 6. Bodies are numbered from base to tip, so that
the inward sweep runs from N-1 to 0. Gravity enters as the acceleration -g of the ground, which saves its force on every
body.
"""

from flexmb.jain import hinge_solve
from flexmb.jain.accelerations import inboard_acceleration, store_body_acceleration
from flexmb.jain.axis import turn
from flexmb.jain.connected import connect
from flexmb.jain.forces import elastic_forces, node_loads
from flexmb.jain.kinematics import move_body, pose_body
from flexmb.jain.variants import eliminate_modes, inertia, modal_accelerations
from flexmb.jain.wheels import wheel_acceleration, wheel_forces
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, kernel, sweep
from flexmb.jit.prefetch import prefetch
from flexmb.levels import rigid
from flexmb.levels.body import RIGID
from flexmb.levels.range import is_out_of_range
from flexmb.motion.coordinates import hinge_forces
from flexmb.tables.features import CONNECTORS, LOADS, MODES, WHEELS
from flexmb.tables.status import NOT_POSITIVE_DEFINITE, OK, OUT_OF_RANGE

# In bodies. The work on six bodies takes about as long as fetching a record from memory: a chain of 100,000 bodies
# takes 169 ns a body in place of 308 without prefetching (measured).
PREFETCH_DISTANCE = 6


@helper
def forward_dynamics(c, w):
    """Write the accelerations udot for the state in w.q, w.u to w.speed.acceleration; returns a status code."""
    status = bodies(c, w)
    if status != OK:
        return status
    if not inward(c, w):
        return NOT_POSITIVE_DEFINITE
    outward(c, w)
    return OK


@kernel
def bodies(c, w):
    """Motion, inertia and forces of every body, before any elimination; returns a status code."""
    hinge_forces(c, w)
    turn(c, w)
    displaced = w.displaced[0] != 0
    # One loop in place of one sweep for each quantity: the rows of a body stay in the cache between its steps.
    for k in range(c.body.shape[0]):
        move_body(c, w, k, False, False, displaced)
        if has(c, MODES) and is_out_of_range(c, w.eta[k], k):
            w.fault[0] = k
            return OUT_OF_RANGE
        if has(c, RIGID) and c.body[k].started:
            rigid.bias(c, w, k)  # its inertia is added to that of an outboard body in `explicit.to_parent`
        else:
            inertia(c, w, k)
        if has(c, MODES):
            elastic_forces(c, w, k)
        if has(c, LOADS) or has(c, CONNECTORS):
            pose_body(c, w, k)
        if has(c, LOADS):
            node_loads(c, w, k)
        if has(c, WHEELS):
            wheel_forces(c, w, k)
    w.displaced[0] = 0
    if has(c, CONNECTORS):
        return connect(c, w)
    return OK


@kernel
def inward(c, w):
    """The inward half of (63), (64). Returns False where a D is not positive definite; w.fault then names the body.

    w.doubt is 1 if a pivot was so small that it may consist of rounding errors. The factors of D_f replace M_m in the
    workspace; `flexmb.jain.innovations` solves with them.
    """
    w.doubt[0] = 0
    for k in range(c.body.shape[0] - 1, -1, -1):
        prefetch(w.body, k - PREFETCH_DISTANCE)
        sound = True
        if has(c, MODES):
            sound = eliminate_modes(c, w, k)
        if not (sound and hinge_solve.eliminate(c, w, k)):
            w.fault[0] = k
            return False
    return True


@sweep
def outward(c, w):
    """Outward half of (64): udot of hinges, modes and wheels, and the accelerations of the bodies."""
    for k in range(c.body.shape[0]):
        A = hinge_solve.accelerate(c, w, k, inboard_acceleration(c, w, k))
        if has(c, MODES):
            modal_accelerations(c, w, k, A)
        store_body_acceleration(c, w, k, A)
        if has(c, WHEELS):
            for i in range(c.body[k].wheel_start, c.body[k].wheel_stop):
                wheel_acceleration(c, w, k, i)
