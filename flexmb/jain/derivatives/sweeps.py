"""Derivatives of M udot + b - T for known accelerations, and from them those of the accelerations."""

from flexmb.jain.derivatives.applied import subtract_applied
from flexmb.jain.derivatives.attached import attach, wheel_rows
from flexmb.jain.derivatives.bodies import own_force
from flexmb.jain.derivatives.connected import attach_connectors, link
from flexmb.jain.derivatives.flexible import bend
from flexmb.jain.derivatives.modes import mode_rows
from flexmb.jain.derivatives.motion import move
from flexmb.jain.derivatives.ports import clear_ports, move_ports
from flexmb.jain.derivatives.rigid_trees import rigid_tree
from flexmb.jain.derivatives.rows import add_answer, inward
from flexmb.jain.derivatives.solve import solve, solve_with_inverse
from flexmb.jain.derivatives.tables import BRANCHES
from flexmb.jain.derivatives.work import differentiate_power
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, kernel
from flexmb.tables.features import CONNECTORS, LOADS, MODES, PRESCRIBED, SEVERAL, WHEELS


@kernel
def inverse_dynamics(c, w, d, masses):
    """Derivatives of M udot + b to `matrix`, in the order of places; M beside them if `masses`.

    Needs the velocity sweep in w, that of poses if there are connectors, and udot in w.speed.acceleration.
    """
    clear_matrix(c, d, masses)
    # One of the two is not even compiled: a condition that no function hides is known before types are inferred.
    if has(c, MODES) or has(c, SEVERAL) or has(c, LOADS) or has(c, WHEELS) or has(c, CONNECTORS):
        forces_of_bodies(c, w, d)
        rows_of_speeds(c, w, d, masses)
    else:
        _copy_functions(c, w, d)
        for k in range(c.body.shape[0]):
            move(c, w, d, k)
        rigid_tree(c, w, d, masses)


@helper
def clear_matrix(c, d, masses):
    """Clear the matrix where it is not written; it goes before `forces_of_bodies`, if `rows_of_speeds` comes after."""
    nu = d.speed.shape[0]
    if d.shape[BRANCHES] or has(c, WHEELS):  # else every element is written
        for place in range(nu):
            _clear(d.matrix[place], 0, 3 * nu if masses else 2 * nu)


@helper
def stop(c, w):
    """No accelerations but prescribed ones, as the tangent stiffness has them."""
    for j in range(w.u.shape[0]):
        if c.speed[j].prescribed < 0:
            w.speed[j].acceleration = 0.0


@helper
def _copy_functions(c, w, d):
    """The functions of time."""
    for f in range(c.function.shape[0]):
        for i in range(3):
            d.duals.function[f, i] = w.function[f, i]


@kernel
def forces_of_bodies(c, w, d):
    """Outward: motion and forces of the bodies and of what is attached to them. What it needs in w: see
    `inverse_dynamics`. A kernel, because the derivatives of trees, of closed chains and of single rows share it."""
    _copy_functions(c, w, d)
    for k in range(c.body.shape[0]):
        move(c, w, d, k)
        if has(c, MODES) or has(c, LOADS) or has(c, WHEELS) or has(c, CONNECTORS):
            clear_ports(c, d, k)
            move_ports(c, w, d, k)
        own_force(c, w, d, k)
        if has(c, LOADS) or has(c, WHEELS):
            attach(c, w, d, k)
    if has(c, CONNECTORS):
        attach_connectors(c, w, d)


@kernel
def rows_of_speeds(c, w, d, masses):
    """Inward, after `forces_of_bodies` and what else acts on the bodies: the matrix, from what they answer."""
    for k in range(c.body.shape[0] - 1, -1, -1):
        bend(c, w, d, k)
        if has(c, MODES) or has(c, LOADS) or has(c, WHEELS) or has(c, CONNECTORS):
            _answer_of_ports(c, d, k)
        if has(c, MODES) and c.body[k].modes > 0:
            mode_rows(c, d, k, masses)
        if has(c, WHEELS):
            wheel_rows(c, w, d, k, masses)
        inward(c, w, d, k, masses)
    if has(c, CONNECTORS):
        link(c, d)


@helper
def _answer_of_ports(c, d, k):
    """Add what is attached to the ports of body k."""
    for i in range(c.body[k].port_start, c.body[k].port_stop):
        if d.port[i].used:
            add_answer(c, d.body[k], d.port[i])


@helper
def _clear(row, start, stop):
    for j in range(start, stop):
        row[j] = 0.0


@kernel
def accelerations(c, w, d):
    """Derivatives of udot by displacement, speed and force to `matrix`, after forward dynamics in w."""
    inverse_dynamics(c, w, d, False)
    subtract_applied(c, w, d)
    nu = w.u.shape[0]
    for place in range(nu):
        _clear(d.matrix[place], 2 * nu, 3 * nu)
        d.matrix[place, 2 * nu + place] = -1.0
    solve_with_inverse(c, w, d)
    for i in range(nu):
        for j in range(i):
            d.matrix[i, 2 * nu + j] = d.matrix[j, 2 * nu + i]


@kernel
def accelerations_and_power(c, w, d):
    """Derivatives of udot by displacement and speed to `matrix`, and of the power to `work`, likewise."""
    masses = has(c, PRESCRIBED)  # rows of prescribed speeds, for the loads of their drives
    inverse_dynamics(c, w, d, masses)
    subtract_applied(c, w, d)
    differentiate_power(c, w, d)
    nu = w.u.shape[0]
    solve(c, w, d, 2 * nu)
    if masses:
        for place in range(nu):
            row, load = d.matrix[place], d.work[2 * nu + place]
            for n in range(2 * nu):
                d.work[n] += load * row[n]
