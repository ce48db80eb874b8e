"""What every source does to one point: the end of a connector, or the node of a load."""

from flexmb.jain.derivatives.strips_of import six_of
from flexmb.jain.derivatives.tables import BY_RATE, END_DISPLACED, END_MOTION, END_MOVED, END_SPEED, MOTION
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, sweep
from flexmb.levels.body import is_at_rest
from flexmb.spatial.rows import column6
from flexmb.spatial.spatial_vector import shift_motion, sum6
from flexmb.spatial.vector import add, vec3
from flexmb.tables.features import MODES


@sweep
def fill_end(c, d, side, k, port):
    """Write the motions of a port of body k, about its point, by all sources to `end`; zero for all but its path.

    Rows END_MOTION: J; END_DISPLACED: s0 and END_MOVED: s1 of displacements; END_SPEED: s1 of speeds.
    """
    a = d.end[side]
    for row in range(a.shape[0]):
        for n in range(a.shape[1]):
            a[row, n] = 0.0
    r = vec3(d.port[port].position, 0)
    if has(c, MODES):
        _own_modes(c, d, a, k, port, r)
    while k >= 0:
        for n in range(c.body[k].nv):
            _from_slot(d, a, d.places[k].slot + n, d.places[k].hinge + n, r, 1.0)
        p = c.body[k].parent
        if has(c, MODES):
            for n in range(d.places[k].sees):
                moves = 0.0 if is_at_rest(c.body[p].level) else 1.0
                _from_slot(d, a, d.places[k].seen + n, d.places[p].modes + n, r, moves)
        if p >= 0 and d.places[k].new_point:
            r = add(r, vec3(d.body[k].step, 0))
        k = p


@helper
def _from_slot(d, a, slot, place, r, moves):
    J = shift_motion(column6(d.seed, slot), r)
    s1 = shift_motion(six_of(d.seed, BY_RATE, slot), r)
    _store(a, END_MOTION, place, J, 1.0)
    _store(a, END_DISPLACED, place, J, moves)
    _store(a, END_MOVED, place, s1, 1.0)
    _store(a, END_SPEED, place, J, moves)


@helper
def _own_modes(c, d, a, k, port, r):
    """The modes of the body itself."""
    moves = 0.0 if is_at_rest(c.body[k].level) else 1.0
    for n in range(c.body[k].modes):
        J = sum6(six_of(d.port_mode[port], MOTION, n), six_of(d.frame_mode[k], MOTION, n))
        s1 = sum6(six_of(d.port_mode[port], BY_RATE, n), six_of(d.frame_mode[k], BY_RATE, n))
        J, s1, place = shift_motion(J, r), shift_motion(s1, r), d.places[k].modes + n
        _store(a, END_MOTION, place, J, 1.0)
        _store(a, END_DISPLACED, place, J, moves)
        _store(a, END_MOVED, place, s1, 1.0)
        _store(a, END_SPEED, place, J, moves)


@helper
def _store(a, row, place, V, s):
    for i in range(3):
        a[row + i, place] = s * V[0][i]
        a[row + 3 + i, place] = s * V[1][i]
