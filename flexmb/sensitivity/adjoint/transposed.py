"""Transposes of the derivatives of a right-hand side and of a projection: by recursion, or by the Jacobian.

m = F'l for a row l, with F = df/dy, and l . df/dp. The motion of a tree is pulled in O(N) without a matrix, by
`flexmb.entry.pulled`, which also adds up the derivatives by many constants of the tree. In closed chains, and where the
scalar depends on the work done, F is the matrix that implicit methods use. What is left are parameters on which other
constants depend: their lanes are those of the constants of the equations of motion in dual numbers, seven in a block
(`flexmb.sensitivity.blocks`).
"""

from __future__ import annotations

from flexmb.entry.pulled import PullWorkspace, pull
from flexmb.jit.bundle import bundle
from flexmb.jit.direct import nothing_at, status_at
from flexmb.jit.duals import RATES
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, kernel
from flexmb.spatial.scalar import sqrt
from flexmb.tables.arrays import Constants
from flexmb.tables.features import PRESCRIBED, QUATERNIONS
from flexmb.tables.status import OK
from flexmb.typing import Index, Real

# Indices in `Lanes.address`: the motion and the projection in dual numbers.
MOTION, MANIFOLD = range(2)
# Indices in `ByJacobian.address`: the kernel of the Jacobian, and its tables.
JACOBIAN, EXACT, TANGENT = range(3)


@bundle
class Lanes:
    """Parameters in the lanes of B blocks of constants in dual numbers; none where B is 0."""

    address: Index  # (2,)
    block: Index  # (B,) addresses of the tables of each block
    state: Real  # (B,n,8) the state as duals; the memory of the blocks' workspaces
    slope: Real  # (B,n,8) likewise its rate
    gradient: Real  # (RATES B,) by the parameters, added up


@bundle
class ByRecursion:
    """Tables of `pull_back`."""

    c: Constants
    x: PullWorkspace
    lanes: Lanes


@bundle
class ByJacobian:
    """Tables of `transpose`: n entries of the state."""

    address: Index  # (3,)
    J: Real  # (n,n)
    c: Constants
    lanes: Lanes


@kernel
def pull_back(t, y, row, moved, s):
    """moved = F'row at (t, y), and row . df/dp to the gradients; returns a status code."""
    status = pull(t, y, row, moved, s.c, s.x)
    return _pull_lanes(t, y, row, s.lanes) if status == OK else status


@kernel
def transpose(t, y, row, moved, s):
    """The same by the Jacobian."""
    status = status_at(s.address[JACOBIAN], (t, y, s.J, s.address[EXACT], s.address[TANGENT]))
    if status != OK:
        return status
    n = y.shape[0]
    for j in range(n):
        moved[j] = 0.0
    for i in range(n):
        if row[i] != 0.0:
            for j in range(n):
                moved[j] += row[i] * s.J[i, j]
    return _pull_lanes(t, y, row, s.lanes)


@kernel
def unproject(t, y, gradient, s):
    """The gradient by the state y before its projection, from that by the projected one; the rest is that of the
    parameters."""
    for b in range(s.lanes.block.shape[0]):
        _hold(y, b, s.lanes)
        nothing_at(s.lanes.address[MANIFOLD], (t, s.lanes.block[b]))
        _add(gradient, s.lanes.state, b, s.lanes)
    if has(s.c, QUATERNIONS):
        for k in range(s.c.body.shape[0]):
            if s.c.body[k].quaternion >= 0:
                _off_sphere(y, gradient, s.c.body[k].quaternion)
    if has(s.c, PRESCRIBED):
        nu = s.c.speed.shape[0]
        nq = y.shape[0] - nu - 1
        for j in range(nu):
            if s.c.speed[j].prescribed >= 0:
                gradient[s.c.speed[j].coordinate] = gradient[nq + j] = 0.0


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
def _pull_lanes(t, y, row, s):
    for b in range(s.block.shape[0]):
        _hold(y, b, s)
        status = status_at(s.address[MOTION], (t, s.block[b]))
        if status != OK:
            return status
        _add(row, s.slope, b, s)
    return OK


@helper
def _hold(y, b, s):
    """The state without derivatives to the duals of a block."""
    for i in range(y.shape[0]):
        s.state[b, i, 0] = y[i]
        for lane in range(RATES):
            s.state[b, i, 1 + lane] = 0.0


@helper
def _add(row, duals, b, s):
    """Add row . derivatives of the duals of a block to the gradient."""
    for i in range(row.shape[0]):
        if row[i] != 0.0:
            for lane in range(RATES):
                s.gradient[RATES * b + lane] += row[i] * duals[b, i, 1 + lane]
