"""Transposes of the derivatives of a right-hand side and of a projection, by the Jacobian and by dual numbers.

m = F'l for a row l, with F = df/dy from the kernel that implicit methods use; l . df/dp for parameters p whose lanes
the constants of the equations of motion have, eight in a block (`flexmb.sensitivity.blocks`).
"""

from __future__ import annotations

from flexmb.jit.bundle import bundle
from flexmb.jit.direct import nothing_at, status_at
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, kernel
from flexmb.jit.lanes import LANES
from flexmb.spatial.scalar import sqrt
from flexmb.tables.features import PRESCRIBED, QUATERNIONS
from flexmb.tables.status import OK
from flexmb.typing import Index, Real

# Indices in `ByJacobian.address`: the Jacobian and its tables; the motion and the projection in dual numbers; the
# transposed projection and its constants.
JACOBIAN, EXACT, TANGENT, MOTION, MANIFOLD, UNPROJECT, CONSTANTS = range(7)
ADDRESSES = 7


@bundle
class ByJacobian:
    """Tables of the transposes: n entries of the state, B blocks of parameters."""

    address: Index  # (ADDRESSES,)
    J: Real  # (n,n)
    which: Index  # the blocks on whose directions the motion depends
    block: Index  # (B,) addresses of the tables of each block
    state: Real  # (B,n,9) the state as duals; the memory of the blocks' workspaces
    slope: Real  # (B,n,9) likewise its rate
    gradient: Real  # (LANES B,) by the parameters, added up


@kernel
def transpose(t, y, pull, moved, s):
    """moved = F'pull at (t, y), and pull . df/dp to the gradient; returns a status code."""
    status = status_at(s.address[JACOBIAN], (t, y, s.J, s.address[EXACT], s.address[TANGENT]))
    if status != OK:
        return status
    n = y.shape[0]
    for j in range(n):
        moved[j] = 0.0
    for i in range(n):
        if pull[i] != 0.0:
            for j in range(n):
                moved[j] += pull[i] * s.J[i, j]
    for i in range(s.which.shape[0]):
        b = s.which[i]
        _hold(y, b, s)
        status = status_at(s.address[MOTION], (t, s.block[b]))
        if status != OK:
            return status
        _add(pull, s.slope, b, s)
    return OK


@kernel
def unproject(t, y, gradient, s):
    """The gradient by the state y before its projection, from that by the projected one; the rest is the parameters'."""
    for i in range(s.which.shape[0]):
        b = s.which[i]
        _hold(y, b, s)
        nothing_at(s.address[MANIFOLD], (t, s.block[b]))
        _add(gradient, s.state, b, s)
    nothing_at(s.address[UNPROJECT], (y, gradient, s.address[CONSTANTS]))


@kernel
def off_manifold(y, gradient, c):
    """`unproject` for unit quaternions and prescribed coordinates of a tree or closed chain."""
    if has(c, QUATERNIONS):
        for k in range(c.body.shape[0]):
            if c.body[k].quaternion >= 0:
                _off_sphere(y, gradient, c.body[k].quaternion)
    if has(c, PRESCRIBED):
        nu = c.speed.shape[0]
        nq = y.shape[0] - nu - 1
        for j in range(nu):
            if c.speed[j].prescribed >= 0:
                gradient[c.speed[j].coordinate] = gradient[nq + j] = 0.0


@helper
def _off_sphere(y, gradient, i):
    """By a quaternion of any length, from that by the one of length 1."""
    length = sqrt(y[i] * y[i] + y[i + 1] * y[i + 1] + y[i + 2] * y[i + 2] + y[i + 3] * y[i + 3])
    along = 0.0
    for n in range(4):
        along += y[i + n] * gradient[i + n]
    for n in range(4):
        gradient[i + n] = (gradient[i + n] - y[i + n] * along / (length * length)) / length


@helper
def _hold(y, b, s):
    """The state without derivatives to the duals of a block."""
    for i in range(y.shape[0]):
        s.state[b, i, 0] = y[i]
        for lane in range(LANES):
            s.state[b, i, 1 + lane] = 0.0


@helper
def _add(row, duals, b, s):
    """Add row . derivatives of the duals of a block to the gradient."""
    for i in range(row.shape[0]):
        if row[i] != 0.0:
            for lane in range(LANES):
                s.gradient[LANES * b + lane] += row[i] * duals[b, i, 1 + lane]
