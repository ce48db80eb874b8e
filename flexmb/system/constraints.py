"""The closures and couplings of a compiled scene: states that fulfil them, and the motion and loads of the chain."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import partial
from typing import Any, assert_never

import numpy as np
from numpy.typing import NDArray

from flexmb.closure import dynamics as closed_dynamics
from flexmb.closure import jacobian as closed_jacobian
from flexmb.closure.assembly import consistent
from flexmb.closure.branch import noticed, watch_steps
from flexmb.closure.closures import ClosedMotion, ClosureError, Closures, Spread, called
from flexmb.closure.constants import closure_constants, slowest_mode
from flexmb.closure.derivative_call import ChainDerivativeCall, chain_derivative_call, differentiate_chain
from flexmb.closure.given_values import NOTHING_ASKED, AskedFor
from flexmb.closure.jacobian import chain_jacobian
from flexmb.closure.leap import back, beside, leap
from flexmb.closure.operators import ClosureOperators, closure_operators
from flexmb.closure.tables import Closed, ClosureConstants
from flexmb.closure.variation import ChainVariation
from flexmb.entry import articulated
from flexmb.entry.tangent import TangentWorkspace
from flexmb.integrate.problem import Leaping, Linear
from flexmb.kept import kept
from flexmb.scene import schema as s
from flexmb.scene.problems import SceneWarning
from flexmb.scene.tree import closes, opens
from flexmb.system import algorithms
from flexmb.system.algorithm import Algorithm, Route
from flexmb.system.derivative_evaluator import DerivativeRoute
from flexmb.system.given_values import Given, asked, everything
from flexmb.system.load_axes import Axes, Redundant
from flexmb.system.mechanics import Mechanics
from flexmb.system.observables import Evaluation
from flexmb.system.section_loads import AllLoads
from flexmb.tables import arguments
from flexmb.tables.per_thread import Own, per_thread
from flexmb.tables.state import DynamicsError, State, finite_result, pack
from flexmb.typing import Index, Real, Record

# Largest gap of a closure, relative to its size, that a given state may have. At a distance of d sizes from a crossing
# of branches their gaps differ by d^2: with this gap the nearest branch is unique from a tenth of the size on.
LARGEST_INITIAL_GAP = 1e-2


class Constraints:
    """The closures of one system, and what its motion is under their loads."""

    def __init__(self, system: Mechanics, like: s.Scene | None) -> None:
        """like: see `SceneArrays`."""
        self._system, self.own, scene = system, Own(), system.scene
        self.tables: ClosureConstants = closure_constants(
            scene, system.constants, system.closure_ports, system.links, like
        )
        tree = scene.constraints, (system.constants, self.tables), system.layout, system.workspace
        self._shared = self.own.closures = Closures(*tree, slowest_mode(system.links), system.check_status)
        self._start: Real | None = None

    @per_thread
    def closures(self) -> Closures:
        """The closure equations with workspaces of this thread."""
        return self._shared.for_thread()

    @property
    def initial_state(self) -> State:
        """See `System.initial_state`."""
        system = self._system
        if self._start is None:
            y = pack(system.scene_state(0.0))
            y = self._as_asked(0.0, y, asked(system, y))
            self._start = y
        return system.layout.known(0.0, self._start.copy())

    @property
    def rank(self) -> int:
        """Number of independent constraints at the initial state."""
        self.initial_state  # noqa: B018 - determines the rank
        return self.closures.rank

    def _as_asked(self, t: float, y: Real, wish: AskedFor) -> Real:
        """y = [q, u, work] with closed closures; warns of values that it cannot keep."""
        state = consistent(self.closures, t, y, wish)
        broken = "" if np.array_equal(y, state) else wish.broken(y, state)
        if broken:
            warnings.warn(
                f'scene "{self._system.scene.name}": the closures do not allow these values together, and the nearest '
                f"values that they allow are taken: {broken}. Correct the values, leave those out that follow from "
                "others, or mark those that must be kept by given = true",
                SceneWarning,
                stacklevel=5,
            )
        return state

    def admissible(self, state: State, given: Given = "guess") -> State:
        """The nearest state that closes all closures, of one with prescribed motions at their values.

        ClosureError where a closure is open by more than `LARGEST_INITIAL_GAP` in the given state.
        """
        t, rough = self._system.layout.entering(state)
        self.closures.linearise(t, rough)
        errors = self.closures.errors()
        if not np.abs(errors).max(initial=0.0) <= LARGEST_INITIAL_GAP:
            raise ClosureError(
                f"{self.closures.worst(errors)}: the state that is given leaves this open: give coordinates that close "
                "it at least roughly, or leave those out that the closures determine"
            )
        return self._system.layout.known(t, self._as_asked(t, rough, self._wish(rough, given)))

    def _wish(self, y: Real, given: Given) -> AskedFor:
        if isinstance(given, np.ndarray):
            return asked(self._system, y, given)
        match given:
            case "guess":
                return NOTHING_ASKED
            case "scene":
                return asked(self._system, y)
            case "state":
                return self._everything
        assert_never(given)

    @kept
    def _everything(self) -> AskedFor:
        return everything(self._system)

    def accelerations(self, state: State, algorithm: Algorithm = "articulated") -> Real:
        """udot (nu,) of the closed chain under all loads, at a state that closes all closures."""
        t, y = self._system.layout.entering(state)
        if self._system.has_friction_that_sticks:
            self._system.refuse_undecided(t, y)
        return finite_result(self._motion(t, y, algorithm).accelerations, t)

    def _motion(self, t: float, y: Real, algorithm: Algorithm) -> ClosedMotion:
        motion_of = self._on_chains(algorithm)(self.closures, t, y)
        self._system.check_precision(t, y, self.closures)
        return motion_of

    def hinge_loads(
        self, state: State, accelerations: Real | None, axes: Axes, about: tuple[str, str] | None,
        redundant: Redundant = "open",
    ) -> dict[str, Real]:  # fmt: skip
        """See `System.hinge_loads`."""
        if accelerations is not None:
            raise NotImplementedError(
                f'scene "{self._system.scene.name}" has closures, and hinge loads for given accelerations are for '
                "trees only: leave accelerations out, or prescribe coordinates"
            )
        t, y = self._system.layout.entering(state)
        motion = self._motion(t, y, "articulated")
        match redundant:
            case "open":
                return self._referred(motion, state, axes, about)
            case "least_norm":
                return self._referred(motion._replace(spread=None), state, axes, about)
            case _:
                assert_never(redundant)

    def total_load(self, state: State, signs: Mapping[str, float], about: tuple[str, str]) -> Real:
        """See `System.total_load`; `signs` of the loads by the names of joints."""
        return self._total(self._motion(*self._system.layout.entering(state), "articulated"), state, signs, about)

    def total_load_across(self, state: State, signs: Mapping[str, float], about: tuple[str, str]) -> Real:
        """The same, and also at a singular position in a run."""
        motion = self._motion_across(*self._system.layout.entering(state), "articulated")
        return self._total(motion, state, signs, about)

    def _total(
        self, motion: ClosedMotion, state: State, signs: Mapping[str, float], about: tuple[str, str]
    ) -> Real:
        def summed(loads: dict[str, Real]) -> Real:
            there = self._system.in_axes(state, loads, axes="world", about=about)
            return np.asarray(np.sum([sign * there[name] for name, sign in signs.items()], axis=0))

        load = finite_result(summed(self._by_load(motion.hinges, motion.closures)), state.t)
        if motion.spread is None:
            return load
        changes = np.array([summed(change) for change in self._changes(motion.spread)])
        return np.where(motion.spread.leaves_open(changes), np.nan, load)

    def loads_across(self, state: State, axes: Axes, about: tuple[str, str] | None) -> dict[str, Real]:
        """The same loads, and also at a singular position in a run."""
        t, y = self._system.layout.entering(state)
        return self._referred(self._motion_across(t, y, "articulated"), state, axes, about)

    def _referred(
        self, motion: ClosedMotion, state: State, axes: Axes, about: tuple[str, str] | None
    ) -> dict[str, Real]:
        """Loads of a motion in other axes about a node, NaN where the motion does not determine them."""
        refer = partial(self._system.in_axes, state, axes=axes, about=about)
        referred = refer(self._by_load(motion.hinges, motion.closures))
        if motion.spread is None:
            return {name: finite_result(load, state.t) for name, load in referred.items()}
        changes = [refer(change) for change in self._changes(motion.spread)]
        for name, load in referred.items():
            finite_result(load, state.t)
            referred[name] = np.where(
                motion.spread.leaves_open(np.array([change[name] for change in changes])), np.nan, load
            )
        return referred

    def _by_load(self, hinges: NDArray[Any], closures: NDArray[Any]) -> dict[str, NDArray[Any]]:
        """Rows for hinges (N,6) and closures (C,6) by their names."""
        names = [closure.name for closure in self._system.scene.constraints]
        return self._system.by_hinge(hinges) | dict(zip(names, closures, strict=True))

    def _changes(self, spread: Spread) -> list[dict[str, Real]]:
        """For each null load the changes (6,) of the loads by name, World axes."""
        return [self._by_load(*rows) for rows in zip(spread.hinges, spread.closures, strict=True)]

    def all_loads(self, t: float, y: Real) -> AllLoads:
        """With the changes by null loads of redundant closures; `exerted` has the minimum-norm loads."""
        motion, system = self._motion(t, y, "articulated"), self._system
        evaluation = system.observation.evaluation(self._row_of(t, y, motion._replace(spread=None)))
        system.inverse_at(t, y, evaluation.accelerations)
        spread = motion.spread
        more = () if spread is None else (self._changes(spread), spread.rounding)
        return AllLoads(t, evaluation, system.own_workspace, *more)

    def evaluation(self, t: float, y: Real, algorithm: Algorithm) -> Evaluation:
        """Everything observable at y = [q, u, work]."""
        return self._system.observation.evaluation(self._row_of(t, y, self._motion(t, y, algorithm)))

    def row(self, t: float, y: Real) -> Real:
        """The same as a row with the loads of closures; NaN where the motion does not determine loads."""
        return self._row_of(t, y, self._motion(t, y, "articulated"))

    def row_across(self, t: float, y: Real, algorithm: Algorithm) -> Real:
        """The same, and also at a singular position in a run."""
        return self._row_of(t, y, self._motion_across(t, y, algorithm))

    def _row_of(self, t: float, y: Real, motion: ClosedMotion) -> Real:
        self._system.observe_motion(t, y, motion.accelerations, motion.drives, motion.hinges)
        row = self._system.observation.row(t, motion.closures)
        if motion.spread is not None:
            row[self._system.observation.undetermined(motion.spread.open_parts)] = np.nan
        return row

    def _motion_across(self, t: float, y: Real, algorithm: Algorithm) -> ClosedMotion:
        """The motion; at a singular position in a run, where it is not determined, the mean of those on either side."""
        try:
            return self._motion(t, y, algorithm)
        except DynamicsError:
            if not self.closures.is_singular:
                raise
        slope, system = np.empty_like(y), self._system
        articulated.rhs(t, y, slope, system.constants, system.workspace())
        sides = [self.closures.beside(t, y, slope[: system.nq], side) for side in (-1, 1)]
        before, after = (self._motion(*side, algorithm) for side in sides)
        means = (0.5 * (one + other) for one, other in zip(before[:-1], after[:-1], strict=True))
        return ClosedMotion._make((*means, _of_both(before.spread, after.spread)))

    def determined_loads(self, state: State) -> dict[str, NDArray[np.bool_]]:
        """See `System.determined_loads`."""
        hinges, closures = self.closures.determined(*self._system.layout.entering(state))
        return self._by_load(hinges, closures)

    def operators(self, state: State) -> ClosureOperators:
        """See `System.closure_operators`."""
        return closure_operators(self.closures, *self._system.layout.entering(state))

    # Derivatives

    def variation(self, dual: TangentWorkspace) -> ChainVariation:
        """How the motion changes, in this thread; `dual`: tables of the tree for dual numbers."""
        return ChainVariation(self.closures, dual)

    @property
    def derivative_route(self) -> DerivativeRoute:
        """The kernel of evaluators."""

        def fresh(system: Mechanics) -> tuple[Closed, ChainDerivativeCall]:
            return chain_derivative_call(self.closures, system.nq, system.nu)

        return DerivativeRoute("derivatives of closed chains", lambda: differentiate_chain, fresh)

    def require_rows(self, what: str) -> None:
        """Have the independent rows counted, without which no position is seen to be singular; NotImplementedError for
        bodies whose inertia is not where closures join them."""
        if self.closures.at_rest:
            raise NotImplementedError(
                f'scene "{self._system.scene.name}" has closures and bodies of level "ruthless", whose inertia is not '
                f'where closures join them, and {what} does not support that: use level "linear" or a better one'
            )
        if self.closures.rank < 0:
            self.initial_state  # noqa: B018 - counts them

    # Runs

    def route(self, algorithm: Algorithm, stabilise: float) -> Route:
        """What a run needs of the algorithm; `stabilise`: see `flexmb.simulate`."""
        self._on_chains(algorithm)
        if arguments.number("stabilise", stabilise) < 0.0:
            raise ValueError(f"stabilise is {stabilise:g}: give a positive rate (1/s), or 0 to project")
        self._refuse_locked()

        def tables() -> tuple[Closed, Closed]:
            chain = self.closures.chain(algorithm, stabilise)
            return chain, chain

        leaping = Leaping(back, leap, beside, watch_steps, noticed)
        beginning = stabilise, *self.closures.counted
        return Route(
            tables, closed_dynamics.rhs, closed_dynamics.project, leaping, self._linear, _remembered, beginning
        )

    def _linear(self, chain: Closed, _: Closed) -> Linear:
        tangent = chain_jacobian(chain, self._system.nq, self._system.nu)
        on_group = closed_jacobian.move, closed_jacobian.resolve
        return Linear(closed_jacobian.jacobian, *on_group, chain, tangent, settles=True)

    def _on_chains(self, algorithm: Algorithm) -> Callable[[Closures, float, Real], ClosedMotion]:
        """The algorithm's function for closed chains; NotImplementedError if it has none."""
        motion = algorithms.chosen(algorithm).closed_motion
        if motion is None:
            known = " or ".join(f'"{name}"' for name in algorithms.ON_CHAINS)
            raise NotImplementedError(
                f'scene "{self._system.scene.name}" has closures or couplings, and algorithm {algorithm!r} is for '
                f"trees only: use algorithm={known}"
            )
        return motion

    def _refuse_locked(self) -> None:
        """ClosureError for a mechanism without freedom. One that events close or open is a structure: it is at rest."""
        if self.closures.rank < 0:
            self.initial_state  # noqa: B018 - determines the rank
        locked = self.closures.mobility == 0 < self.closures.rank  # a tree of welds is not locked by its closures
        system = self._system
        is_meant = np.any(system.constants.speed["prescribed"] >= 0) or opens(system.scene) or closes(system.scene)
        if locked and not is_meant:
            names = ", ".join(map(called, system.scene.constraints))
            raise ClosureError(
                f"{names} leave none of the {self._system.nu} free speeds: the mechanism is locked. Free a "
                "hinge, or let bodies deform"
            )


def _remembered(chain: Closed) -> list[Record | Real | Index]:
    """The arrays that record the branch of a motion."""
    return [array for field in fields(chain.cw) if isinstance(array := getattr(chain.cw, field.name), np.ndarray)]


def _of_both(one: Spread | None, other: Spread | None) -> Spread | None:
    """The null loads of two motions together."""
    if one is None or other is None:
        return one or other
    changes = map(np.concatenate, zip(one[:-1], other[:-1], strict=True))
    return Spread._make((*changes, max(one.rounding, other.rounding)))
