"""Exact derivatives at one state: of accelerations, of inverse dynamics, and of everything observable.

No differences are formed: derivatives of the equations of motion of a tree are found by recursion
(`flexmb.jain.derivatives`), others by kernels that carry them along (`flexmb.jit.duals`), and what follows from them by
linear equations is solved for. `docs/derivatives.md` says what is held fixed.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar, overload

import numpy as np

from flexmb.entry.derivatives import DerivativeWorkspace, derivative_workspace, inverse_dynamics_derivatives
from flexmb.entry.tangent import TangentWorkspace, tangent_workspace
from flexmb.entry.variation import ByAllDirections, FreeVariation, TreeVariation
from flexmb.jit.direct import Direct, direct
from flexmb.jit.pointer import MATRIX, REAL, VECTOR, VOID
from flexmb.kept import kept
from flexmb.scene.open_loop import refuse_feedback
from flexmb.scene.sizes import refuse_large_matrix
from flexmb.system.complex_step import load_row, section_row
from flexmb.system.derivative_evaluator import DerivativeEvaluator, fresh_derivative_evaluator
from flexmb.system.derivative_records import (
    AccelerationDerivatives,
    EvaluationDerivatives,
    InverseDynamicsDerivatives,
    OfFreeMotion,
    OfGivenMotion,
    by_names,
)
from flexmb.system.evaluator import Refusal
from flexmb.system.free_motion import FreeMotion
from flexmb.system.kinks import has_corners, refuse_kinks
from flexmb.system.load_axes import Axes, referred
from flexmb.system.pushforward import Directions, GivenMotion, Pushforward, pushforward
from flexmb.system.section_loads import SectionBalance
from flexmb.tables.per_thread import per_thread
from flexmb.tables.state import State, finite_result
from flexmb.typing import Flags, Index, Real

if TYPE_CHECKING:
    from flexmb.closure.variation import ChainVariation

_Four = TypeVar("_Four", OfFreeMotion, OfGivenMotion)
INSTEAD = "have the controllers chained through by flexmb.ControlledMotion(scene)"


class DifferentiableMotion(FreeMotion):
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
        return AccelerationDerivatives(at.accelerations, *at.of_accelerations, at.motion)

    def derivative_evaluator(self) -> DerivativeEvaluator:
        """`acceleration_derivatives` for a loop: `udot = evaluator(t, q, u)` writes derivatives into its arrays.

        A call costs 0.1 us in addition to the kernel. The kernel is compiled here, not at the first call.
        NotImplementedError for scenes with controllers, and closures on bodies of level `ruthless`.
        """
        refuse_feedback(self.scene, "system.derivative_evaluator", INSTEAD)
        return fresh_derivative_evaluator(self, self.refusal)

    def inverse_dynamics_derivatives(self, state: State, accelerations: Real) -> InverseDynamicsDerivatives:
        """Derivatives of `inverse_dynamics` at these accelerations (nu,); of closed chains those of the tree alone."""
        t, y = self._differentiable(state, "system.inverse_dynamics_derivatives")
        rates = self.layout.rates("accelerations", accelerations)
        by_displacement, by_speed, M = (np.empty((self.nu, self.nu)) for _ in range(3))
        self._differentiate_inverse(t, y, rates, by_displacement, by_speed, M)
        held = self.constants.speed["prescribed"] >= 0
        by_displacement[:, held] = by_speed[:, held] = 0.0
        for part in (by_displacement, by_speed, M):
            finite_result(part, t)
        return InverseDynamicsDerivatives(
            self.inverse_dynamics(state, rates), by_displacement, by_speed, M, self._inverse_by_time(t, y, rates),
            self._variations.motion.at(t, y),
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
        if accelerations is None:
            row, change, _ = self._free_row(t, y)
            return by_names(self.observation, row, change, partial(_split, self.nu, OfFreeMotion))
        motion, directions = self._as_given(t, y, self._given(accelerations))
        row, change = self._row_along(motion, directions)
        return by_names(self.observation, row, change, partial(_split, self.nu, OfGivenMotion))

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
        found = finite_result(change, t).reshape(*is_open.shape, change.shape[-1])
        return _split(self.nu, OfFreeMotion, np.where(is_open[..., None], np.nan, found))

    # What closed chains do otherwise

    def _variation(self, t: float, y: Real) -> FreeVariation:
        """How the free motion changes."""
        found = self._variations.at(t, y)
        self.check_precision(t, y, self._variations)
        for part in (found.accelerations, *found.of_accelerations):  # loads of rows that overflow overflow these
            finite_result(part, t)
        return found

    @per_thread
    def _variations(self) -> TreeVariation | ChainVariation:
        w = self.own_derivatives, self.own_tangent, self.own_workspace
        return TreeVariation(self.constants, *w, self.check_status)

    def _inverse_by_time(self, t: float, y: Real, rates: Real) -> Real:
        """The same of inverse dynamics at these accelerations (nu,)."""
        if not len(self.constants.function):
            return np.zeros(self.nu)
        motion, push = GivenMotion(t, y, rates, np.zeros(self._row_count)), self._pushforward
        later = self._directions(np.zeros((self.nq, 0)), 0)
        found = push.derivatives(motion, later, lambda lanes: push.x.tau[:, lanes])
        return finite_result(found, t)[:, 0]

    @per_thread
    def _pushforward(self) -> Pushforward:
        return pushforward(self.constants, self.own_tangent, self.observation.out, self.check_status)

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

    # Tables and kernels of derivatives

    @per_thread
    def own_tangent(self) -> TangentWorkspace:
        return tangent_workspace(self.constants, self.nq, self.nu)

    @per_thread
    def own_derivatives(self) -> DerivativeWorkspace:
        return derivative_workspace(self.constants, self.nq, self.nu)

    @per_thread
    def _differentiate_inverse(self) -> Direct:
        """(t, y, rates, by_displacement, by_speed, by_acceleration)."""
        tables = self.constants, self.own_derivatives
        return direct(inverse_dynamics_derivatives, VOID, REAL, VECTOR, VECTOR, MATRIX, MATRIX, MATRIX, *tables)

    # Directions

    def _differentiable(self, state: State, what: str) -> tuple[float, Real]:
        """Time and y of a state at which derivatives exist; NotImplementedError for scenes with controllers, ValueError
        for a scene with so many speeds that a matrix of derivatives would be too large."""
        refuse_large_matrix(self.nu, what, "take a scene of fewer bodies or modes: derivatives by all speeds are dense")
        refuse_feedback(self.scene, what, INSTEAD)
        return self._without_kinks(state, what)

    def _without_kinks(self, state: State, what: str) -> tuple[float, Real]:
        """The same for what is driven by given values."""
        t, y = self.layout.entering(state)
        self.refuse_corners(t, y)
        return t, y

    @kept
    def has_corners(self) -> bool:
        """Whether a law of the scene has corners, at which no derivatives exist."""
        return has_corners(self.constants)

    @property
    def refusal(self) -> Refusal | None:
        """What refuses corners; None where no law has any."""
        return self.refuse_corners if self.has_corners else None

    def refuse_corners(self, t: float, y: Real) -> None:
        """NotDifferentiableError where a law has a corner at y = [q, u, work]: the one check of all derivatives."""
        if self.has_corners:
            self._inverse(t, y, np.zeros(self.nu))  # evaluates the connectors
            refuse_kinks(self, self.own_workspace)

    def _free_row(self, t: float, y: Real) -> FreeRow:
        """Everything observable of the free motion; NaN where this does not determine it."""
        motion, directions = self._freely(t, y)
        row, change = self._row_along(motion, directions)
        self._relieve_drives(change)
        change[self._open_row(t, y)] = np.nan
        return FreeRow(row, change, directions.state[: self.nq, : self.nu])

    def _row_along(self, motion: GivenMotion, directions: Directions) -> tuple[Real, Real]:
        """A row (E,) of everything observable, and its derivatives along directions."""
        push = self._pushforward
        change = finite_result(push.derivatives(motion, directions, push.row), motion.t)
        return push.row(slice(0, 1))[:, 0], change

    def _freely(self, t: float, y: Real) -> tuple[GivenMotion, Directions]:
        """The free motion, and how it changes by displacements and speeds, forces and time."""
        at = self._variation(t, y)
        state, time = self._directions(at.motion, self.nu)[::3]
        motion = GivenMotion(t, y, at.accelerations, at.rows.loads)
        return motion, Directions(state, at.of_accelerations.by_all, at.rows.of_loads.by_all, time)

    def _under_forces(self, at: FreeVariation, t: float, y: Real, forces: Real) -> FreeVariation:
        """The motion under further generalised forces (nu,), which the scene's motion `at` is without.

        They add accelerations x and row loads f with M x - J'f = forces and J x = 0. In a direction these change by
        M dx - J'df = -(dM x - dJ'f) and J dx = -dJ x.
        """
        push, rows, nu = self._pushforward, at.rows, self.nu
        x, f = at.of_accelerations.by_force @ forces, rows.of_loads.by_force @ forces
        directions = self._directions(at.motion, 0)

        def left(accelerations: Real, loads: Real) -> Real:
            """Derivatives of M accelerations - J' loads + c and J accelerations + gamma."""
            return push.derivatives(GivenMotion(t, y, accelerations, loads), directions, push.balance)

        drift, opening = np.vsplit(finite_result(left(x, f) - left(np.zeros(nu), np.zeros(len(f))), t), [nu])

        def turned(of: ByAllDirections, by_row: Real) -> ByAllDirections:
            less = of.by_force @ drift + by_row @ opening
            by_displacement, by_speed, by_time = np.hsplit(less, [nu, 2 * nu])
            return ByAllDirections(
                of.by_displacement - by_displacement, of.by_speed - by_speed, of.by_force, of.by_time - by_time[:, 0]
            )

        return at._replace(
            accelerations=at.accelerations + x, of_accelerations=turned(at.of_accelerations, rows.lever),
            rows=rows._replace(loads=rows.loads + f, of_loads=turned(rows.of_loads, rows.inertia)),
        )  # fmt: skip

    def _as_given(self, t: float, y: Real, rates: Real) -> tuple[GivenMotion, Directions]:
        """A motion with these accelerations, and its changes by displacements, speeds, accelerations and time."""
        directions = self._directions(self._variations.motion.at(t, y), self.nu)
        directions.accelerations[:, 2 * self.nu : -1] = np.eye(self.nu)
        return GivenMotion(t, y, rates, np.zeros(0)), directions

    def _directions(self, N: Real, others: int) -> Directions:
        """Changes of [q, u] by displacements and speeds, as many as N (nq,...) has, then `others` in which nothing
        changes, then time, at the same accelerations and loads."""
        k, nq = N.shape[1], self.nq
        state, rates, loads = (np.zeros((n, 2 * k + others + 1)) for n in (nq + self.nu, self.nu, self._row_count))
        found = Directions(state, rates, loads, np.zeros(2 * k + others + 1))
        found.state[:nq, :k], found.state[nq:, k : 2 * k] = N, np.eye(self.nu, k)
        found.time[-1] = 1.0
        return found

    def _relieve_drives(self, change: Real) -> None:
        """A force along a prescribed speed relieves its drive, and does nothing else."""
        driven: Index = np.flatnonzero(self.constants.speed["prescribed"] >= 0)
        change[self.observation.columns["drives"][0].start + driven, 2 * self.nu + driven] -= 1.0


class FreeRow(NamedTuple):
    """A row (E,) of everything observable, its change (E,3nu+1) by displacements, speeds, forces and time, and the
    change (nq,nu) of the coordinates by displacements."""

    value: Real
    change: Real
    motion: Real


def free_row(system: DifferentiableMotion, state: State, what: str) -> FreeRow:
    """Of the free motion, with the outputs of controllers held at what the functions of time have now."""
    return system._free_row(*system._without_kinks(state, what))


def _split(nu: int, kind: type[_Four], change: Real) -> _Four:
    """A record of derivatives (...,3nu+1), whose columns are those of `_freely` or `_as_given`."""
    return kind(change[..., :nu], change[..., nu : 2 * nu], change[..., 2 * nu : 3 * nu], change[..., 3 * nu])
