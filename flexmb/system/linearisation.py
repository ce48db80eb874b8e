"""Exact derivatives at one state: of accelerations, of inverse dynamics, and of everything observable.

No differences are formed: derivatives of the equations of motion of a tree are found by recursion
(`flexmb.jain.derivatives`), others by kernels that carry them along (`flexmb.jit.duals`), and what follows from them by
linear equations is solved for. `docs/derivatives.md` says what is held fixed.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from flexmb.entry.derivatives import inverse_dynamics_derivatives
from flexmb.entry.variation import ByAllDirections, FreeVariation, TreeVariation, VariedAccelerations
from flexmb.jit.direct import Direct, direct
from flexmb.jit.pointer import MATRIX, REAL, VECTOR, VOID
from flexmb.kept import kept
from flexmb.scene.open_loop import refuse_feedback
from flexmb.scene.sizes import refuse_large_matrix
from flexmb.system.complex_step import load_row, section_row
from flexmb.system.derivative_evaluator import DerivativeEvaluator, fresh_derivative_evaluator
from flexmb.system.derivative_records import (
    AccelerationDerivatives,
    InverseDynamicsDerivatives,
    OfFreeMotion,
    OfGivenMotion,
    by_names,
)
from flexmb.system.evaluator import Refusal
from flexmb.system.kinks import has_corners, refuse_kinks
from flexmb.system.load_axes import Axes, referred
from flexmb.system.mechanics import Mechanics
from flexmb.system.pushforward import Directions, GivenMotion, Pushforward, pushforward
from flexmb.system.section_loads import SectionBalance
from flexmb.tables.functions import any_varies
from flexmb.tables.per_thread import per_thread
from flexmb.tables.state import State, finite_result
from flexmb.typing import Index, Real

if TYPE_CHECKING:
    from flexmb.closure.tables import ClosureConstants
    from flexmb.closure.variation import ChainVariation
    from flexmb.system.constraints import Constraints

_Four = TypeVar("_Four", OfFreeMotion, OfGivenMotion)
_Varied = TypeVar("_Varied", FreeVariation, VariedAccelerations)
INSTEAD = "have the controllers chained through by flexmb.ControlledMotion(scene)"


class Linearisation:
    """The derivatives of what one system gives at one state; `System` has the public methods, which end here.

    All methods raise NotImplementedError for scenes with controllers, `NotDifferentiableError` (a DynamicsError) where
    a law has a corner, and DynamicsError, ValueError and TypeError as the methods do that give the values.
    """

    def __init__(self, system: Mechanics, constraints: Constraints | None) -> None:
        self._system, self._constraints = system, constraints

    def of_accelerations(self, state: State, forces: Real | None) -> AccelerationDerivatives:
        """See `System.acceleration_derivatives`."""
        t, y = self._differentiable(state, "system.acceleration_derivatives")
        at: FreeVariation | VariedAccelerations
        if forces is None:
            variations = self._variations
            at = self._sound(t, y, variations.of_accelerations(t, y), variations)
        else:
            at = self._under_forces(self._variation(t, y), t, y, self._system.layout.rates("forces", forces))
        return AccelerationDerivatives.known(at.accelerations, at.of_accelerations, at.motion)

    def evaluator(self) -> DerivativeEvaluator:
        """See `System.derivative_evaluator`."""
        refuse_feedback(self._system.scene, "system.derivative_evaluator", INSTEAD)
        if self._constraints is None:
            return fresh_derivative_evaluator(self._system, self.refusal)
        self._constraints.require_rows("system.derivative_evaluator")
        return fresh_derivative_evaluator(self._system, self.refusal, self._constraints.derivative_route)

    def of_inverse_dynamics(self, state: State, accelerations: Real) -> InverseDynamicsDerivatives:
        """See `System.inverse_dynamics_derivatives`."""
        t, y = self._differentiable(state, "system.inverse_dynamics_derivatives")
        rates = self._system.layout.rates("accelerations", accelerations)
        by_displacement, by_speed, M = (np.empty((self._system.nu, self._system.nu)) for _ in range(3))
        self._differentiate_inverse(t, y, rates, by_displacement, by_speed, M)
        held = self._system.constants.speed["prescribed"] >= 0
        by_displacement[:, held] = by_speed[:, held] = 0.0
        for part in (by_displacement, by_speed, M):
            finite_result(part, t)
        return InverseDynamicsDerivatives(
            self._system.inverse_dynamics(state, rates), by_displacement, by_speed, M,
            self._inverse_by_time(t, y, rates), self._variations.motion.at(y),
        )  # fmt: skip

    def of_evaluation(self, state: State, accelerations: Real | None) -> Any:
        """See `System.evaluation_derivatives`."""
        t, y = self._differentiable(state, "system.evaluation_derivatives")
        if accelerations is None:
            row, change, _ = self._free_row(t, y)
            return by_names(self._system.observation, row, change, partial(_split, self._system.nu, OfFreeMotion))
        motion, directions = self._as_given(t, y, self._given(accelerations))
        row, change = self._row_along(motion, directions)
        return by_names(self._system.observation, row, change, partial(_split, self._system.nu, OfGivenMotion))

    def of_hinge_loads(self, state: State, axes: Axes, about: tuple[str, str] | None) -> dict[str, OfFreeMotion]:
        """See `System.hinge_load_derivatives`."""
        t, y = self._differentiable(state, "system.hinge_load_derivatives")
        referred(self._system, self._system.own_workspace, {}, axes, about)  # refuses unknown axes and nodes
        push, seen = self._pushforward, (axes, about)
        motion, directions = self._freely(t, y)
        observation = self._system.observation
        change = push.derivatives(motion, directions, partial(load_row, self._system, push, observation, seen))
        names = *observation.names.hinges, *observation.names.closures
        changes = dict(zip(names, finite_result(change, t).reshape(len(names), 6, -1), strict=True))
        if self._constraints is not None:
            for name, load in self._constraints.hinge_loads(state, None, axes, about).items():
                changes[name][np.isnan(load)] = np.nan
        return {name: _split(self._system.nu, OfFreeMotion, block) for name, block in changes.items()}

    def of_section_loads(self, state: State, body: str, x: Any) -> OfFreeMotion:
        """See `System.section_load_derivatives`."""
        t, y = self._differentiable(state, "system.section_load_derivatives")
        balance, push = SectionBalance(self._system, body, x), self._pushforward
        motion, directions = self._freely(t, y)
        change = push.derivatives(motion, directions, partial(section_row, balance, push, self._system.observation))
        changes = finite_result(change, t).reshape(len(balance.x), 6, change.shape[-1])
        if self._constraints is not None:
            changes[np.isnan(balance.at(self._constraints.all_loads(t, y)))] = np.nan
        return _split(self._system.nu, OfFreeMotion, changes)

    # The motion, and what changes with it

    def _variation(self, t: float, y: Real) -> FreeVariation:
        """How the free motion changes."""
        variations = self._variations
        return self._sound(t, y, variations.at(t, y), variations)

    def _sound(self, t: float, y: Real, found: _Varied, variations: TreeVariation | ChainVariation) -> _Varied:
        """The motion itself, whose derivatives are finite; a warning or DynamicsError where rounding leaves few digits
        or the accelerations overflow."""
        self._system.check_precision(t, y, variations)
        finite_result(found.accelerations, t)
        return found

    @per_thread
    def _variations(self) -> TreeVariation | ChainVariation:
        if self._constraints is not None:
            return self._constraints.variation(self._system.own_tangent)
        w = self._system.own_derivatives, self._system.own_tangent
        return TreeVariation(self._system.constants, *w, self._system.check_status)

    def _inverse_by_time(self, t: float, y: Real, rates: Real) -> Real:
        """The same of inverse dynamics at these accelerations (nu,)."""
        if not any_varies(self._system.constants.function):
            return np.zeros(self._system.nu)
        motion, push = GivenMotion(t, y, rates, np.zeros(self._row_count)), self._pushforward
        later = self._directions(np.zeros((self._system.nq, 0)), 0)
        derivatives = push.derivatives(motion, later, lambda lanes: push.x.tau[:, lanes])
        return finite_result(derivatives, t)[:, 0]

    @per_thread
    def _pushforward(self) -> Pushforward:
        tables = self._system.constants, self._system.own_tangent, self._system.observation.out
        return pushforward(*tables, self._system.check_status, self._closures)

    @property
    def _closures(self) -> ClosureConstants | None:
        return None if self._constraints is None else self._constraints.tables

    @property
    def _row_count(self) -> int:
        """Number of rows of closures."""
        return 0 if self._closures is None else len(self._closures.row)

    def _given(self, accelerations: Real) -> Real:
        """Given accelerations (nu,), checked."""
        if self._constraints is not None:
            raise NotImplementedError(
                f'scene "{self._system.scene.name}" has closures, and derivatives of loads for given accelerations are '
                "for trees only: leave accelerations out, or prescribe coordinates"
            )
        return self._system.layout.rates("accelerations", accelerations)

    # Tables and kernels of derivatives

    @per_thread
    def _differentiate_inverse(self) -> Direct:
        """(t, y, rates, by_displacement, by_speed, by_acceleration)."""
        tables = self._system.derivative_constants, self._system.own_derivatives
        return direct(inverse_dynamics_derivatives, VOID, REAL, VECTOR, VECTOR, MATRIX, MATRIX, MATRIX, *tables)

    # Directions

    def _differentiable(self, state: State, what: str) -> tuple[float, Real]:
        """Time and y of a state at which derivatives exist; NotImplementedError for scenes with controllers, ValueError
        for a scene with so many speeds that a matrix of derivatives would be too large."""
        if not self._is_admitted:
            self._admit(what)
        return self._without_kinks(state, what)

    @kept
    def _is_admitted(self) -> bool:
        """Whether `_admit` raises nothing, which is so for all states or for none."""
        try:
            self._admit("derivatives")
        except (ValueError, NotImplementedError):
            return False
        return True

    def _admit(self, what: str) -> None:
        fewer = "take a scene of fewer bodies or modes: derivatives by all speeds are dense"
        refuse_large_matrix(self._system.nu, what, fewer)
        refuse_feedback(self._system.scene, what, INSTEAD)

    def _without_kinks(self, state: State, what: str) -> tuple[float, Real]:
        """The same for what is driven by given values; NotImplementedError for chains of bodies whose inertia is not
        where closures join them."""
        if self._constraints is not None:
            self._constraints.require_rows(what)
        t, y = self._system.layout.entering(state)
        self.refuse_corners(t, y)
        return t, y

    @kept
    def has_corners(self) -> bool:
        """Whether a law of the scene has corners, at which no derivatives exist."""
        return has_corners(self._system.constants) or self._system.has_friction_that_sticks

    @property
    def refusal(self) -> Refusal | None:
        """What refuses corners; None where no law has any."""
        return self.refuse_corners if self.has_corners else None

    def refuse_corners(self, t: float, y: Real) -> None:
        """NotDifferentiableError where a law has a corner at y = [q, u, work]: the one check of all derivatives."""
        if self.has_corners:
            self._system.refuse_undecided(t, y)
            self._system.inverse_at(t, y, np.zeros(self._system.nu))  # evaluates the connectors
            refuse_kinks(self._system, self._system.own_workspace)

    def free_row(self, state: State, what: str) -> FreeRow:
        """Of the free motion, with the outputs of controllers held at what the functions of time have now."""
        return self._free_row(*self._without_kinks(state, what))

    def _free_row(self, t: float, y: Real) -> FreeRow:
        """Everything observable of the free motion; NaN where this does not determine it."""
        motion, directions = self._freely(t, y)
        row, change = self._row_along(motion, directions)
        self._relieve_drives(change)
        if self._constraints is not None:
            change[np.isnan(self._constraints.row(t, y))] = np.nan
        return FreeRow(row, change, directions.state[: self._system.nq, : self._system.nu])

    def _row_along(self, motion: GivenMotion, directions: Directions) -> tuple[Real, Real]:
        """A row (E,) of everything observable, and its derivatives along directions."""
        push = self._pushforward
        change = finite_result(push.derivatives(motion, directions, push.row), motion.t)
        return push.row(slice(0, 1))[:, 0], change

    def _freely(self, t: float, y: Real) -> tuple[GivenMotion, Directions]:
        """The free motion, and how it changes by displacements and speeds, forces and time."""
        at = self._variation(t, y)
        state, time = self._directions(at.motion, self._system.nu)[::3]
        motion = GivenMotion(t, y, at.accelerations, at.rows.loads)
        return motion, Directions(state, at.of_accelerations.by_all, at.rows.of_loads.by_all, time)

    def _under_forces(self, at: FreeVariation, t: float, y: Real, forces: Real) -> FreeVariation:
        """The motion under further generalised forces (nu,), which the scene's motion `at` is without.

        They add accelerations x and row loads f with M x - J'f = forces and J x = 0. In a direction these change by
        M dx - J'df = -(dM x - dJ'f) and J dx = -dJ x.
        """
        push, rows, nu = self._pushforward, at.rows, self._system.nu
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
        directions = self._directions(self._variations.motion.at(y), self._system.nu)
        directions.accelerations[:, 2 * self._system.nu : -1] = np.eye(self._system.nu)
        return GivenMotion(t, y, rates, np.zeros(0)), directions

    def _directions(self, N: Real, others: int) -> Directions:
        """Changes of [q, u] by displacements and speeds, as many as N (nq,...) has, then `others` in which nothing
        changes, then time, at the same accelerations and loads."""
        k, nq, nu = N.shape[1], self._system.nq, self._system.nu
        state, rates, loads = (np.zeros((n, 2 * k + others + 1)) for n in (nq + nu, nu, self._row_count))
        directions = Directions(state, rates, loads, np.zeros(2 * k + others + 1))
        directions.state[:nq, :k], directions.state[nq:, k : 2 * k] = N, np.eye(nu, k)
        directions.time[-1] = 1.0
        return directions

    def _relieve_drives(self, change: Real) -> None:
        """A force along a prescribed speed relieves its drive, and does nothing else."""
        driven: Index = np.flatnonzero(self._system.constants.speed["prescribed"] >= 0)
        change[self._system.observation.columns["drives"][0].start + driven, 2 * self._system.nu + driven] -= 1.0


class FreeRow(NamedTuple):
    """A row (E,) of everything observable, its change (E,3nu+1) by displacements, speeds, forces and time, and the
    change (nq,nu) of the coordinates by displacements."""

    value: Real
    change: Real
    motion: Real


def _split(nu: int, kind: type[_Four], change: Real) -> _Four:
    """A record of derivatives (...,3nu+1), whose columns are those of `_freely` or `_as_given`."""
    return kind(change[..., :nu], change[..., nu : 2 * nu], change[..., 2 * nu : 3 * nu], change[..., 3 * nu])
