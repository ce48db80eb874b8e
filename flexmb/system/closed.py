"""A compiled scene with closures: the system of its tree, and the accelerations and loads of the closed chain."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import fields
from functools import partial
from typing import TYPE_CHECKING, Any, assert_never

import numpy as np
from numpy.typing import NDArray

from flexmb.closure import dynamics as closed_dynamics
from flexmb.closure import jacobian as closed_jacobian
from flexmb.closure.asked import NOTHING_ASKED, AskedFor
from flexmb.closure.assembly import consistent
from flexmb.closure.branch import noticed, watch_steps
from flexmb.closure.closures import ClosedMotion, ClosureError, Closures, Spread, called
from flexmb.closure.constants import closure_constants, slowest_mode
from flexmb.closure.jacobian import chain_jacobian
from flexmb.closure.leap import back, beside, leap
from flexmb.closure.operators import ClosureOperators, closure_operators
from flexmb.closure.tables import Closed
from flexmb.entry import articulated
from flexmb.integrate.problem import Leaping, Linear
from flexmb.scene import schema as s
from flexmb.scene.problems import SceneWarning
from flexmb.system import algorithms
from flexmb.system.algorithm import Algorithm, Route
from flexmb.system.asking import asked, everything
from flexmb.system.chain_derivatives import ChainDerivatives
from flexmb.system.evaluator import Evaluator
from flexmb.system.free_motion import Given
from flexmb.system.load_axes import Axes
from flexmb.system.observables import Evaluation
from flexmb.system.section_loads import AllLoads, SectionBalance
from flexmb.system.tree_system import System, copied
from flexmb.tables import arguments
from flexmb.tables.features import asking
from flexmb.tables.state import DynamicsError, State, finite_result, pack
from flexmb.typing import Flags, Index, Real, Record

if TYPE_CHECKING:
    from flexmb.frisch.nested_system import NestedSystem
    from flexmb.jain.operators import Operators

# Largest gap of a closure, relative to its size, that a given state may have. At a distance of d sizes from a crossing
# of branches their gaps differ by d^2: with this gap the nearest branch is unique from a tenth of the size on.
LARGEST_INITIAL_GAP = 1e-2


class ClosedSystem(ChainDerivatives, System):
    """A tree with closures. Mass matrix, bias and inverse dynamics are those of the tree alone.

    `closure_operators` gives the terms that closures add. Operators and partitions, which belong to the accelerations
    of a tree, raise NotImplementedError.
    """

    def __init__(self, scene: s.Scene, *, like: s.Scene | None = None) -> None:
        """like: see `SceneArrays`."""
        super().__init__(scene, like=like)
        own = closure_constants(scene, self.constants, self.closure_ports, self.links, like)
        slowest = slowest_mode(self.links)
        tree = scene.constraints, (self.constants, own), self.layout, self.workspace, slowest
        self._closures = self.own.closures = Closures(*tree, self.check_status)  # for this thread
        self._start: State | None = None

    def with_numbers(self, scene: s.Scene) -> ClosedSystem:
        """As for a tree. Its closures close the initial values of that scene, as those of a run of it do."""
        with asking(self.kernels):
            return ClosedSystem(scene, like=self.scene)

    def __reduce__(self) -> tuple[Any, ...]:
        """As for a tree."""
        return copied, (ClosedSystem, self.kernels, self.scene)

    @property
    def initial_state(self) -> State:
        """The state closest to the scene's at t = 0 that closes all closures; ClosureError where there is none.

        Closest in the metric of kinetic energy, first for the coordinates, then for the speeds; bodies deform only
        where hinges cannot close a loop. Prescribed motions have the values of their functions. Values that the scene
        gives are kept exactly where the others can adapt (see `flexmb.scene.hinges.AngularCoordinate`). Otherwise a
        `SceneWarning` lists the changes, or a ClosureError is raised for values that are marked as given.
        """
        if self._start is None:
            y = pack(super().initial_state)
            y = self._as_asked(0.0, y, asked(self, y))
            self._start = State(y[: self.nq], y[self.nq : -1], 0.0, self.layout)
        return State(self._start.q, self._start.u, 0.0, self.layout)

    @property
    def rank(self) -> int:
        """Number of independent constraints at the initial state."""
        self.initial_state  # noqa: B018 - determines the rank
        return self.closures.rank

    def _as_asked(self, t: float, y: Real, wish: AskedFor) -> Real:
        """y = [q, u, work] with closed closures; warns of values that it cannot keep."""
        found = consistent(self.closures, t, y, wish)
        broken = wish.broken(y, found)
        if broken:
            warnings.warn(
                f'scene "{self.scene.name}": the closures do not allow these values together, and the nearest values '
                f"that they allow are taken: {broken}. Correct the values, leave those out that follow from others, or "
                "mark those that must be kept by given = true",
                SceneWarning,
                stacklevel=4,
            )
        return found

    def admissible(self, state: State, given: Given = "guess") -> State:
        """The nearest state that closes all closures, with prescribed motions at their values.

        ClosureError where a closure is open by more than `LARGEST_INITIAL_GAP` in the given state.
        """
        t, rough = self.layout.entering(super().admissible(state))
        self.closures.linearise(t, rough)
        errors = self.closures.errors()
        if not np.max(np.abs(errors), initial=0.0) <= LARGEST_INITIAL_GAP:
            raise ClosureError(
                f"{self.closures.worst(errors)}: the state that is given leaves this open: give coordinates that close "
                "it at least roughly, or leave those out that the closures determine"
            )
        return self.layout.known(t, self._as_asked(t, rough, self._wish(rough, given)))

    def _wish(self, y: Real, given: Given) -> AskedFor:
        if isinstance(given, np.ndarray):
            return asked(self, y, given)
        match given:
            case "guess":
                return NOTHING_ASKED
            case "scene":
                return asked(self, y)
            case "state":
                return everything(self)
        assert_never(given)

    def accelerations(self, state: State, algorithm: Algorithm = "articulated") -> Real:
        """udot (nu,) of the closed chain under all loads, at a state that closes all closures.

        Raises DynamicsError where an inertia is not positive definite, the closures are singular, or numbers are so
        large that they overflow.
        """
        t, y = self.layout.entering(state)
        return finite_result(self._motion(t, y, algorithm).accelerations, t)

    def evaluator(self, algorithm: Algorithm = "articulated") -> Evaluator:
        """Raises NotImplementedError: evaluators are for trees only."""
        raise NotImplementedError(
            f'scene "{self.scene.name}" has closures or couplings, and evaluators are for trees only: '
            "use accelerations(state)"
        )

    def _motion(self, t: float, y: Real, algorithm: Algorithm) -> ClosedMotion:
        found = self._on_chains(algorithm)(self.closures, t, y)
        self.check_precision(t, y, self.closures)
        return found

    def hinge_loads(
        self,
        state: State,
        accelerations: Real | None = None,
        *,
        axes: Axes = "world",
        about: tuple[str, str] | None = None,
    ) -> dict[str, Real]:
        """Total load (6,) [torque; force] across each hinge and closure on the outboard body (body_b).

        `axes` and `about` as for a tree; frames "inboard" and "outboard" of a closure are A and B.
        """
        if accelerations is not None:
            raise NotImplementedError(
                f'scene "{self.scene.name}" has closures, and hinge loads for given accelerations are for trees only: '
                "leave accelerations out, or prescribe coordinates"
            )
        t, y = self.layout.entering(state)
        return self._referred(self._motion(t, y, "articulated"), state, axes, about)

    def referred_loads(
        self, state: State, loads: dict[str, Real], axes: Axes = "world", about: tuple[str, str] | None = None
    ) -> dict[str, Real]:
        """As for a tree. Where loads are not determined by the motion, they are computed again to find which components
        in the new axes are determined; not so in scenes with controllers."""
        t, y = self.layout.entering(state)
        if self.scene.controllers or all(np.all(np.isfinite(load)) for load in loads.values()):
            return super().referred_loads(state, loads, axes, about)
        return self._referred(self._motion_or_across(t, y, "articulated"), state, axes, about)

    def _referred(
        self, motion: ClosedMotion, state: State, axes: Axes, about: tuple[str, str] | None
    ) -> dict[str, Real]:
        """Loads of a motion in other axes about a node, NaN where the motion does not determine them."""
        refer = partial(super().referred_loads, state, axes=axes, about=about)
        found = refer(self._by_load(motion.hinges, motion.closures))
        if motion.spread is None:
            return {name: finite_result(load, state.t) for name, load in found.items()}
        changes = [refer(each) for each in self._changes(motion.spread)]
        for name, load in found.items():
            finite_result(load, state.t)
            found[name] = np.where(motion.spread.leaves_open(np.array([each[name] for each in changes])), np.nan, load)
        return found

    def _by_load(self, hinges: NDArray[Any], closures: NDArray[Any]) -> dict[str, NDArray[Any]]:
        """Rows for hinges (N,6) and closures (C,6) by their names."""
        names = [closure.name for closure in self.scene.constraints]
        return self._by_hinge(hinges) | dict(zip(names, closures, strict=True))

    def _changes(self, spread: Spread) -> list[dict[str, Real]]:
        """For each null load the changes (6,) of the loads by name, World axes."""
        return [self._by_load(*each) for each in zip(spread.hinges, spread.closures, strict=True)]

    def all_loads(self, state: State) -> AllLoads:
        """As for a tree, with the changes by null loads of redundant closures; `exerted` has the minimum-norm loads."""
        t, y = self.layout.entering(state)
        motion = self._motion(t, y, "articulated")
        found = self._evaluation(t, y, motion._replace(spread=None))
        self._inverse(t, y, found.accelerations)
        spread = motion.spread
        more = () if spread is None else (self._changes(spread), spread.rounding)
        return AllLoads(t, found, self.own_workspace, *more)

    def _evaluate(self, t: float, y: Real, algorithm: Algorithm) -> Evaluation:
        return self._evaluation(t, y, self._motion(t, y, algorithm))

    def _evaluation(self, t: float, y: Real, motion: ClosedMotion) -> Evaluation:
        return self.observation.evaluation(self._row(t, y, motion))

    def observe_row(self, t: float, y: Real, algorithm: Algorithm, row: Real) -> None:
        """As for a tree, and also at a singular position in a run."""
        t, y = arguments.number("t", t), self._fitting(y)
        row[:] = self._row(t, y, self._motion_or_across(t, y, algorithm))

    def _row(self, t: float, y: Real, motion: ClosedMotion) -> Real:
        """A row with the loads of closures; NaN where the motion does not determine loads."""
        self.observe_motion(t, y, motion.accelerations, motion.drives, motion.hinges)
        row = self.observation.row(t, motion.closures)
        if motion.spread is not None:
            row[self.observation.undetermined(motion.spread.open_parts)] = np.nan
        return row

    def _motion_or_across(self, t: float, y: Real, algorithm: Algorithm) -> ClosedMotion:
        """The motion; at a singular position in a run, where it is not determined, the mean of those on either side."""
        try:
            return self._motion(t, y, algorithm)
        except DynamicsError:
            if not self.closures.is_singular:
                raise
        slope = np.empty_like(y)
        articulated.rhs(t, y, slope, self.constants, self.workspace())
        sides = [self.closures.beside(t, y, slope[: self.nq], side) for side in (-1, 1)]
        before, after = (self._motion(*each, algorithm) for each in sides)
        means = (0.5 * (one + other) for one, other in zip(before[:-1], after[:-1], strict=True))
        return ClosedMotion._make((*means, _of_both(before.spread, after.spread)))

    def determined_loads(self, state: State) -> dict[str, NDArray[np.bool_]]:
        """Which components (6,) of the loads of hinges and closures are determined by the motion; World axes.

        The others, in overconstrained mechanisms of rigid bodies, are NaN wherever loads are given (`evaluate`).
        """
        hinges, closures = self.closures.determined(*self.layout.entering(state))
        names = [link.hinge.name for link in self.links], [closure.name for closure in self.scene.constraints]
        return dict(zip(names[0], hinges, strict=True)) | dict(zip(names[1], closures, strict=True))

    def closure_operators(self, state: State) -> ClosureOperators:
        """J, the inertia of the tree reflected at the closures J M^-1 J' (its inverse), and the loads that follow.

        Jain & Rodriguez, section VIII. Raises DynamicsError where the closures are singular.
        """
        return closure_operators(self.closures, *self.layout.entering(state))

    def _open_row(self, t: float, y: Real) -> Flags:
        return np.isnan(self._row(t, y, self._motion(t, y, "articulated")))

    def _open_loads(self, state: State, axes: Axes, about: tuple[str, str] | None) -> dict[str, Flags]:
        return {name: np.isnan(load) for name, load in self.hinge_loads(state, axes=axes, about=about).items()}

    def _open_sections(self, state: State, balance: SectionBalance) -> Flags:
        return np.isnan(balance.at(self.all_loads(state)))

    def nested(self, algorithm: Algorithm = "frisch") -> NestedSystem:
        """Raises NotImplementedError."""
        raise self._for_trees("Frisch's partitioned equations")

    def operators(self, state: State) -> Operators:
        """Raises NotImplementedError."""
        raise self._for_trees("the spatial operators")

    def _for_trees(self, what: str) -> NotImplementedError:
        return NotImplementedError(
            f'scene "{self.scene.name}" has closures or couplings, and {what} are for trees only: '
            "closure_operators(state) gives the terms that closures add, and flexmb.System(scene) is the tree alone, "
            "which moves differently"
        )

    def closure_gaps(self, state: State) -> dict[str, tuple[float, float]]:
        """Gap of each closure along its constrained directions: distance (m) and sine of the angle."""
        return self.closures.gaps(*self.layout.entering(state))

    def route(self, algorithm: Algorithm = "articulated", stabilise: float = 0.0) -> Route:
        """What a run needs of the algorithm; `stabilise`: see `flexmb.simulate`.

        NotImplementedError for an algorithm that is for trees only, ClosureError for a mechanism that cannot move.
        """
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
        tangent = chain_jacobian(chain, self.nq, self.nu)
        on_group = closed_jacobian.move, closed_jacobian.resolve
        return Linear(closed_jacobian.jacobian, *on_group, chain, tangent, settles=True)

    def _on_chains(self, algorithm: Algorithm) -> Callable[[Closures, float, Real], ClosedMotion]:
        """The algorithm's function for closed chains; NotImplementedError if it has none."""
        motion = algorithms.chosen(algorithm).closed_motion
        if motion is None:
            known = " or ".join(f'"{name}"' for name in algorithms.ON_CHAINS)
            raise NotImplementedError(
                f'scene "{self.scene.name}" has closures or couplings, and algorithm {algorithm!r} is for trees only: '
                f"use algorithm={known}"
            )
        return motion

    def _refuse_locked(self) -> None:
        if self.closures.rank < 0:
            self.initial_state  # noqa: B018 - determines the rank
        locked = self.closures.mobility == 0 < self.closures.rank  # a tree of welds is not locked by its closures
        if locked and not np.any(self.constants.speed["prescribed"] >= 0):
            names = ", ".join(map(called, self.scene.constraints))
            raise ClosureError(
                f"{names} leave none of the {self.nu} free speeds: the mechanism is locked. Free a "
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
