"""Native evaluations as calls to be timed, all at the initial state of the scene."""

from __future__ import annotations

from collections.abc import Callable

import flexmb as fm
from tests.benchmarks.must_hold.row import Call
from tests.benchmarks.routes import IN_A_RUN, Evaluation, articulated


def from_python(system: fm.System) -> Call:
    """The accelerations as a user calls them again and again: one call, one evaluation."""
    q, u, evaluate = system.initial_state.q, system.initial_state.u, system.evaluator()
    return Call(lambda: evaluate(0.0, q, u), 1, lambda: evaluate(0.0, q, u))


def kernel(system: fm.System, route: Callable[[fm.System], Evaluation] = articulated) -> Call:
    """The kernel of the accelerations called from compiled code, as an integrator does."""
    evaluation = route(system)
    written = evaluation.arguments[3]
    return Call(evaluation.in_a_run, IN_A_RUN, lambda: written.speed["acceleration"])
