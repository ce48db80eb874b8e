"""States of a scene, and the accelerations of its free motion by each algorithm."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from flexmb.kept import kept
from flexmb.motion import coordinates
from flexmb.system import algorithms
from flexmb.system.algorithm import Algorithm, DynamicsAlgorithm
from flexmb.system.evaluator import Evaluator, fresh_evaluator
from flexmb.system.mechanics import Mechanics, Precision
from flexmb.tables import arguments
from flexmb.tables.per_thread import per_thread
from flexmb.tables.state import State
from flexmb.typing import Real

Given = Literal["guess", "scene", "state"] | NDArray[np.bool_]
"""Which values of a state must be kept: none, those that the scene gives, all, or those that are named (nq+nu+1,)."""


class FreeMotion(Mechanics):
    """States and accelerations of a scene."""

    def state(self, q: Real, u: Real, t: float = 0.0) -> State:
        """State from q (nq,), u (nu,) and t (s), which are copied; quaternions are scaled to unit length.

        Raises ValueError where lengths do not fit, numbers are not finite or a quaternion is zero, and TypeError for
        anything but real numbers.
        """
        return self.layout.state(q, u, t)

    @property
    def initial_state(self) -> State:
        """The scene's state at t = 0; prescribed coordinates have their functions' values."""
        return self.layout.known(0.0, self._at_start.copy())

    def admissible(self, state: State, given: Given = "guess") -> State:
        """The state with prescribed motions at their values for its time, and for closed chains with closed closures.

        The latter is the nearest such state; ClosureError if it is far away. Values that are `given` are kept if
        possible; otherwise a warning names them.
        """
        t, y = self.layout.entering(state)
        return self.layout.known(t, self._projected(t, y))

    def scene_state(self, t: float) -> State:
        """The scene's initial values with prescribed motions at their values for time t (s); closures may be open."""
        t = arguments.number("t", t)
        return self.layout.known(t, self._projected(t, self._at_start))

    def _projected(self, t: float, y: Real) -> Real:
        """A copy of y with work zero, prescribed motions at their values for time t, and quaternions of unit length."""
        y = np.r_[y[:-1], 0.0]
        coordinates.project(t, y, self.constants)
        return y

    @kept
    def _at_start(self) -> Real:
        """(nq+nu+1,) [q, u, 0] of the scene at t = 0."""
        q, u = np.zeros(self.nq), np.zeros(self.nu)
        for link in self.links:
            name = link.hinge.name
            q[self.coordinate(name)], u[self.speed(name)] = link.kind.state(link.hinge)
        for wheel in self.scene.wheels:
            q[self.coordinate(wheel.name)], u[self.speed(wheel.name)] = wheel.angle_rad, wheel.speed_rad_s
        for modal in self.scene.modal_states:
            name = f"{modal.body}.modes"
            if self.coordinate(name).stop > self.coordinate(name).start:
                q[self.coordinate(name)] = modal.coordinates
                u[self.speed(name)] = modal.rates or 0.0
        return self._projected(0.0, np.concatenate([q, u, [0.0]]))

    def accelerations(self, state: State, algorithm: Algorithm = "articulated") -> Real:
        """udot (nu,) of the free motion under all loads; prescribed speeds have their functions' rates.

        "articulated": the O(N) recursion; "unsplit": the same with modes and hinge of a body eliminated together;
        "composite": mass matrix by composite bodies, bias by inverse dynamics, Cholesky's factors, partitioned for
        prescribed speeds; "frisch": the nested-body equations of 1975, corrected, "frisch_as_printed": to the letter.
        Frisch's equations are of first order in the deformation: they take bodies of level `full` as `linear`.
        Raises DynamicsError where an inertia is not positive definite, or numbers are so large that they overflow.
        """
        if type(state) is not State or state.layout is not self.layout:
            state = self.layout.owning(state)
        try:
            evaluator = self.own._evaluators[algorithm]  # without the property, which costs as much as the evaluation
        except (AttributeError, KeyError):
            evaluator = self._evaluator(algorithms.chosen(algorithm))
        return evaluator(state.t, state.kernel_q, state.kernel_u).copy()

    def evaluator(self, algorithm: Algorithm = "articulated") -> Evaluator:
        """`accelerations` for a loop: `udot = evaluator(t, q, u)` writes into one array, with a workspace of its own.

        A call costs 0.1 us in addition to the kernel in the thread that makes the first call, and 0.5 us more in other
        threads, each of which has an array and a workspace of its own. The kernel is compiled here, not at the first
        call. NotImplementedError for closed chains.
        """
        return fresh_evaluator(self, algorithm)

    def _evaluator(self, chosen: DynamicsAlgorithm) -> Evaluator:
        """The evaluator that uses the workspace of this thread in the system."""
        if chosen.name not in self._evaluators:
            self._evaluators[chosen.name] = Evaluator(self, chosen, chosen.own(self))
        return self._evaluators[chosen.name]

    @per_thread
    def _evaluators(self) -> dict[str, Evaluator]:
        """By name of the algorithm."""
        return {}

    @per_thread
    def start_precision(self) -> Precision | None:
        """`precision_if_doubtful` of the initial state, found once."""
        return self.precision_if_doubtful(self.initial_state)
