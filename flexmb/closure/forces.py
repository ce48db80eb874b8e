"""Closure loads that keep closures closed, added to what the forward dynamics of the tree has found."""

from math import sqrt

from flexmb.closure.factor import choose_rows, factorise, solve
from flexmb.closure.rows import evaluate_rows, load_on_b
from flexmb.closure.unit_loads import apply_load, clear_loads, half_solve, pass_inward, pivot
from flexmb.jain.kinematics import pose_sweep
from flexmb.jain.sweeps import SINGLE, forward_dynamics, outward
from flexmb.kernel import helper
from flexmb.spatial.vector import add3, scale, vec3
from flexmb.status import CLOSURE_SINGULAR, OK


@helper
def free_tree(c, w, cc, cw):
    """The tree without closure loads: its accelerations, the rows, and x of a unit load of every row."""
    status = forward_dynamics(c, w)
    if status != OK:
        return status
    pose_sweep(c, w)
    evaluate_rows(c, w, cc, cw, True)
    half_solve(c, w, cc, cw)
    return OK


@helper
def row_loads(c, w, cc, cw):
    """Loads of the chosen rows into cw.row.load: Lambda^-1 f = -(J udot_0 + gamma).

    With stabilisation g'' + gain[0] g' + gain[1] g = 0 instead of g'' = 0. Returns a status code.
    """
    dependent = factorise(cc, cw)
    if dependent >= 0:
        w.fault[0] = cc.row[dependent].closure
        return CLOSURE_SINGULAR
    for a in range(cw.rank[0]):
        r = cw.chosen[a]
        damped = cw.gain[0] * cw.row[r].rate + cw.gain[1] * cw.row[r].value
        cw.scratch[a] = -(cw.row[r].acceleration + damped)
    solve(cw)
    return OK


@helper
def choose(c, w, cc, cw):
    """Choose the independent rows anew; a status code."""
    if choose_rows(cc, cw):
        return OK
    w.fault[0] = cc.row[cw.chosen[cw.row.shape[0] - 1]].closure
    return CLOSURE_SINGULAR


@helper
def add_loads(c, w, cc, cw):
    """Let cw.row.load act beside everything else, and move the tree accordingly.

    In the terms of `flexmb.jain.sweeps`: z_f -= J_f'f, z_R and epsilon likewise, and outward once more.
    """
    clear_loads(c, cw)
    for i in range(cc.closure.shape[0]):
        tau, f = load_on_b(cc, cw, i)
        apply_load(c, w, cc, cw, i, 0, tau, f)
    x = cw.coefficient
    for k in range(c.body.shape[0] - 1, -1, -1):
        pass_inward(c, w, cw, k, 0, x)
        for n in range(c.body[k].modes):
            w.mode[k, n].zf -= x[c.body[k].etad_index + n]
        add3(w.body[k].hinge_force, 0, scale(-1.0, vec3(cw.force[k, 0], 0)))
        add3(w.body[k].hinge_force, 3, scale(-1.0, vec3(cw.force[k, 0], 3)))
        j = c.body[k].u_index
        if w.body[k].free_count == SINGLE:
            w.body[k].hinge_residual[0] += x[j] / sqrt(pivot(c, w, k))
        else:
            for n in range(w.body[k].free_count):
                w.body[k].hinge_residual[n] += x[j + n]
    outward(c, w)
