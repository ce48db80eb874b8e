"""Derivatives of a closed chain at constant loads of its rows, by the recursion of the tree.

With the accelerations udot and the loads f of the rows known, `flexmb.jain.derivatives` has the derivatives of
M udot + b - T of the tree. The loads act on the bodies of both ends and turn with these bodies there; what is left,

- the turning of the loads with A against B, in the rows of all sources of the paths to both ends, and
- the changes of the rows' accelerations (rates, values), from the changes s0, s1 and s2 of the ends,

is added closure by closure. A solution for all columns gives the changes of udot at constant f, X, and M^-1 J'.
"""

from __future__ import annotations

from flexmb.closure.couplings import is_coupling
from flexmb.closure.end_changes import (
    BY_PLACE,
    BY_SPEED,
    CHANGES,
    DISPLACED,
    HURRIED_BY_PLACE,
    HURRIED_BY_SPEED,
    MOVING,
    difference,
    fill,
    has_ports,
    motion_of,
    place_of,
)
from flexmb.closure.row_changes import EndMotions, forms, load_of_rows, torque_by_turn
from flexmb.closure.rows import pose
from flexmb.closure.tables import COUPLINGS, ON_GROUND, ClosureConstants
from flexmb.jain.derivatives.applied import subtract_applied
from flexmb.jain.derivatives.columns import put_until
from flexmb.jain.derivatives.strips_of import strips_of
from flexmb.jain.derivatives.sweeps import clear_matrix, forces_of_bodies, rows_of_speeds
from flexmb.jain.derivatives.tables import Derivatives, derivatives
from flexmb.jit.bundle import bundle
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, kernel
from flexmb.jit.lanes import LANES
from flexmb.jit.strips import put, strip, strip_zeros, width
from flexmb.spatial.spatial_vector import add6, dot6, scale6, sum6
from flexmb.spatial.vector import add, cross, matmul, scale, sub, times, transpose
from flexmb.tables.arrays import Constants
from flexmb.typing import Real

A, B, APART = range(3)  # of `end`: both ends, and their difference


@bundle
class ChainChanges:
    """Arrays of the derivatives of a closed chain; columns are places of `flexmb.jain.derivatives.tables`."""

    end: Real  # (3,CHANGES,nu) what all sources do to the ends of one closure
    jacobian: Real  # (G,nu) J of the rows
    # (G,nu) changes at constant udot of the rows' accelerations, or of what stabilised rows keep at zero
    by_displacement: Real
    by_speed: Real
    rate: Real  # (G,nu) changes of the rows' rates J u by displacements, if asked for
    load: Real  # (G,2nu) changes of the loads
    opening: Real  # (G,2nu) scratch: changes of the rows' accelerations, and of the loads that undo them


def chain_changes(cc: ClosureConstants, nu: int) -> ChainChanges:
    """Arrays of the right sizes."""
    rows, padded = len(cc.row), nu + LANES
    return ChainChanges(
        end=strip_zeros((3, CHANGES, padded)), jacobian=strip_zeros((rows, padded)),
        by_displacement=strip_zeros((rows, padded)), by_speed=strip_zeros((rows, padded)),
        rate=strip_zeros((rows, padded)),
        load=strip_zeros((rows, 2 * nu + LANES)), opening=strip_zeros((rows, 2 * nu + LANES)),
    )  # fmt: skip


def tree_derivatives(c: Constants, cc: ClosureConstants, nq: int, nu: int) -> Derivatives:
    """The arrays of the tree, with ports where closures are attached."""
    found = derivatives(c, nq, nu)
    attached = cc.side[cc.side["body"] != ON_GROUND]
    found.port["used"][attached["port"]] = 1
    return found


@kernel
def differentiate(c, w, d, cc, cw, x, masses, rates):
    """Derivatives of M udot + b - T - J'f to `matrix` by displacements and speeds, those of the rows to x.

    Needs the forward dynamics and the poses in w, udot under the loads of cw.row, and these. M beside them if `masses`,
    x.rate if `rates`.
    """
    clear_matrix(c, d, masses)
    forces_of_bodies(c, w, d)
    filled = -1
    for i in range(cc.closure.shape[0]):
        if has(cc, COUPLINGS) and is_coupling(cc, i):
            _couple(c, d, cc, cw, x, i)
        else:
            _fill_ends(c, w, d, cc, x, i)
            _close(c, w, d, cc, cw, x, i, rates)
            filled = i
    rows_of_speeds(c, w, d, masses)
    subtract_applied(c, w, d)
    for i in range(cc.closure.shape[0] - 1, -1, -1):
        if not (has(cc, COUPLINGS) and is_coupling(cc, i)):
            if i != filled:
                _fill_ends(c, w, d, cc, x, i)
            _turn_loads(d, cc, cw, x, i, _motions(c, w, d, cc, i))


@helper
def _couple(c, d, cc, cw, x, i):
    """The row of a coupling, whose J is constant."""
    r = cc.closure[i].row_start
    for n in range(d.speed.shape[0]):
        x.jacobian[r, n] = x.by_displacement[r, n] = x.by_speed[r, n] = x.rate[r, n] = 0.0
    for n in range(cc.closure[i].term_start, cc.closure[i].term_stop):
        place, factor = d.place[cc.term[n].speed], cc.term[n].factor
        x.jacobian[r, place] += factor
        x.by_displacement[r, place] += cw.gain[1] * factor
        x.by_speed[r, place] += cw.gain[0] * factor


