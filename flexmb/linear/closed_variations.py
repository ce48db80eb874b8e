"""First variations of closed chains, in independent coordinates.

How accelerations, loads and rates of the rows change is known (`flexmb.closure.variation`). Let J be the Jacobian of
the rows by the n free speeds, and L L' = M their mass matrix. Then J L'^-1 = U S V' has as many nonzero singular values
as there are independent rows. With its null space V_0, and Lambda = (J M^-1 J')^-1 of the independent rows,

    P = M^-1 J' Lambda      smallest change of speeds, in kinetic energy, with given row rates
    N_0 = L'^-1 V_0         motions that the closures allow

E selects as many independent coordinates as there are allowed motions: those free coordinates that move most, weighted
with the root of their own inertia (pivots of a QR decomposition). Closures remain fulfilled to first order under

    xi_all = N xi,    du_all = N du + T xi,    N = N_0 (E N_0)^-1,    T = -(1 - N E) P d(J u)/dxi N
"""

from __future__ import annotations

from typing import NamedTuple, cast

import numpy as np

from flexmb.closure.assembly import consistent
from flexmb.closure.closures import ClosureError, Closures
from flexmb.closure.factor import DEPENDENT
from flexmb.closure.tables import ClosureConstants
from flexmb.closure.variation import ChainVariation
from flexmb.linear.triangular import backward, factor, forward, pivots, singular
from flexmb.linear.variations import Equations, RestForces, Variations, same_structure
from flexmb.system.pushforward import GivenMotion
from flexmb.system.system import System
from flexmb.tables.arrays import Constants
from flexmb.tables.per_thread import per_thread
from flexmb.tables.state import DynamicsError, State, pack
from flexmb.tables.workspaces import workspace
from flexmb.typing import Flags, Index, Real


class _Freedom(NamedTuple):
    """The motions that closures allow, of n speeds with a mass matrix (n,n): N_0 (n,f)."""

    mass: Real
    null: Real

    def independent(self) -> Index:
        """Indices (f,) of the independent coordinates."""
        weighed = np.sqrt(self.mass.diagonal())[:, None] * self.null
        return np.sort(pivots(weighed.T)[: self.null.shape[1]])

    def basis(self, chosen: Index) -> Real:
        """N (n,f) for the chosen coordinates; LinAlgError if they are not independent."""
        return cast(Real, np.linalg.solve(self.null[chosen].T, self.null.T).T)


class ClosedEquations(Equations):
    """The equations of a closed chain."""

    _root: ClosedEquations

    def __init__(self, system: System, constants: Constants | None = None, like: ClosedEquations | None = None) -> None:
        super().__init__(system, constants, like)
        closures = system.closures
        assert closures is not None  # of a closed chain
        if closures.at_rest:
            raise NotImplementedError(
                f'scene "{system.scene.name}" has closures and bodies of level "ruthless", whose inertia is not where '
                'closures join them: for a linear model use level "linear" or a better one'
            )
        c, root = self.constants, self._root
        own = closures.constants[1]
        if root is not self and not same_structure(own, root._closures.constants[1]):
            self._root = root = self
        before = None if root is self else root._closures
        self._shared = closures.on_tree(c, lambda: workspace(c, system.nq, system.nu), before)
        self.rank: int = system.rank if root is self else root.rank
        """Number of independent rows of the closures."""

    @per_thread
    def _closures(self) -> Closures:
        return self._shared.for_thread(None if self._root is self else self._root._closures)

    @per_thread
    def _free(self) -> ChainVariation:
        return ChainVariation(self._closures, self._w, None if self._root is self else self._root._free)

    @property
    def closures(self) -> ClosureConstants:
        return self._closures.constants[1]

    @property
    def freedom(self) -> int:
        return len(self.free) - self.rank

    def motion(self, state: State) -> GivenMotion:
        y = pack(state)
        return GivenMotion(state.t, y, self._closures.motion(state.t, y).accelerations, self._closures.row_loads)

    def undetermined(self, state: State) -> Flags:
        observation, spread = self.system.observation, self._closures.motion(state.t, pack(state)).spread
        return observation.undetermined(spread.open_parts if spread else {})

    def loads(self, state: State, at: RestForces) -> Real:
        found, free = self._free.stiffness(state.t, pack(state)), self.free
        self._examine(state)
        left = self._freedom(found.mass[self._among_free], found.J[:, free])
        return left.basis(at.chosen).T @ left.mass @ found.accelerations[free]

    def _independent(self, mass: Real, J: Real) -> tuple[Index, Real]:
        left = self._freedom(mass, J)
        chosen = left.independent()
        return chosen, left.basis(chosen)

    def variations(self, state: State) -> Variations:
        found, free, both = self.free_variation(state), self.free, self._among_free
        of_rates, by_displacement = found.of_accelerations, found.of_accelerations.by_displacement[both]
        J, rates_by_displacement = found.rows.J[:, free], found.rows.rates_by_displacement[:, free]
        P = found.rows.lever[free]
        left = self._freedom(self.mass(state), J)
        chosen = left.independent()
        N, f, n = left.basis(chosen), self.freedom, len(free)

        def dependent(x: Real) -> Real:
            """x (n,...) minus the part that the independent coordinates determine."""
            return x - N @ x[chosen]

        T = dependent(-P @ rates_by_displacement @ N)
        by_speed, drift = of_rates.by_speed[both], of_rates.by_time[free]
        if len(self.constants.function):  # otherwise nothing is prescribed, and the speeds keep the closures closed
            carried = dependent(P @ J @ state.u[free])  # displacement per second by prescribed motions
            hurried = dependent(-P @ (found.rows.rates_by_time + rates_by_displacement @ carried))
            drift = drift + by_displacement @ carried + by_speed @ hurried
        by_chosen = np.zeros((2 * n, 2 * f))
        by_chosen[:n, :f] = by_chosen[n:, f:] = N
        by_chosen[n:, :f] = T
        return Variations(
            state, found, found.accelerations[free][chosen],
            (by_displacement @ N + by_speed @ T)[chosen], (by_speed @ N)[chosen],
            drift[chosen],
            self._transport(state.u)[chosen] @ N, found.motion[:, free] @ N, N.T @ left.mass @ N, chosen,
            self.movable(chosen), by_chosen,
        )  # fmt: skip

    def moved(self, at: Variations | RestForces, xi: Real) -> State:
        """As for a tree, then projected on the closures; DynamicsError also if no closed state is near."""
        try:
            return super().moved(at, xi)
        except ClosureError as error:
            raise DynamicsError(str(error)) from None

    def on_functions(self, state: State) -> State:
        """As for a tree, with coordinates and speeds that fulfil the closures; ClosureError if there are none."""
        found = super().on_functions(state)
        return self.system.layout.known(state.t, consistent(self._closures, state.t, found.kernel_y))

    def _freedom(self, mass: Real, J: Real) -> _Freedom:
        """DynamicsError at a singular position."""
        rank = self.rank
        weight = self._closures.constants[1].weight  # of rotations against translations
        root = factor(mass)
        S, Vt = singular(weight[:, None] * forward(root, J.T).T)
        if rank and not S[rank - 1] > DEPENDENT * S[0]:
            raise DynamicsError("the closures suppress fewer motions here than elsewhere: a singular position")
        return _Freedom(mass, backward(root, Vt[rank:].T))
