"""The variational equations of a run, as a right-hand side for integrators.

With y' = f(t, y; p) and the scaled derivatives s_k = scale_k dy/dp_k of P parameters, the state is

    z = [y_1, its P derivatives, y_2, its P derivatives ...],    s_k' = df/dy s_k + scale_k df/dp_k.

Seven directions are evaluated at once: y is a dual number whose lanes carry s_k, and so are the constants of the
equations of motion, whose lanes carry scale_k dc/dp_k. The kernels of the recursion are compiled once more for them;
they reach this right-hand side by address, so that it is compiled once. `work` comes last since it is a quadrature,
which no error test needs (`flexmb.integrate.problem.Accuracy`).
"""

from __future__ import annotations

from flexmb.jit.bundle import bundle
from flexmb.jit.direct import nothing_at, status_at
from flexmb.jit.duals import RATES
from flexmb.jit.kernel import helper, kernel
from flexmb.tables.status import OK
from flexmb.typing import Index, Real

# Indices in `VariationalFlow.address`; 0 where there is none.
MOTION, MANIFOLD, CONTROL, FOLLOW, OBSERVING, CLOSURE_LOADS = range(6)
ADDRESSES = 6


@bundle
class VariationalFlow:
    """The tables of the variational equations: B blocks of RATES directions each.

    The last axis of the arrays of duals holds the value, then the derivatives along RATES directions.
    """

    address: Index  # (ADDRESSES,) of kernels
    block: Index  # (B,) addresses of the tables of each block
    loop: Index  # (B,) of its controllers; 0 without
    output: Index  # (B,) of its outputs
    load: Index  # (B,) of the loads of its closures; 0 in a tree
    directions: Index  # (1,) P
    state: Real  # (B,nq+nu+1,8) [q, u, work] as duals; the memory of the blocks' workspaces
    slope: Real  # (B,nq+nu+1,8) likewise its rate
    every: Real  # (B,m,8) everything observable, the memory of the outputs
    law: Real  # (B,states,8) likewise the states of controllers
    law_rate: Real  # (B,states,8)
    continuous: Index  # (X,) which of these are integrated


@kernel
def rhs(t, z, dz, s, same):
    """dz/dt; returns a status code. The flow is passed for both arguments."""
    for b in range(s.block.shape[0]):
        take(z, b, s)
        status = evaluate(t, b, s)
        if status != OK:
            return status
        _give(s.slope, s.law_rate, b, s, dz)
    return OK


@kernel
def project(t, z, s):
    """Project z: y to its manifold, and its derivatives by the derivative of that projection."""
    for b in range(s.block.shape[0]):
        take(z, b, s)
        nothing_at(s.address[MANIFOLD], (t, s.block[b]))
        _give(s.state, s.law, b, s, z)


@kernel
def evaluate_at(t, z, b, s):
    """Evaluate one block at z, for its outputs; returns a status code."""
    take(z, b, s)
    return evaluate(t, b, s)


@kernel
def observe_at(times, states, values, rates, s):
    """Everything observable at states (T,.): values (T,m), and rates (T,m,P). Returns a status code, and the number of
    states that were evaluated before."""
    for i in range(times.shape[0]):
        for b in range(s.block.shape[0]):
            take(states[i], b, s)
            status = evaluate(times[i], b, s)
            if status != OK:
                return status, i
            nothing_at(s.address[OBSERVING], (s.block[b], s.output[b]))
            if s.address[CLOSURE_LOADS]:
                nothing_at(s.address[CLOSURE_LOADS], (s.block[b], s.load[b]))
            lanes = min(RATES, rates.shape[2] - RATES * b)
            for j in range(values.shape[1]):
                number = s.every[b, j]
                values[i, j] = number[0]
                for lane in range(lanes):
                    rates[i, j, RATES * b + lane] = number[1 + lane]
    return OK, times.shape[0]


@helper
def evaluate(t, b, s):
    """Evaluate one block where its state is; returns a status code."""
    if s.address[CONTROL]:
        status = status_at(s.address[CONTROL], (t, s.loop[b]))
        if status != OK:
            return status
    status = status_at(s.address[MOTION], (t, s.block[b]))
    if status == OK and s.address[FOLLOW]:
        status = status_at(s.address[FOLLOW], (t, s.loop[b]))
    return status


@helper
def take(z, b, s):
    """Copy y and the directions of a block from z to its state."""
    n, x, row = s.state.shape[1] - 1, s.continuous.shape[0], 1 + s.directions[0]
    for i in range(n):
        _take(z[i * row : (i + 1) * row], b, s.state[b, i])
    for j in range(x):
        _take(z[(n + j) * row : (n + j + 1) * row], b, s.law[b, s.continuous[j]])
    _take(z[(n + x) * row :], b, s.state[b, n])


@helper
def _take(row, b, number):
    """A number with the derivatives of block b from those of all."""
    number[0] = row[0]
    part = row[1 + RATES * b :]
    if part.shape[0] >= RATES:  # this number of them is known when the kernel is compiled: they are one vector
        for lane in range(RATES):
            number[1 + lane] = part[lane]
    else:
        for lane in range(part.shape[0]):
            number[1 + lane] = part[lane]


@helper
def _give(of_motion, of_laws, b, s, z):
    """Copy states, or their rates, to z."""
    n, x, row = s.state.shape[1] - 1, s.continuous.shape[0], 1 + s.directions[0]
    for i in range(n):
        _put(of_motion[b, i], b, z[i * row : (i + 1) * row])
    for j in range(x):
        _put(of_laws[b, s.continuous[j]], b, z[(n + j) * row : (n + j + 1) * row])
    _put(of_motion[b, n], b, z[(n + x) * row :])


@helper
def _put(number, b, row):
    """The inverse of `_take`."""
    if b == 0:
        row[0] = number[0]
    part = row[1 + RATES * b :]
    if part.shape[0] >= RATES:
        for lane in range(RATES):
            part[lane] = number[1 + lane]
    else:
        for lane in range(part.shape[0]):
            part[lane] = number[1 + lane]
