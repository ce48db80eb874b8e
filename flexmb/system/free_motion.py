"""The free motion of a scene from its states: states that there can be, and their accelerations by each algorithm."""

from __future__ import annotations

from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

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
"""What of a state is asked for: nothing, what a scene gives, all of it, or the values (nq+nu+1,) that are named."""


class FreeMotion(Mechanics):
    """States and accelerations of a scene."""

    def state(self, q: Real, u: Real, t: float = 0.0) -> State:
        """State from q (nq,), u (nu,) and t (s), copies; quaternions need not have unit length, they are scaled.

        Raises ValueError where lengths do not fit, numbers are not finite or a quaternion is zero, and TypeError for
        anything but real numbers.
        """
        return self.layout.state(q, u, t)

    @property
    def initial_state(self) -> State:
        """The scene's state at t = 0; prescribed coordinates have their functions' values."""
        return self.layout.known(0.0, self._at_start.copy())

    def admissible(self, state: State, given: Given = "guess") -> State:
        """The state that this one stands for at its time; prescribed motions are as they are then.

        Of closed chains the nearest one that closes all closures; ClosureError where that is far. It keeps what is
        given where it can, and warns where not.
        """
        t, y = self.layout.entering(state)
        return self.layout.known(t, self._projected(t, y))

    def scene_state(self, t: float) -> State:
        """The scene's initial values with prescribed motions as they are at time t (s); closures may be open."""
        t = arguments.number("t", t)
        return self.layout.known(t, self._projected(t, self._at_start))

    def _projected(self, t: float, y: Real) -> Real:
        """A copy of y = [q, u, work] without work, prescribed motions as they are at t, quaternions of unit length."""
        y = np.r_[y[:-1], 0.0]
        coordinates.project(t, y, self.constants)
        return y

    @cached_property
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
            evaluator = self.own._evaluators[algorithm]  # not by way of the property, which costs as much as the call
        except (AttributeError, KeyError):
            evaluator = self._evaluator(algorithms.chosen(algorithm))
        return evaluator(state.t, state.kernel_q, state.kernel_u).copy()

    def evaluator(self, algorithm: Algorithm = "articulated") -> Evaluator:
        """`accelerations` for a loop: `udot = evaluator(t, q, u)` writes into one array, by a workspace of its own.

        A call costs a tenth of a microsecond besides the kernel, of the thread that calls it first; others may call it
        too, each with an array and a workspace of its own, and wait half a microsecond longer. Compiled here, not at
        its first call. NotImplementedError for closed chains.
        """
        return fresh_evaluator(self, algorithm)

    def _evaluator(self, chosen: DynamicsAlgorithm) -> Evaluator:
        """With the workspace that this thread has here."""
        if chosen.name not in self._evaluators:
            self._evaluators[chosen.name] = Evaluator(self, chosen, chosen.own(self))
        return self._evaluators[chosen.name]

    @per_thread
    def _evaluators(self) -> dict[str, Evaluator]:
        """By algorithm."""
        return {}

    @per_thread  # not `cached_property`: before Python 3.12 it holds a lock meanwhile, and this may have to compile
    def start_precision(self) -> Precision | None:
        """`precision_if_doubtful` of the initial state, found once."""
        return self.precision_if_doubtful(self.initial_state)
