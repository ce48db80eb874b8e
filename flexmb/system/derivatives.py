"""Exact derivatives at one state: of accelerations, of inverse dynamics, and of everything observable.

No differences are formed: kernels carry derivatives along (`flexmb.jit.duals`), and what follows from them by linear
equations is solved for. `docs/derivatives.md` says what is held fixed.
"""

from __future__ import annotations

from functools import partial
from typing import Any, overload

import numpy as np

from flexmb.entry.given_motion import motion_tangent, observe_given
from flexmb.entry.observed_tangent import outputs_tangent
from flexmb.entry.tangent import TangentWorkspace, jacobian, tangent_workspace, time_derivative
from flexmb.entry.variation import StateDerivatives, Variation
from flexmb.jit.direct import Direct, direct
from flexmb.jit.pointer import MATRIX, REAL, STATUS, VECTOR
from flexmb.scene.open_loop import refuse_feedback
from flexmb.system.complex_step import load_row, section_row
from flexmb.system.derivative_records import (
    AccelerationDerivatives,
    By,
    EvaluationDerivatives,
    InverseDynamicsDerivatives,
    OfFreeMotion,
    OfGivenMotion,
    by_names,
)
from flexmb.system.factors import MassMatrixFactors
from flexmb.system.free_motion import FreeMotion
from flexmb.system.kinks import has_corners, refuse_kinks
from flexmb.system.load_axes import Axes, referred
from flexmb.system.pushforward import Directions, GivenMotion, Pushforward
from flexmb.system.section_loads import SectionBalance
from flexmb.tables.per_thread import per_thread
from flexmb.tables.state import State, finite_result
from flexmb.typing import Flags, Index, Real

_INSTEAD = "linearise the closed loop by flexmb.linearize(scene)"