@helper
def _close(c, w, d, cc, cw, x, i, rates):
    """The rows of closure i, and its loads on the bodies of both ends."""
    ends = _motions(c, w, d, cc, i)
    for r in range(cc.closure[i].row_start, cc.closure[i].row_stop):
        form = forms(cc, r, ends)
        _row(d, cw, x, r, form)
        if rates:
            _rate(d, x, r, form)
    F = load_of_rows(cc, cw, i, ends)
    r_A, r_B = _places(c, w, d, cc, i)
    _load(c, d, cc.side[i, A], r_A, F)
    _load(c, d, cc.side[i, B], r_B, scale6(-1.0, F))


@helper
def _places(c, w, d, cc, i):
    """Vectors from the base points of both bodies to the origin of B; on the ground they are not needed."""
    side_A, side_B, zero = cc.side[i, A], cc.side[i, B], (0.0, 0.0, 0.0)
    p_AB = sub(pose(w, side_B)[0], pose(w, side_A)[0])
    r_A = add(place_of(c, w, d, side_A), p_AB) if side_A.body != ON_GROUND else zero
    r_B = place_of(c, w, d, side_B) if side_B.body != ON_GROUND else zero
    return r_A, r_B


@helper
def _fill_ends(c, w, d, cc, x, i):
    """Write `end` for closure i."""
    r_A, r_B = _places(c, w, d, cc, i)
    fill(c, d, x.end[A], cc.side[i, A], r_A)
    fill(c, d, x.end[B], cc.side[i, B], r_B)
    difference(d, x.end)


@helper
def _motions(c, w, d, cc, i):
    r_A, r_B = _places(c, w, d, cc, i)
    R_WA, R_WB = pose(w, cc.side[i, A])[1], pose(w, cc.side[i, B])[1]
    V_A, A_A = motion_of(c, w, d, cc.side[i, A], r_A)
    V_B, A_B = motion_of(c, w, d, cc.side[i, B], r_B)
    return EndMotions(R_WA, matmul(transpose(R_WA), R_WB), V_A, A_A, V_B, A_B)


@helper
def _row(d, cw, x, r, form):
    """J of row r and its changes: of g'' + gain[0] g' + gain[1] g at constant udot."""
    a, damping, stiffness = x.end[APART], cw.gain[0], cw.gain[1]
    of_s0 = sum6(form.acceleration, sum6(scale6(damping, form.rate), scale6(stiffness, form.value)))
    of_s1 = sum6(form.by_s1, scale6(damping, form.rate_by_s1))
    for n in range(0, d.speed.shape[0], width(d)):
        put(d, x.jacobian[r], n, dot6(form.rate_by_s1, strips_of(d, a, MOVING, n)))
        hurried = dot6(form.by_s2, strips_of(d, a, HURRIED_BY_PLACE, n))
        by_s1 = dot6(of_s1, strips_of(d, a, BY_PLACE, n))
        put(d, x.by_displacement[r], n, dot6(of_s0, strips_of(d, a, DISPLACED, n)) + by_s1 + hurried)
        hurried = dot6(form.by_s2, strips_of(d, a, HURRIED_BY_SPEED, n))
        put(d, x.by_speed[r], n, dot6(of_s1, strips_of(d, a, BY_SPEED, n)) + hurried)


@helper
def _rate(d, x, r, form):
    a = x.end[APART]
    for n in range(0, d.speed.shape[0], width(d)):
        by_s1 = dot6(form.rate_by_s1, strips_of(d, a, BY_PLACE, n))
        put(d, x.rate[r], n, dot6(form.rate, strips_of(d, a, DISPLACED, n)) + by_s1)


@helper
def _load(c, d, side, r, F):
    """Add a load about what is at r, with the sign of inertia, to the body of an end; it turns with this body."""
    if side.body != ON_GROUND:
        about_base = add(F[0], cross(r, F[1])), F[1]
        if has_ports(c):
            add6(d.port[side.port].force, 0, about_base)
        else:
            add6(d.body[side.body].force, 0, about_base)


@helper
def _turn_loads(d, cc, cw, x, i, ends):
    """Subtract from the rows of `matrix` what B and A feel of the loads of closure i, which turn with A.

    Seen from A, a displacement s0 = (x, d) of B changes the torque on B by G'x, and moves the force by d. Seen from B
    the load turns by -x.
    """
    tau, f = load_of_rows(cc, cw, i, ends)
    G, nu, a = torque_by_turn(cc, cw, i, ends), d.speed.shape[0], x.end[APART]
    for place in range(nu):
        J_A, J_B = _motion(x.end[A], place), _motion(x.end[B], place)
        turning = times(G, sub(J_B[0], J_A[0]))
        by_turn = sub(turning, add(cross(tau, J_B[0]), cross(f, J_B[1])))
        by_move = scale(-1.0, cross(f, J_A[0]))
        if _is_moved(J_A) or _is_moved(J_B):
            row = d.matrix[place]
            for n in range(0, nu, width(d)):
                change = dot6((by_turn, by_move), strips_of(d, a, DISPLACED, n))
                put_until(d, row, n, nu - n, strip(d, row, n) - change)


@helper
def _motion(a, place):
    return (a[0, place], a[1, place], a[2, place]), (a[3, place], a[4, place], a[5, place])


@helper
def _is_moved(J):
    return dot6(J, J) != 0.0
