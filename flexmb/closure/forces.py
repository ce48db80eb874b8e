"""Constraint loads of closures, added to the result of the forward dynamics of the tree.

With the route `Recursion`, unit loads pass through the articulated-body quantities; `generalised` has all other routes.
"""

from flexmb.closure import generalised
from flexmb.closure.branch import at_crossing, has_started, is_further, turned_over, unresolved
from flexmb.closure.couplings import relieve_drives
from flexmb.closure.factor import choose_rows, entry, factorise, solve, sum_rows
from flexmb.closure.rows import evaluate_rows
from flexmb.closure.tables import COUPLINGS, Recursion
from flexmb.closure.unit_loads import apply_rows, half_solve, pass_inward
from flexmb.jain import hinge_solve, innovations
from flexmb.jain.explicit import about_hinge
from flexmb.jain.kinematics import pose_sweep, velocity_sweep
from flexmb.jain.loads import drive_loads, hinge_loads
from flexmb.jain.response import clear, read_speeds, write_speeds
from flexmb.jain.sweeps import forward_dynamics, outward
from flexmb.jit.features import has
from flexmb.jit.kernel import by_bundle, helper, kernel, sweep
from flexmb.motion.coordinates import load_state
from flexmb.spatial.spatial_vector import add6, vec6
from flexmb.tables.status import BRANCH_UNKNOWN, CLOSURE_SINGULAR, OK

# Pivots of the rows relative to their ports' response, as of light bodies: a solution by normal equations loses their
# square. At 2^-10, of bodies a million times lighter than others, loads have ten digits left, and are refined below;
# derivatives keep twelve, and are refined from 2^-6 on.
DELICATE = 2.0**-10
DELICATE_CHANGES = 2.0**-6


@kernel
def _tree_and_rows(route, s):
    status = forward_dynamics(s.c, s.w)
    if status != OK:
        return status
    pose_sweep(s.c, s.w)
    evaluate_rows(s.c, s.w, s.cc, s.cw, True)
    half_solve(s.c, s.w, s.cc, s.cw)
    return OK


@helper
def _pass_load(route, s, i, x, at):
    pass_inward(s.c, s.w, s.cc, s.cw, i, x, at)


@sweep
def _pass_outward(route, s, x, v):
    read_speeds(s.cw.response, x)
    innovations.respond(s.c, s.w, s.cw.response)
    write_speeds(s.cw.response, v)


@helper
def _accelerate(route, s):
    """In the notation of `flexmb.jain.sweeps`: z_f -= J_f'f, likewise z_R and epsilon, then another outward sweep."""
    c, w, cc, cw = s.c, s.w, s.cc, s.cw
    clear(c, cw.response)
    for i in range(cc.closure.shape[0]):
        apply_rows(c, w, cc, cw, i)
    innovations.innovations(c, w, cw.response)
    for k in range(c.body.shape[0]):
        innovations.add_to_modes(c, w, cw.response, k)
        add6(about_hinge(c, w, k)[1], 0, vec6(cw.response.body[k].force, 0))
        hinge_solve.add_innovations(c, w, cw.response, k)
    outward(c, w)
    drive_loads(c, w)
    if has(cc, COUPLINGS):
        relieve_drives(c, w, cc, cw)


@helper
def _hinge_loads(route, s):
    hinge_loads(s.c, s.w)


@sweep
def _locate(route, t, y, s):
    load_state(t, y, s.c, s.w)
    velocity_sweep(s.c, s.w, False, False)
    pose_sweep(s.c, s.w)
    evaluate_rows(s.c, s.w, s.cc, s.cw, False)


@helper
def _refine(route, s):
    """Remove the rounding residual of the row accelerations by one refinement step; requires `accelerate`."""
    if not is_delicate(s.cc, s.cw, DELICATE):
        return
    evaluate_rows(s.c, s.w, s.cc, s.cw, True)
    _stop_rows(s.cc, s.cw)
    sum_rows(s.cc, s.cw, s.cw.coefficient)
    _pass_outward(route, s, s.cw.coefficient, s.cw.step)
    for r in range(s.cw.row.shape[0]):
        s.cw.row[r].load += s.cw.solution[r]
    for j in range(s.cw.step.shape[0]):
        s.w.speed[j].acceleration += s.cw.step[j]


