"""A compiled scene with closures: the system of its tree, with the accelerations and loads of the closed chain."""

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
from flexmb.closure.jacobian import chain_tangent
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
from flexmb.system.evaluator import Evaluator
from flexmb.system.free_motion import Given
from flexmb.system.load_axes import Axes
from flexmb.system.observables import Evaluation
from flexmb.system.section_loads import AllLoads
from flexmb.system.tree_system import System, copied
from flexmb.tables import arguments
from flexmb.tables.per_thread import per_thread
from flexmb.tables.state import DynamicsError, State, finite_result, pack
from flexmb.typing import Index, Real, Record

if TYPE_CHECKING:
    from flexmb.frisch.nested_system import NestedSystem
    from flexmb.jain.operators import Operators

# Largest gap of a closure, relative to its size, in a state that is given. At a distance of d sizes from a crossing of
# branches their gaps differ by d^2: from a tenth of the size on, the nearest branch is the one that is meant.
LARGEST_INITIAL_GAP = 1e-2


class ClosedSystem(System):
    """A tree with closures. Mass matrix, bias and inverse dynamics are those of the tree alone.

    What closures add to them is `closure_operators`; operators and partitions, which have accelerations of their own,
    are refused.
    """

    def __init__(self, scene: s.Scene) -> None:
        super().__init__(scene)
        own = closure_constants(scene, self.constants, self.closure_ports, self.links)
        slowest = slowest_mode(self.links)
        tree = scene.constraints, self.constants, own, self.layout, self.workspace, slowest
        self._closures = self.own.closures = Closures(*tree, self.check_status)  # this thread's own
        self._start: State | None = None

    @per_thread
    def closures(self) -> Closures:
        """From Python, for what takes several steps."""
        return self._closures.for_thread()

    def __reduce__(self) -> tuple[Any, ...]:
        """As of a tree."""
        return copied, (ClosedSystem, self.kernels, self.scene)

    @property
    def initial_state(self) -> State:
        """The state closest to the scene's at t = 0 that closes all closures; ClosureError where there is none.

        Closest in the metric of kinetic energy, bodies bending only where hinges cannot close a loop; coordinates
        first, then speeds. Prescribed ones are their functions'. What the scene gives is kept to the last digit where
        the rest can follow (see `flexmb.scene.hinges.AngularCoordinate`); else it warns (`SceneWarning`) from what to
        what, and ClosureError where it is marked as given.
        """
        if self._start is None:
            y = pack(super().initial_state)
            y = self._as_asked(0.0, y, asked(self, y))
            self._start = State(y[: self.nq], y[self.nq : -1], 0.0, self.layout)
        return State(self._start.q, self._start.u, 0.0, self.layout)

    @property
    def rank(self) -> int:
        """Independent motions that the closures suppress, at the initial state."""
        self.initial_state  # noqa: B018 - counts them
        return self.closures.rank

    def _as_asked(self, t: float, y: Real, wish: AskedFor) -> Real:
        """y = [q, u, work] with closed closures; warns of what it does not keep."""
        found = consistent(self.closures, t, y, wish)
        broken = wish.broken(y, found)
        if broken:
            warnings.warn(
                f'scene "{self.scene.name}": closures do not allow these values together, and the nearest that they '
                f"allow are taken: {broken}. Correct them, leave out what follows from the others (zero), or mark by "
                "given = true what is to be kept",
                SceneWarning,
                stacklevel=4,
            )
        return found

    def admissible(self, state: State, given: Given = "guess") -> State:
        """The nearest state that closes all closures, with the prescribed values of a tree.

        ClosureError where the given one leaves them open by more than `LARGEST_INITIAL_GAP`.
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
        """Evaluators are of trees."""
        raise NotImplementedError(
            f'scene "{self.scene.name}" has closures or couplings, and an evaluator is for trees: '
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

        `axes` and `about` as of a tree; frames "inboard" and "outboard" of a closure are A and B.
        """
        if accelerations is not None:
            raise NotImplementedError(
                f'scene "{self.scene.name}": the loads of forced accelerations are those of a tree; '
                "leave accelerations out, or prescribe coordinates"
            )
        t, y = self.layout.entering(state)
        return self._referred(self._motion(t, y, "articulated"), state, axes, about)

    def referred_loads(
        self, state: State, loads: dict[str, Real], axes: Axes = "world", about: tuple[str, str] | None = None
    ) -> dict[str, Real]:
        """Where some are not determined, what is in other axes is found anew, but not where controllers act."""
        t, y = self.layout.entering(state)
        if self.scene.controllers or all(np.all(np.isfinite(load)) for load in loads.values()):
            return super().referred_loads(state, loads, axes, about)
        return self._referred(self._motion_or_across(t, y, "articulated"), state, axes, about)

    def _referred(
        self, motion: ClosedMotion, state: State, axes: Axes, about: tuple[str, str] | None
    ) -> dict[str, Real]:
        """Loads of a motion in other axes about a node, NaN what it does not determine."""
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
        """What hinges (N,6) and closures (C,6) have, by their names."""
        names = [closure.name for closure in self.scene.constraints]
        return self._by_hinge(hinges) | dict(zip(names, closures, strict=True))

    def _changes(self, spread: Spread) -> list[dict[str, Real]]:
        """By null load, how loads change by name (6,), World axes."""
        return [self._by_load(*each) for each in zip(spread.hinges, spread.closures, strict=True)]

    def all_loads(self, state: State) -> AllLoads:
        """With the loads that may be others; those of `exerted` are the least."""
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
        """As of a tree; in a run, at a singular position too."""
        row[:] = self._row(t, y, self._motion_or_across(t, y, algorithm))

    def _row(self, t: float, y: Real, motion: ClosedMotion) -> Real:
        """With the loads of closures too; NaN what the motion does not determine."""
        self.observe_motion(t, y, motion.accelerations, motion.drives, motion.hinges)
        row = self.observation.row(t, motion.closures)
        if motion.spread is not None:
            parts, spread = self.observation.columns_of(row[None]), motion.spread
            for name, changes in (("loads", spread.hinges), ("closures", spread.closures), ("drives", spread.drives)):
                parts[name][0][spread.leaves_open(changes)] = np.nan
        return row

    def _motion_or_across(self, t: float, y: Real, algorithm: Algorithm) -> ClosedMotion:
        """The motion; in a run through a singular position, where nothing determines it, the mean of those beside."""
        try:
            return self._motion(t, y, algorithm)
        except DynamicsError:
            if not self.closures.is_singular:
                raise
        slope = np.empty_like(y)
        articulated.rhs(t, y, slope, self.constants, self.workspace())
        sides = [self.closures.beside(t, y, slope[: self.nq], side) for side in (-1, 1)]
        before, after = (self._motion(*each, algorithm) for each in sides)
        return ClosedMotion(
            0.5 * (before.accelerations + after.accelerations),
            0.5 * (before.drives + after.drives),
            0.5 * (before.hinges + after.hinges),
            0.5 * (before.closures + after.closures),
            _of_both(before.spread, after.spread),
        )

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

    def nested(self, algorithm: Algorithm = "frisch") -> NestedSystem:
        """Refused: NotImplementedError."""
        raise self._of_trees("Frisch's partitioned equations")

    def operators(self, state: State) -> Operators:
        """Refused: NotImplementedError."""
        raise self._of_trees("the spatial operators")

    def _of_trees(self, what: str) -> NotImplementedError:
        return NotImplementedError(
            f'scene "{self.scene.name}" has closures or couplings, and {what} are of trees: closure_operators(state) '
            "has what closures add, and flexmb.System(scene) is the tree alone, whose accelerations are not the scene's"
        )

    def closure_gaps(self, state: State) -> dict[str, tuple[float, float]]:
        """By closure, how far it is open along what it suppresses: distance (m) and angle (rad, its sine)."""
        return self.closures.gaps(*self.layout.entering(state))

    def route(self, algorithm: Algorithm = "articulated", stabilise: float = 0.0) -> Route:
        """The algorithm as runs see it; `stabilise`: see `flexmb.simulate`.

        NotImplementedError for an algorithm that knows trees only, ClosureError where there is no motion to run.
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
        tangent = chain_tangent(chain.c, chain.cc, self.nq, self.nu)
        return Linear(closed_jacobian.jacobian, closed_jacobian.move, chain, tangent, settles=True)

    def _on_chains(self, algorithm: Algorithm) -> Callable[[Closures, float, Real], ClosedMotion]:
        """How the algorithm finds the motion of closed chains; NotImplementedError where it does not."""
        motion = algorithms.chosen(algorithm).closed_motion
        if motion is None:
            known = " or ".join(f'"{name}"' for name in algorithms.ON_CHAINS)
            raise NotImplementedError(
                f'scene "{self.scene.name}" has closures or couplings, which algorithm {algorithm!r} does not know: '
                f"use algorithm={known}"
            )
        return motion

    def _refuse_locked(self) -> None:
        if self.closures.rank < 0:
            self.initial_state  # noqa: B018 - counts the independent rows
        locked = self.closures.mobility == 0 < self.closures.rank  # a tree of welds is not locked by its closures
        if locked and not np.any(self.constants.speed["prescribed"] >= 0):
            names = ", ".join(map(called, self.scene.constraints))
            raise ClosureError(
                f"{names} leave none of the {self.nu} free speeds: the mechanism is locked. Free a "
                "hinge, or let bodies deform"
            )


def _remembered(chain: Closed) -> list[Record | Real | Index]:
    """Where closures note the branch that a motion is on."""
    return [array for field in fields(chain.cw) if isinstance(array := getattr(chain.cw, field.name), np.ndarray)]


def _of_both(one: Spread | None, other: Spread | None) -> Spread | None:
    """What either leaves open."""
    if one is None or other is None:
        return one or other
    return Spread(
        np.concatenate([one.drives, other.drives]),
        np.concatenate([one.hinges, other.hinges]),
        np.concatenate([one.closures, other.closures]),
        max(one.rounding, other.rounding),
    )
