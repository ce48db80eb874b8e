"""Rows of couplings: linear relations of coordinates, g = sum of factor_i q_i - offset, with a constant Jacobian.

The load f of the row is a generalised force: factor_i f along q_i, between the two bodies of that hinge, as a motor's
load. So a unit load enters the recursion as T of (55) in Jain & Rodriguez, with no force on any body. What the hinge
transmits along its freedom includes it; of a prescribed coordinate the drive supplies the rest.
"""

from flexmb.closure.tables import ROTATION
from flexmb.jain.kinematics import motion_column
from flexmb.jit.kernel import helper
from flexmb.spatial.vector import mat3, store3, store9


@helper
def is_coupling(cc, i):
    """Whether closure i is a coupling."""
    return cc.closure[i].term_stop > cc.closure[i].term_start


@helper
def evaluate_coupling(c, w, cc, cw, i, accelerated):
    """Value, rate and, if asked for, acceleration of the row of coupling i, and the axis of the coordinate it leads."""
    first, r = cc.closure[i].term_start, cc.closure[i].row_start
    value = w.q[cc.term[first].coordinate] - cc.closure[i].offset
    rate = w.u[cc.term[first].speed]
    for n in range(first + 1, cc.closure[i].term_stop):
        value += cc.term[n].factor * w.q[cc.term[n].coordinate]
        rate += cc.term[n].factor * w.u[cc.term[n].speed]
    cw.row[r].value = value
    cw.row[r].rate = rate
    k = cc.term[first].body
    turning, sliding = motion_column(c, w, k, cc.term[first].place)
    store3(cw.row[r].direction, 0, turning if cc.row[r].type == ROTATION else sliding)
    store9(cw.closure[i].world, 0, mat3(w.body[k].pose_rotation, 0))
    if accelerated:
        total = w.speed[cc.term[first].speed].acceleration
        for n in range(first + 1, cc.closure[i].term_stop):
            total += cc.term[n].factor * w.speed[cc.term[n].speed].acceleration
        cw.row[r].acceleration = total


@helper
def measure_coupling(w, cc, cw, i, fastest):
    """Size (m) and speed (m/s) of coupling i, angles weighted with the length of the scene.

    Angles count turns, so that the size grows with what is subtracted in the row. `fastest`: of the scene's speeds.
    """
    place, moving = 0.0, 0.0
    for n in range(cc.closure[i].term_start, cc.closure[i].term_stop):
        place += abs(cc.term[n].factor * w.q[cc.term[n].coordinate])
        moving += abs(cc.term[n].factor * w.u[cc.term[n].speed])
    weight = cc.weight[cc.closure[i].row_start]
    cw.closure[i].size = cc.length[0] + weight * place
    cw.closure[i].speed = weight * moving + cc.length[0] * fastest


@helper
def apply_to_speeds(cc, x, i, load):
    """Add the generalised forces of a load of coupling i to a response."""
    for n in range(cc.closure[i].term_start, cc.closure[i].term_stop):
        x.speed[cc.term[n].speed] += cc.term[n].factor * load


@helper
def relieve_drives(c, w, cc, cw):
    """Subtract from the drive loads of prescribed coordinates what couplings supply of them."""
    for i in range(cc.closure.shape[0]):
        for n in range(cc.closure[i].term_start, cc.closure[i].term_stop):
            j = cc.term[n].speed
            if c.speed[j].prescribed >= 0:
                w.speed[j].drive -= cc.term[n].factor * cw.row[cc.closure[i].row_start].load