@helper
def is_delicate(cc, cw, share):
    """Whether nearly cancelling loads accelerate light bodies between closures: a pivot below this share."""
    for g in range(cc.group.shape[0]):
        for a in range(cw.rank[g]):
            r = cw.chosen[cc.group[g].row_start + a]
            if cc.weight[r] * cw.factor[entry(cc, g, a, a)] < share * cw.size[r]:
                return True
    return False


@helper
def _as_it_is(route, s):
    pass


# Choosers between unit loads (route Recursion) and generalised forces. Each takes s.route, then:
# (s): the tree without closure loads, its accelerations, the rows, and x of a unit load of every row; a status code.
free_tree = by_bundle(Recursion, _tree_and_rows, generalised.tree_and_rows)
# (s, i, x, at): x of the forces in cw.response on the bodies on the path of closure i, by column from x[at] on.
pass_load = by_bundle(Recursion, _pass_load, generalised.pass_load)
# (s, x, v): v = M^-1 J'f, the change of all speeds, where x is that of the rows' loads f.
respond = by_bundle(Recursion, _pass_outward, generalised.respond)
# (s): let cw.row.load act beside everything else: accelerations and drive loads.
accelerate = by_bundle(Recursion, _accelerate, generalised.accelerate)
# (s): after `accelerate`, accelerations of the speeds alone once more, where rounding matters.
refine = by_bundle(Recursion, _refine, _as_it_is)
# (s): loads across hinges, body axes, into w.body.load, after `accelerate`.
transmit = by_bundle(Recursion, _hinge_loads, generalised.hinge_and_drive_loads)
# (t, y, s): rows' values and rates at y; the factors of the last forward dynamics stay.
locate = by_bundle(Recursion, _locate, generalised.locate)


@helper
def factorised(w, cc, cw):
    """Factorise the chosen rows; returns a status code."""
    dependent = factorise(cc, cw)
    if dependent >= 0:
        w.fault[0] = cc.row[dependent].closure
        return CLOSURE_SINGULAR
    return OK


@helper
def on_branch(t, w, cc, cw):
    """Check that the factorised rows still belong to the branch on which the step started; returns a status code."""
    if not (has_started(cw) and is_further(t, cw)):
        return OK
    row, status = at_crossing(t, cc, cw), CLOSURE_SINGULAR
    if row < 0:
        row, status = turned_over(cc, cw), BRANCH_UNKNOWN
    if row < 0:
        row = unresolved(t, cc, cw)
    if row < 0:
        return OK
    w.fault[0] = cc.row[row].closure
    return status


@helper
def row_loads(w, cc, cw):
    """Loads of the chosen rows into cw.row.load: Lambda^-1 f = -(J udot_0 + gamma).

    With stabilisation g'' + gain[0] g' + gain[1] g = 0 instead of g'' = 0. Returns a status code.
    """
    status = factorised(w, cc, cw)
    if status != OK:
        return status
    _stop_rows(cc, cw)
    for r in range(cw.row.shape[0]):
        cw.row[r].load = cw.solution[r]
    return OK


@helper
def _stop_rows(cc, cw):
    """Solve for the loads that remove the row accelerations, or make stabilised gaps decay, into cw.solution."""
    for g in range(cc.group.shape[0]):
        first = cc.group[g].row_start
        for place in range(first, first + cw.rank[g]):
            r = cw.chosen[place]
            damped = cw.gain[0] * cw.row[r].rate + cw.gain[1] * cw.row[r].value
            cw.scratch[place] = -(cw.row[r].acceleration + damped)
    solve(cc, cw)


@helper
def choose(w, cc, cw):
    """Choose the independent rows again; returns a status code."""
    short = choose_rows(cc, cw)
    if short < 0:
        return OK
    w.fault[0] = cc.row[cw.chosen[cc.group[short].row_stop - 1]].closure
    return CLOSURE_SINGULAR
