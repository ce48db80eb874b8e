"""Scale of each row, by which it is decided whether the row suppresses any motion: the response of separate ports.

A row of `half` is the response of port B minus that of port A. If both ports move as one, on bodies that are welded
together or to the ground, the two responses cancel and the row consists of rounding errors. A load that passes `depth`
bodies is rounded some 72 times on each, which leaves at most 72 depth 2^-53 of either response: below 1e-12 in any
scene, whatever the masses. Therefore the scale of a row is the response of its ports before the subtraction, to all six
unit loads on each port, since rounding spreads a load along one axis to the others. Torques are weighted with the
length of the scene, as rows are.

Loads cancel in one more case. If a body's hinge is at a node that deforms, the load on its modes is the applied load
minus the reaction of the hinge. So the modal response to a unit load at the hinge is included; without it, the
supported node of a flexible body would count as one that moves.

The coordinates of a coupling take the place of ports: the scale of its row is the response to the load along each of
them alone.

Responses change little during a motion, compared with the seven decades between rounding and the threshold of
independence (`flexmb.closure.factor.DEPENDENT`): they are computed when rows are counted, and kept for the run.
"""

from math import sqrt

from flexmb.closure.couplings import is_coupling
from flexmb.closure.factor import norm, own_columns
from flexmb.closure.forces import pass_load
from flexmb.closure.tables import COUPLINGS
from flexmb.closure.unit_loads import at_port, clear_path
from flexmb.jain.ports import mode_motion
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, sweep
from flexmb.spatial.spatial_vector import dot6

_ZERO = (0.0, 0.0, 0.0)
_AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@helper
def measure_ports(s):
    """Compute cw.size of every row, at the state linearised last."""
    cc, cw = s.cc, s.cw
    for i in range(cc.closure.shape[0]):
        total = 0.0
        if has(cc, COUPLINGS) and is_coupling(cc, i):
            for n in range(cc.closure[i].term_start, cc.closure[i].term_stop):
                total += (cc.weight[cc.closure[i].row_start] * _of_term(s, i, n)) ** 2
        else:
            for axis in _AXES:
                for side in range(2):
                    total += (cc.length[0] * _response(s, i, cc.side[i, side], (axis, _ZERO))) ** 2
                    total += _response(s, i, cc.side[i, side], (_ZERO, axis)) ** 2
                for j in range(cc.closure[i].path_start, cc.closure[i].path_stop):
                    if s.c.body[cc.path[j]].outboard_port >= 0:
                        total += (cc.length[0] * _reaction(s, i, cc.path[j], (axis, _ZERO))) ** 2
                        total += _reaction(s, i, cc.path[j], (_ZERO, axis)) ** 2
        for r in range(cc.closure[i].row_start, cc.closure[i].row_stop):
            cw.size[r] = sqrt(total)


@helper
def _of_term(s, i, n):
    """|x| of the load along term n of coupling i alone."""
    clear_path(s.c, s.cc, s.cw, i)
    s.cw.response.speed[s.cc.term[n].speed] = s.cc.term[n].factor
    return _passed(s, i)


@helper
def _response(s, i, side, F):
    """|x| of a load about a port of closure i, port axes."""
    clear_path(s.c, s.cc, s.cw, i)
    at_port(s.c, s.seen, s.cw, side, F)
    return _passed(s, i)


@helper
def _reaction(s, i, k, F):
    """|x| of the modal forces on body k by a load at the node of its hinge, body axes."""
    clear_path(s.c, s.cc, s.cw, i)
    for n in range(s.c.body[k].modes):
        s.cw.response.zf[k, n] = -dot6(mode_motion(s.seen, s.c.body[k].outboard_port, n), F)
    return _passed(s, i)


@sweep
def _passed(s, i):
    """|x| in the group's own columns of the forces in cw.response, which act on the path of closure i."""
    pass_load(s.route, s, i, s.cw.coefficient, 0)
    return norm(s.cw.coefficient, 0, own_columns(s.cc, s.cc.closure[i].group))
