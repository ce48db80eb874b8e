"""How a free motion changes with the state, forces and time: the record of trees and closed chains, and that of a tree.

`flexmb.closure.variation` has that of a closed chain.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from flexmb.entry.derivative_call import derivative_call, differentiate
from flexmb.entry.derivatives import DerivativeWorkspace, stiffness_and_mass
from flexmb.entry.tangent import TangentWorkspace, time_derivative
from flexmb.jit.bundle import bundle
from flexmb.jit.direct import Direct, direct
from flexmb.jit.kernel import helper, kernel
from flexmb.jit.pointer import MATRIX, REAL, STATUS, VECTOR, VOID
from flexmb.kept import kept
from flexmb.motion.coordinates import configuration_rate
from flexmb.tables.arrays import Constants
from flexmb.tables.features import DERIVATIVES
from flexmb.tables.functions import any_varies
from flexmb.tables.state import finite_result
from flexmb.tables.status import OK
from flexmb.typing import Index, Real

MOST_SPEEDS = 6  # of a hinge


class ByAllDirections(NamedTuple):
    """Derivatives of m numbers: by displacements along the speeds (m,nu), speeds (m,nu), generalised forces along the
    speeds (m,nu), and time (m,)."""

    by_displacement: Real
    by_speed: Real
    by_force: Real
    by_time: Real

    @property
    def by_all(self) -> Real:
        """(m,3nu+1), in this order."""
        return np.column_stack(self)


class RowChanges(NamedTuple):
    """The loads (G,) of the rows of closures and their rates J u, with derivatives; trees have no rows.

    chosen (r,): the independent rows, which carry the loads; unit (nu,r): M^-1 J' of these; J (G,nu): of all speeds.
    rates_by_displacement (G,nu), rates_by_time (G,): derivatives of J u.
    """

    loads: Real
    of_loads: ByAllDirections
    chosen: Index
    unit: Real
    J: Real
    rates_by_displacement: Real
    rates_by_time: Real

    @property
    def lever(self) -> Real:
        """P = M^-1 J' Lambda (nu,G), the accelerations that give the rows unit accelerations: M is symmetric, so that
        they are the loads by forces with the opposite sign."""
        return -self.of_loads.by_force.T

    @property
    def inertia(self) -> Real:
        """Lambda = (J M^-1 J')^-1 (G,G), the loads that give the chosen rows unit accelerations; zero for others."""
        inertia = np.zeros((len(self.loads), len(self.loads)))
        inertia[np.ix_(self.chosen, self.chosen)] = np.linalg.inv(self.J[self.chosen] @ self.unit)
        return inertia


class VariedAccelerations(NamedTuple):
    """The accelerations (nu,) of a free motion with their derivatives.

    motion (nq,nu): N = d(qdot)/du, the change of the coordinates by displacements along the speeds. Columns of
    prescribed coordinates and speeds vanish.
    """

    accelerations: Real
    of_accelerations: ByAllDirections
    motion: Real


class FreeVariation(NamedTuple):
    """The same, and the rows of closures; of the columns of these only those of J do not vanish."""

    accelerations: Real
    of_accelerations: ByAllDirections
    motion: Real
    rows: RowChanges


class Stiffness(NamedTuple):
    """The accelerations (nu,), the tangent stiffness (nu,nu) under constant loads of the rows of closures, M (nu,nu),
    and J (G,nu) and N (nq,nu) as of `RowChanges` and `FreeVariation`."""

    accelerations: Real
    stiffness: Real
    mass: Real
    J: Real
    motion: Real


Check = Callable[[int, int], None]  # raises unless a status is OK; the second number is the body or closure at fault


@bundle
class RateScratch:
    """What `coordinate_motion` writes beside its result: no evaluation of the motion reads it."""

    raw: Real  # (nq,) coordinates
    u: Real  # (nu,) speeds
    rate: Real  # (nq,) qdot


class CoordinateMotion:
    """N = d(qdot)/du (nq,nu) of one system, for one thread."""

    def __init__(self, c: Constants, nq: int) -> None:
        self._shape, self._turns = (nq, len(c.speed)), bool(np.any(c.body["quaternion"] >= 0))
        scratch = RateScratch(np.zeros(nq), np.zeros(len(c.speed)), np.zeros(nq))
        self._move = direct(coordinate_motion, VOID, VECTOR, MATRIX, c, scratch)

    def at(self, y: Real) -> Real:
        """At y = [q, u, work]; the same read-only array wherever there are no quaternions."""
        return self._found(y) if self._turns else self._constant

    @kept
    def _constant(self) -> Real:
        found = self._found(np.zeros(self._shape[0]))
        found.flags.writeable = False
        return found

    def _found(self, y: Real) -> Real:
        N = np.zeros(self._shape)
        self._move(y, N)
        return N


class TreeVariation:
    """How the motion of one tree changes, for one thread; `dual`: tables for dual numbers."""

    def __init__(self, c: Constants, w: DerivativeWorkspace, dual: TangentWorkspace, check: Check) -> None:
        self._w, self._dual, self._check, n = w, dual, check, len(c.speed)
        self.motion = CoordinateMotion(c, len(w.sweeps.q))
        self._fastest = c.fastest(DERIVATIVES)  # held here: the call knows no more than where they are
        self._call = derivative_call(self._fastest, len(w.sweeps.q), n, w)
        self._differentiate = direct(differentiate, STATUS, REAL, VECTOR, c, self._call)
        self._differentiate_by_time = direct(time_derivative, STATUS, REAL, VECTOR, VECTOR, c, dual)
        self._constants, self._varies = c, any_varies(c.function)
        self._rates = w.sweeps.speed["acceleration"]
        none, loads = np.zeros((0, n)), np.zeros(0)
        of_loads = ByAllDirections(none, none, none, loads)
        self._no_rows = RowChanges(loads, of_loads, np.zeros(0, np.int64), none.T, none, none, loads)

    @property
    def doubt(self) -> Index:
        """(1,) whether a pivot was at rounding level in the last motion."""
        return self._w.doubt

    def at(self, t: float, y: Real) -> FreeVariation:
        """At y = [q, u, work]; DynamicsError where the accelerations do not exist."""
        return FreeVariation(*self.of_accelerations(t, y), self._no_rows)

    def of_accelerations(self, t: float, y: Real) -> VariedAccelerations:
        """The same without rows."""
        nu = len(self._w.sweeps.u)
        status, x = self._differentiate(t, y), self._call
        if status != OK:
            self._check(status, int(self._w.fault[0]))
        rates, by_time = self._rates.copy(), np.zeros(nu)
        if self._varies:
            drift = np.empty_like(y)
            self._check(self._differentiate_by_time(t, y, drift), int(self._dual.fault[0]))
            by_time = finite_result(drift, t)[-1 - nu : -1]
        of_rates = ByAllDirections(x.by_displacement.copy(), x.by_speed.copy(), x.by_force.copy(), by_time)
        return VariedAccelerations(rates, of_rates, self.motion.at(y))

    @kept
    def _stiffen(self) -> Direct:
        tables = self._constants, self._w
        return direct(stiffness_and_mass, STATUS, REAL, VECTOR, VECTOR, MATRIX, MATRIX, *tables)

    def stiffness(self, t: float, y: Real) -> Stiffness:
        """At y = [q, u, work]; DynamicsError where the accelerations do not exist."""
        nu = len(self._w.sweeps.u)
        rates, stiffness, mass = np.empty(nu), np.empty((nu, nu)), np.empty((nu, nu))
        self._check(self._stiffen(t, y, rates, stiffness, mass), int(self._w.fault[0]))
        return Stiffness(rates, stiffness, mass, self._no_rows.J, self.motion.at(y))


@kernel
def coordinate_motion(y, N, c, x):
    """N (nq,nu) = d(qdot)/du at y = [q, ...], into zeros; the columns of prescribed speeds vanish. x: `RateScratch`.

    One evaluation for the first speeds of all hinges, then one for the second ones ...: no hinge depends on another.
    """
    for i in range(N.shape[0]):
        x.raw[i] = y[i]
    for j in range(N.shape[1]):
        x.u[j] = 0.0
    for n in range(MOST_SPEEDS):
        for k in range(c.body.shape[0]):
            _set_speed(c, x, k, n, 1.0)
        configuration_rate(c, x, x.rate)
        for k in range(c.body.shape[0]):
            if n < c.body[k].nv:
                first = c.body[k].q_index
                for i in range(first, first + c.body[k].nv + (1 if c.body[k].quaternion >= 0 else 0)):
                    N[i, c.body[k].u_index + n] = x.rate[i]
            _set_speed(c, x, k, n, 0.0)
    for k in range(c.body.shape[0]):
        for n in range(c.body[k].modes):
            N[c.body[k].eta_index + n, c.body[k].etad_index + n] = 1.0
    for i in range(c.wheel.shape[0]):
        if c.speed[c.wheel[i].u_index].prescribed < 0:
            N[c.wheel[i].q_index, c.wheel[i].u_index] = 1.0


@helper
def _set_speed(c, x, k, n, value):
    """Speed n of the hinge of body k, if it has so many and this one is free."""
    j = c.body[k].u_index + n
    if n < c.body[k].nv and c.speed[j].prescribed < 0:
        x.u[j] = value


def displacement_of(N: Real) -> Real:
    """(nu,nq): displacements along the speeds by changes of the coordinates, of which those of a quaternion's length
    are none. The columns of N are orthogonal."""
    square = np.sum(N * N, axis=0)
    return np.asarray((N / np.where(square > 0.0, square, 1.0)).T)
