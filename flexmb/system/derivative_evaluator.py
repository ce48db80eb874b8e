"""Repeated evaluation of accelerations with their derivatives."""

from __future__ import annotations

from typing import Any, NamedTuple

from flexmb.entry.derivative_call import derivative_call, differentiate
from flexmb.system.evaluator import Evaluator, Refusal
from flexmb.system.mechanics import Mechanics
from flexmb.typing import Real


class DerivativeEvaluator(Evaluator):
    """`evaluator(t, q, u)`: udot (nu,), and its derivatives (nu,nu) in arrays that every call writes anew.

    `System.derivative_evaluator` makes one. `by_displacement`, `by_speed` and `by_force`, as of
    `AccelerationDerivatives`, are read-only views of the arrays of the thread that asks for them: get them once, before
    the loop. What may be given, what is raised, and how threads share it, is as of an `Evaluator`; in addition
    `NotDifferentiableError` where a law has a corner, for which scenes with such laws are looked at in Python before
    each call. States of closed chains must fulfil the closures; where these are singular, calls raise a DynamicsError.
    """

    @property
    def by_displacement(self) -> Real:
        """(nu,nu) by displacements along the speeds."""
        return _shown(self.tables[1].by_displacement)

    @property
    def by_speed(self) -> Real:
        """(nu,nu) by speeds."""
        return _shown(self.tables[1].by_speed)

    @property
    def by_force(self) -> Real:
        """(nu,nu) by generalised forces along the speeds."""
        return _shown(self.tables[1].by_force)

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy is a new evaluator of the copied system."""
        return _another, (self._careful.system,)


def _another(system: Any) -> Any:
    return system.derivative_evaluator()


def fresh_derivative_evaluator(
    system: Mechanics, refuse: Refusal | None, route: DerivativeRoute | None = None
) -> DerivativeEvaluator:
    """An evaluator with tables of its own, by default of a tree; refuse: is called before each evaluation."""
    chosen = route or OF_TREES
    return DerivativeEvaluator(system, chosen, chosen.fresh(system), refuse)


class DerivativeRoute(NamedTuple):
    """In place of an algorithm."""

    name: str
    kernel: Any
    fresh: Any


def _fresh(system: Mechanics) -> tuple[Any, ...]:
    return system.constants, derivative_call(system.derivative_constants, system.nq, system.nu)


OF_TREES = DerivativeRoute("derivatives", lambda: differentiate, _fresh)


def _shown(array: Real) -> Real:
    view = array.view()
    view.flags.writeable = False
    return view