class Derivatives(FreeMotion):
    """Derivatives of what a system gives at one state.

    All methods raise NotImplementedError for scenes with controllers, `NotDifferentiableError` (a DynamicsError) where
    a law has a corner, and DynamicsError, ValueError and TypeError as the methods do that give the values.
    """

    def acceleration_derivatives(self, state: State, forces: Real | None = None) -> AccelerationDerivatives:
        """Derivatives of `accelerations` by displacements along the speeds, coordinates, speeds, forces and time.

        `forces` (nu,): generalised forces along the speeds (N m, N) that act in addition to those of the scene.
        Closed chains: of the accelerations under constraint loads that keep the row accelerations zero, as a function
        of all coordinates and speeds; they mean something along changes that the closures allow.
        """
        t, y = self._differentiable(state, "system.acceleration_derivatives")
        at = self._variation(t, y)
        if forces is not None:
            at = self._under_forces(at, t, y, self.layout.rates("forces", forces))
        by_coordinates, by_speed = np.hsplit(at.of_accelerations.by_state, [self.nq])
        return AccelerationDerivatives(
            at.accelerations, by_coordinates @ at.motion, by_speed, at.of_accelerations.by_force,
            at.of_accelerations.by_time, by_coordinates, at.motion,
        )  # fmt: skip

    def inverse_dynamics_derivatives(self, state: State, accelerations: Real) -> InverseDynamicsDerivatives:
        """Derivatives of `inverse_dynamics` at these accelerations (nu,); of closed chains those of the tree alone."""
        t, y = self._differentiable(state, "system.inverse_dynamics_derivatives")
        rates = self.layout.rates("accelerations", accelerations)
        push, nq, nu = self._pushforward, self.nq, self.nu
        motion = GivenMotion(t, y, rates, np.zeros(self._row_count))
        found = push.derivatives(motion, self._unit_directions(), lambda lanes: push.x.tau[:, lanes])
        finite_result(found, t)
        N, by_coordinates = self._coordinate_motion(motion), found[:, :nq]
        return InverseDynamicsDerivatives(
            self.inverse_dynamics(state, rates), by_coordinates @ N, found[:, nq : nq + nu], self.mass_matrix(state),
            found[:, -1], by_coordinates, N,
        )  # fmt: skip

    @overload
    def evaluation_derivatives(self, state: State) -> EvaluationDerivatives[OfFreeMotion]: ...
    @overload
    def evaluation_derivatives(self, state: State, accelerations: Real) -> EvaluationDerivatives[OfGivenMotion]: ...
    def evaluation_derivatives(self, state: State, accelerations: Real | None = None) -> Any:
        """Derivatives of everything observable: accelerations, markers, loads, energies, momentum.

            d = system.evaluation_derivatives(state)
            d.loads["pivot"].by_speed               (6,nu)
            d.energy["kinetic"].by_displacement     (nu,)
            d.markers["tip"].acceleration.by_force  (6,nu)

        Of the free motion, or of the motion with given `accelerations` (nu,), for trees only, whose loads are those of
        inverse dynamics.
        """
        t, y = self._differentiable(state, "system.evaluation_derivatives")
        push, observation = self._pushforward, self.observation
        kind: Any = OfFreeMotion if accelerations is None else OfGivenMotion
        if accelerations is None:
            motion, directions = self._freely(t, y)
        else:
            motion, directions = self._as_given(t, y, self._given(accelerations))
        change = finite_result(push.derivatives(motion, directions, push.row), t)
        row = push.row(slice(0, 1))[:, 0]
        if accelerations is None:
            self._relieve_drives(change)
            change[self._open_row(t, y)] = np.nan
        return by_names(observation, row, change, partial(_split, self.nu, kind))

    def hinge_load_derivatives(
        self, state: State, *, axes: Axes = "world", about: tuple[str, str] | None = None
    ) -> dict[str, OfFreeMotion]:
        """Derivatives (6,nu) of `hinge_loads(state, axes=axes, about=about)` of the free motion, by hinge and closure.

        In axes that turn, or about a node that moves, these turn and move with the state.
        """
        t, y = self._differentiable(state, "system.hinge_load_derivatives")
        referred(self, self.own_workspace, {}, axes, about)  # refuses unknown axes and nodes
        push, seen, open_ = self._pushforward, (axes, about), self._open_loads(state, axes, about)
        motion, directions = self._freely(t, y)
        change = push.derivatives(motion, directions, partial(load_row, self, push, self.observation, seen))
        names = *self.observation.names.hinges, *self.observation.names.closures
        found = dict(zip(names, finite_result(change, t).reshape(len(names), 6, -1), strict=True))
        for name, is_open in open_.items():
            found[name][is_open] = np.nan
        return {name: _split(self.nu, OfFreeMotion, each) for name, each in found.items()}

    def section_load_derivatives(self, state: State, body: str, x: Any) -> OfFreeMotion:
        """Derivatives (X,6,nu) of `section_loads(state, body, x).load`, of the free motion."""
        t, y = self._differentiable(state, "system.section_load_derivatives")
        balance, push = SectionBalance(self, body, x), self._pushforward
        motion, directions = self._freely(t, y)
        change = push.derivatives(motion, directions, partial(section_row, balance, push, self.observation))
        is_open = self._open_sections(state, balance)
        found = finite_result(change, t).reshape(*is_open.shape, -1)
        return _split(self.nu, OfFreeMotion, np.where(is_open[..., None], np.nan, found))

    # What closed chains do otherwise

    def _variation(self, t: float, y: Real) -> Variation:
        """How the free motion changes."""
        nq, nu, n, w = self.nq, self.nu, len(y), self._tangent
        J, drift = np.empty((n, n)), np.empty(n)
        accelerations = self.accelerations(self.layout.known(t, y))  # with the checks, errors and warnings
        self.check_status(self._differentiate(t, y, J), int(w.fault[0]))
        self.check_status(self._differentiate_by_time(t, y, drift), int(w.fault[0]))
        factors = MassMatrixFactors(self.constants, self.workspace, t, y, self.constants)
        self.check_status(factors.status, factors.fault)
        by_force = factors.solve(np.eye(nu)) if nu else np.zeros((0, 0))
        of_rates = StateDerivatives(finite_result(J[nq:-1, :-1], t), finite_result(drift[nq:-1], t), by_force)
        none = StateDerivatives(np.zeros((0, nq + nu)), np.zeros(0), np.zeros((0, nu)))
        rows = np.zeros((nu, 0)), np.zeros((0, 0))
        return Variation(accelerations, of_rates, J[:nq, nq:-1], np.zeros(0), none, *rows)

    @per_thread
    def _pushforward(self) -> Pushforward:
        x, out = motion_tangent(self.nq, self.nu), outputs_tangent(self.observation.out)
        tables = x, self.constants, self._tangent, out
        return Pushforward(tables, None, direct(observe_given, STATUS, *tables), self.check_status)

    @property
    def _row_count(self) -> int:
        """Number of rows of closures."""
        return 0

    def _given(self, accelerations: Real) -> Real:
        """Given accelerations (nu,), checked."""
        return self.layout.rates("accelerations", accelerations)

    def _open_row(self, t: float, y: Real) -> Flags:
        """Which entries of a row (E,) the free motion does not determine."""
        return np.zeros(self.observation.width, bool)

    def _open_loads(self, state: State, axes: Axes, about: tuple[str, str] | None) -> dict[str, Flags]:
        """Which components (6,) of loads in axes, about a node, it does not determine, by hinge and closure."""
        return {}

    def _open_sections(self, state: State, balance: SectionBalance) -> Flags:
        """Which section loads (X,6) it does not determine."""
        return np.zeros((len(balance.x), 6), bool)

    # Tables and kernels in dual numbers

    @per_thread
    def _tangent(self) -> TangentWorkspace:
        return tangent_workspace(self.constants, self.nq, self.nu)

    @per_thread
    def _differentiate(self) -> Direct:
        """(t, y, J)."""
        return direct(jacobian, STATUS, REAL, VECTOR, MATRIX, self.constants, self._tangent)

    @per_thread
    def _differentiate_by_time(self) -> Direct:
        """(t, y, out)."""
        return direct(time_derivative, STATUS, REAL, VECTOR, VECTOR, self.constants, self._tangent)

    # Directions

    def _differentiable(self, state: State, what: str) -> tuple[float, Real]:
        """Time and y of a state at which derivatives exist."""
        refuse_feedback(self.scene, what, _INSTEAD)
        t, y = self.layout.entering(state)
        if has_corners(self.constants):
            self._inverse(t, y, np.zeros(self.nu))  # evaluates the connectors
            refuse_kinks(self, self.own_workspace)
        return t, y

    def _freely(self, t: float, y: Real) -> tuple[GivenMotion, Directions]:
        """The free motion, and how it changes by displacements and speeds, forces and time."""
        at, nq, nu = self._variation(t, y), self.nq, self.nu

        def by_all(change: StateDerivatives) -> Real:
            by_displacement = change.by_state[:, :nq] @ at.motion
            return np.column_stack([by_displacement, change.by_state[:, nq:], change.by_force, change.by_time])

        state, time = self._changes_of_state(at.motion, nu + 1), np.zeros(3 * nu + 1)
        time[-1] = 1.0
        motion = GivenMotion(t, y, at.accelerations, at.loads)
        return motion, Directions(state, by_all(at.of_accelerations), by_all(at.of_loads), time)

    def _under_forces(self, at: Variation, t: float, y: Real, forces: Real) -> Variation:
        """The motion under further generalised forces (nu,), which the scene's motion `at` is without.

        They add accelerations x and row loads f with M x - J'f = forces and J x = 0. In a direction these change by
        M dx - J'df = -(dM x - dJ'f) and J dx = -dJ x.
        """
        push, rows, nu = self._pushforward, self._row_count, self.nu
        x, f = at.of_accelerations.by_force @ forces, at.of_loads.by_force @ forces

        def left(accelerations: Real, loads: Real) -> Real:
            """Derivatives of M accelerations - J' loads + c and J accelerations + gamma by [q, u] and time."""
            motion = GivenMotion(t, y, accelerations, loads)
            return push.derivatives(motion, self._unit_directions(), push.balance)

        drift, opening = np.vsplit(finite_result(left(x, f) - left(np.zeros(nu), np.zeros(rows)), t), [nu])
        of_rates, of_loads = at.of_accelerations, at.of_loads
        turned = of_rates.by_force @ drift + at.lever @ opening
        loaded = of_loads.by_force @ drift + at.inertia @ opening
        return at._replace(
            accelerations=at.accelerations + x,
            of_accelerations=of_rates._replace(
                by_state=of_rates.by_state - turned[:, :-1], by_time=of_rates.by_time - turned[:, -1]
            ),
            loads=at.loads + f,
            of_loads=of_loads._replace(
                by_state=of_loads.by_state - loaded[:, :-1], by_time=of_loads.by_time - loaded[:, -1]
            ),
        )

    def _as_given(self, t: float, y: Real, rates: Real) -> tuple[GivenMotion, Directions]:
        """A motion with these accelerations, and its changes by displacements, speeds, accelerations and time."""
        nu, motion = self.nu, GivenMotion(t, y, rates, np.zeros(0))
        state, time = self._changes_of_state(self._coordinate_motion(motion), nu + 1), np.zeros(3 * nu + 1)
        time[-1] = 1.0
        accelerations = np.zeros((nu, 3 * nu + 1))
        accelerations[:, 2 * nu : -1] = np.eye(nu)
        return motion, Directions(state, accelerations, np.zeros((0, 3 * nu + 1)), time)

    def _changes_of_state(self, N: Real, others: int) -> Real:
        """(nq+nu,2nu+others) of [q, u] by displacements, by speeds, and by others, which leave it as it is."""
        state = np.zeros((self.nq + self.nu, 2 * self.nu + others))
        state[: self.nq, : self.nu], state[self.nq :, self.nu : 2 * self.nu] = N, np.eye(self.nu)
        return state

    def _unit_directions(self) -> Directions:
        """By each of [q, u], then by time, at the same accelerations and loads."""
        n = self.nq + self.nu
        time = np.zeros(n + 1)
        time[-1] = 1.0
        none = np.zeros((self.nu, n + 1)), np.zeros((self._row_count, n + 1))
        return Directions(np.eye(n, n + 1), *none, time)

    def _coordinate_motion(self, motion: GivenMotion) -> Real:
        """N (nq,nu): derivatives of dq/dt by the speeds."""
        n, push = self.nu, self._pushforward
        state = np.eye(self.nq + n)[:, self.nq :]
        directions = Directions(state, np.zeros((n, n)), np.zeros((self._row_count, n)), np.zeros(n))
        return push.derivatives(motion, directions, lambda lanes: push.x.moving[:, lanes])

    def _relieve_drives(self, change: Real) -> None:
        """A force along a prescribed speed relieves its drive, and does nothing else."""
        driven: Index = np.flatnonzero(self.constants.speed["prescribed"] >= 0)
        change[self.observation.columns["drives"][0].start + driven, 2 * self.nu + driven] -= 1.0


def _split(nu: int, kind: type[By], change: Real) -> By:
    """A record of derivatives (...,3nu+1), whose columns are those of `_freely` or `_as_given`."""
    return kind(change[..., :nu], change[..., nu : 2 * nu], change[..., 2 * nu : 3 * nu], change[..., 3 * nu])
