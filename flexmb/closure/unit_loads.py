"""Loads on closures as forces on the tree, and the response of the tree to a unit load of every row.

With M = (1 + H Phi K) D (1 + H Phi K)', constraint loads f on a tree at rest cause the accelerations M^-1 J'f. The
innovations of J'f are x = D^-1/2 (1 - H Psi K) J'f, Jain & Rodriguez (55), found body by body with the factors that
`forward_dynamics` leaves in its workspace; the accelerations follow from x by the outward sweep (56). Hence
J M^-1 J' = B'B from unit loads, without M, and a load passes only the bodies between its node and the ground.
"""

from flexmb.closure.couplings import apply_to_speeds, is_coupling
from flexmb.closure.factor import row_place
from flexmb.closure.rows import load_on_b
from flexmb.closure.tables import COUPLINGS, ON_GROUND, ROTATION
from flexmb.jain.innovations import innovate
from flexmb.jain.response import clear_body, push
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, sweep
from flexmb.spatial.spatial_vector import scale6, shift_force, times6, times6_t
from flexmb.spatial.vector import mat3, vec3


@helper
def half_solve(c, w, cc, cw):
    """Write x of a unit load of every row to cw.half."""
    for i in range(cc.closure.shape[0]):
        for r in range(cc.closure[i].row_start, cc.closure[i].row_stop):
            apply_unit_load(c, w, cc, cw, i, r)
            pass_inward(c, w, cc, cw, i, cw.half, row_place(cc, cc.closure[i].group, r))


@sweep
def pass_inward(c, w, cc, cw, i, x, at):
    """x of the forces in cw.response on the path of closure i; by column, from x[at] on."""
    for j in range(cc.closure[i].path_start, cc.closure[i].path_stop):
        innovate(c, w, cw.response, cc.path[j])
    write_columns(cc, i, cw.response, x, at)


@helper
def write_columns(cc, i, response, x, at):
    """Write the speeds of a response in the columns of closure i to x, from x[at] on."""
    g = cc.closure[i].group
    for j in range(cc.group[g].column_start, cc.group[g].column_stop):
        x[at + j - cc.group[g].column_start] = response.speed[cc.column[j]]


@helper
def clear_path(c, cc, cw, i):
    """Set the forces in cw.response to zero on the path of closure i."""
    for j in range(cc.closure[i].path_start, cc.closure[i].path_stop):
        clear_body(c, cw.response, cc.path[j])
    g = cc.closure[i].group
    for j in range(cc.group[g].column_start, cc.group[g].column_stop):
        cw.response.speed[cc.column[j]] = 0.0


@helper
def apply_unit_load(c, w, cc, cw, i, r):
    """Set the forces to the unit load of row r of closure i alone."""
    clear_path(c, cc, cw, i)
    if has(cc, COUPLINGS) and is_coupling(cc, i):
        apply_to_speeds(cc, cw.response, i, 1.0)
    else:
        direction, zero = vec3(cw.row[r].direction, 0), (0.0, 0.0, 0.0)
        apply_load(c, w, cc, cw, i, (direction, zero) if cc.row[r].type == ROTATION else (zero, direction))


@helper
def apply_rows(c, w, cc, cw, i):
    """Add the loads of the rows of closure i to the forces."""
    if has(cc, COUPLINGS) and is_coupling(cc, i):
        apply_to_speeds(cc, cw.response, i, cw.row[cc.closure[i].row_start].load)
    else:
        apply_load(c, w, cc, cw, i, load_on_b(cc, cw, i))


@helper
def apply_load(c, w, cc, cw, i, F):
    """F = [tau; f] about B, A axes, of closure i: added to B, taken from A as the same wrench."""
    F_B = times6_t(mat3(cw.closure[i].rotation, 0), F)
    F_A = shift_force(F, vec3(cw.closure[i].position, 0))
    at_port(c, w, cw, cc.side[i, 1], F_B)
    at_port(c, w, cw, cc.side[i, 0], scale6(-1.0, F_A))


@helper
def at_port(c, w, cw, side, F):
    """Add a load about a port, in port axes, to the forces on its body and modes."""
    if side.body != ON_GROUND:
        push(c, w, cw.response, side.body, side.port, times6(mat3(w.port[side.port].R, 0), F))
