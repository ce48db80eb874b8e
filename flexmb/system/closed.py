"""A compiled scene with closures: the system of its tree, with the accelerations and loads of the closed chain."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexmb.closure import dynamics as closed_dynamics
from flexmb.closure import jacobian as closed_jacobian
from flexmb.closure.assembly import consistent
from flexmb.closure.branch import noticed, watch_steps
from flexmb.closure.closures import ClosedMotion, ClosureError, Closures
from flexmb.closure.constants import closure_constants, slowest_mode
from flexmb.closure.jacobian import chain_tangent
from flexmb.closure.leap import back, beside, leap
from flexmb.closure.tables import Closed
from flexmb.entry import articulated
from flexmb.integrate.problem import Leaping, Linear
from flexmb.scene import schema as s
from flexmb.system import algorithms
from flexmb.system.algorithm import Algorithm, Route
from flexmb.system.evaluator import Evaluator
from flexmb.system.load_axes import Axes, referred
from flexmb.system.observables import Evaluation
from flexmb.system.tree_system import System
from flexmb.tables import arguments
from flexmb.tables.per_thread import per_thread
from flexmb.tables.state import DynamicsError, State, finite_result, pack
from flexmb.tables.status import Status
from flexmb.typing import Real

# In the size of a closure: a state that is given opens it by less. At a distance of d sizes from where branches cross
# they differ by d^2 in the gap: beyond a tenth of the size the nearest is the one that is meant. Three digits do.
FAR = 1e-2


class ClosedSystem(System):
    """A tree with closures. Mass matrix, bias and inverse dynamics are those of the tree alone."""

    def __init__(self, scene: s.Scene) -> None:
        super().__init__(scene)
        own = closure_constants(scene, self.constants, self._closure_ports)
        slowest = slowest_mode(self._links)
        tree = scene.closures, self.constants, own, self.layout, self.workspace, slowest
        self._closures = self._own.closures = Closures(*tree, self._check)  # this thread's own
        self._start: State | None = None

    @per_thread
    def closures(self) -> Closures:
        """From Python, for what takes several steps."""
        return self._closures.for_thread()

    def _anew(self) -> ClosedSystem:
        """The same scene turned into other arrays."""
        return ClosedSystem(self.scene)

    def __reduce__(self) -> tuple[Any, ...]:
        """As of a tree."""
        return ClosedSystem, (self.scene,)

    @property
    def initial_state(self) -> State:
        """The state closest to the scene's at t = 0 that closes all closures; ClosureError where there is none.

        Closest in the metric of kinetic energy, bodies bending only where hinges cannot close a loop; coordinates
        first, then speeds. Prescribed ones are their functions'.
        """
        if self._start is None:
            y = consistent(self.closures, 0.0, pack(super().initial_state))
            self._start = State(y[: self.nq], y[self.nq : -1], 0.0, self.layout)
        return State(self._start.q, self._start.u, 0.0, self.layout)

    @property
    def rank(self) -> int:
        """Independent motions that the closures suppress, at the initial state."""
        self.initial_state  # noqa: B018 - counts them
        return self.closures.rank

    def _begin_at(self, t: float, y: Real, before: ClosedSystem | None = None) -> None:
        """Go on at y = [q, u, work], which closes all closures, where the scene's own values may not.

        The independent rows are those of the scene before, of as many prescribed speeds, or are counted there.
        """
        if before is not None and np.array_equal(self._is_prescribed, before._is_prescribed):
            self.closures.count_as(before.closures)
        else:
            self.closures.linearise(t, y)
            self.closures.count_rows()

    @property
    def _is_prescribed(self) -> NDArray[np.bool_]:
        return self.constants.speed["prescribed"] >= 0

    def _admissible(self, t: float, y: Real) -> State:
        """The nearest state that closes all closures; ClosureError where y leaves them open by more than `FAR`."""
        rough = super()._admissible(t, y).y
        self.closures.linearise(t, rough)
        errors = self.closures.errors()
        if not np.max(np.abs(errors), initial=0.0) <= FAR:
            raise ClosureError(
                f"{self.closures.worst(errors)}: the state that is given leaves this open: give coordinates that close "
                "it at least roughly, or leave those out that the closures determine"
            )
        y = consistent(self.closures, t, rough)
        return self.layout.known(t, y)

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
            f'scene "{self.scene.name}" has closures, and an evaluator is for trees: use accelerations(state)'
        )

    def _motion(self, t: float, y: Real, algorithm: Algorithm) -> ClosedMotion:
        found = self._on_chains(algorithm)(self.closures, t, y)
        self._trust(t, y, self.closures)
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
        loads = self._evaluate(*self.layout.entering(state), "articulated").loads
        return referred(self, self._w, loads, axes, about)

    def _evaluate(self, t: float, y: Real, algorithm: Algorithm) -> Evaluation:
        """With the closures' loads too."""
        closures = self._observe(t, y, algorithm)
        found = self._observation.evaluation(t)
        loads = zip(self._observation.names.closures, finite_result(closures, t), strict=True)
        return replace(found, loads=found.loads | dict(loads))

    def _observe_row(self, t: float, y: Real, algorithm: Algorithm, row: Real) -> None:
        """As of a tree, with the loads of closures."""
        try:
            motion = self._motion(t, y, algorithm)
        except DynamicsError:
            if not self.closures.is_singular:
                raise
            motion = self._motion_across(t, y, algorithm)
        self._observation.fill(row, t, self._outputs(t, y, motion))

    def _motion_across(self, t: float, y: Real, algorithm: Algorithm) -> ClosedMotion:
        """In a run through a singular position, where nothing determines the loads: the mean of those beside it."""
        slope = np.empty_like(y)
        articulated.rhs(t, y, slope, self.constants, self.workspace())
        sides = [self.closures.beside(t, y, slope[: self.nq], side) for side in (-1, 1)]
        before, after = (self._motion(*each, algorithm) for each in sides)
        return ClosedMotion(*(0.5 * (one + other) for one, other in zip(before, after, strict=True)))

    def _observe(self, t: float, y: Real, algorithm: Algorithm) -> Real:
        """Fills the outputs; loads (C,6) of closures."""
        return self._outputs(t, y, self._motion(t, y, algorithm))

    def _outputs(self, t: float, y: Real, motion: ClosedMotion) -> Real:
        out = self._out
        out.rates[:], out.drives[:], out.loads[:] = motion.accelerations, motion.drives, motion.hinges
        self._observe_motion(t, y)
        return motion.closures

    def determined_loads(self, state: State) -> dict[str, NDArray[np.bool_]]:
        """Which components (6,) of the loads of hinges and closures are determined by the motion; World axes.

        The others, in overconstrained mechanisms of rigid bodies, are those of the least closure loads (`evaluate`).
        """
        hinges, closures = self.closures.determined(*self.layout.entering(state))
        names = [link.hinge.name for link in self._links], [closure.name for closure in self.scene.closures]
        return dict(zip(names[0], hinges, strict=True)) | dict(zip(names[1], closures, strict=True))

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
        return Route(tables, closed_dynamics.rhs, closed_dynamics.project, leaping, self._linear)

    def _linear(self, chain: Closed, _: Closed) -> Linear:
        tangent = chain_tangent(chain.c, chain.cc, self.nq, self.nu)
        return Linear(closed_jacobian.jacobian, closed_jacobian.move, chain, tangent, settles=True)

    def _on_chains(self, algorithm: Algorithm) -> Callable[[Closures, float, Real], ClosedMotion]:
        """How the algorithm finds the motion of closed chains; NotImplementedError where it does not."""
        motion = algorithms.chosen(algorithm).closed_motion
        if motion is None:
            known = " or ".join(f'"{name}"' for name in algorithms.ON_CHAINS)
            raise NotImplementedError(
                f'scene "{self.scene.name}" has closures, which algorithm {algorithm!r} does not know: '
                f"use algorithm={known}"
            )
        return motion

    def _refuse_locked(self) -> None:
        if self.closures.rank < 0:
            self.initial_state  # noqa: B018 - counts the independent rows
        locked = self.closures.mobility == 0 < self.closures.rank  # a tree of welds is not locked by its closures
        if locked and not np.any(self._is_prescribed):
            names = ", ".join(f'"{closure.name}"' for closure in self.scene.closures)
            raise ClosureError(
                f"closures {names} leave none of the {self.nu} free speeds: the mechanism is locked. Free a "
                "hinge, or let bodies deform"
            )

    def fault_name(self, status: int, fault: int) -> str:
        """Name of the closure or body that the number of a failure stands for."""
        if status in (Status.CLOSURE_SINGULAR, Status.CLOSURE_OPEN, Status.BRANCH_UNKNOWN):
            return self.scene.closures[fault].name
        return super().fault_name(status, fault)
