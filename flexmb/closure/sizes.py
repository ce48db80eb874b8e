"""What a row is compared with to see whether it suppresses any motion: how far its closure's ports move by themselves.

A row of `half` is the response of port B less that of port A. Where both move as one, on bodies that are welded
together or to the ground, the two cancel and the row is what rounding leaves of them. A load that passes `depth`
bodies on its way is rounded some 72 times on each, which leaves no more than 72 depth 2^-53 of either response: below
1e-12 in any scene, whatever the masses. So the scale of a row is the response of its ports before they are subtracted,
to all six unit loads on each, since a load along one axis that moves nothing is rounded into the others. Torques are
weighed with the length of the scene, as rows are.

Loads cancel in one more place. Where a body's hinge sits on a node that deforms, its modes feel a load less the
reaction of the hinge: what they feel of a unit load at the hinge counts too, so that the node at which a flexible body
is held does not pass for one that moves.

Responses hardly change in the course of a motion, compared with the seven decades between rounding and what counts as
independent (`flexmb.closure.factor.DEPENDENT`): they are measured where rows are counted and kept for a run.
"""

from math import sqrt

from flexmb.closure.factor import norm, own_columns
from flexmb.closure.forces import pass_load
from flexmb.closure.unit_loads import at_port, clear_path
from flexmb.jain.ports import mode_motion
from flexmb.jit.kernel import helper, sweep
from flexmb.spatial.spatial_vector import dot6

_ZERO = (0.0, 0.0, 0.0)
_AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@helper
def measure_ports(s):
    """cw.size of every row, at the state that was linearised last."""
    cc, cw = s.cc, s.cw
    for i in range(cc.closure.shape[0]):
        total = 0.0
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
def _response(s, i, side, F):
    """|x| of a load about a port of closure i, port axes."""
    clear_path(s.c, s.cc, s.cw, i)
    at_port(s.c, s.seen, s.cw, side, F)
    return _passed(s, i)


@helper
def _reaction(s, i, k, F):
    """|x| of what the modes of body k feel of a load at the node that its hinge sits on, body axes."""
    clear_path(s.c, s.cc, s.cw, i)
    for n in range(s.c.body[k].modes):
        s.cw.response.zf[k, n] = -dot6(mode_motion(s.seen, s.c.body[k].outboard_port, n), F)
    return _passed(s, i)


@sweep
def _passed(s, i):
    """|x|, in the columns that rows are judged by, of the forces in cw.response, which are on the path of closure i."""
    pass_load(s.route, s, i, s.cw.coefficient, 0)
    return norm(s.cw.coefficient, 0, own_columns(s.cc, s.cc.closure[i].group))
