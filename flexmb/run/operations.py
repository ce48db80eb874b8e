"""Floating-point operations of runs, counted and not timed, so that they are the same on every machine.

The number of operations of one evaluation of the accelerations, closures included (`flexmb.jit.counting`), times the
number of evaluations, with the Jacobians and the linear algebra of methods that have them.
"""

from __future__ import annotations

import numpy as np

from flexmb.closure import dynamics as closed
from flexmb.integrate.catalogue import INTEGRATORS
from flexmb.jit.counting import count
from flexmb.run.run_arrays import Statistics
from flexmb.system.algorithm import Algorithm
from flexmb.system.algorithms import ALGORITHMS
from flexmb.system.system import System
from flexmb.tables.state import pack

COMPLEX = 4
"""Operations of an evaluation in complex numbers relative to one in real numbers."""

FACTORS, ANSWER = 4.0, 0.5
"""Operations of the factors of Newton's method by the recursion, and of their use for each evaluation, relative to an
evaluation: measured on a chain of 10 beams of 5 modes, complex numbers included."""


def of_evaluation(system: System, algorithm: Algorithm) -> int:
    """Operations of one evaluation of the accelerations at the initial state."""
    state = system.initial_state
    y = pack(state)
    if system.closures is not None:
        chain = system.closures.chain(algorithm)
        return count(closed.rhs, 0.0, y, np.zeros_like(y), chain, 0).operations.total
    chosen = ALGORITHMS[algorithm]
    return count(chosen.kernel(), 0.0, y, *chosen.fresh(system)).operations.total


def of_run(integrator: str, each: int, size: int, done: Statistics) -> float:
    """Operations of a run: `each` for an evaluation of the accelerations, `size` entries of the state.

    A Jacobian counts as one evaluation in complex numbers for each of its columns. Linear algebra is counted by its
    leading terms, with one substitution for each evaluation. A run of a method with Jacobians that formed none solved
    by the recursion (`flexmb.entry.stiff_part`).
    """
    if INTEGRATORS[integrator].linearises and done.jacobians == 0:
        return each * (done.evaluations * (1.0 + ANSWER) + done.factorisations * FACTORS)
    cubic, square = INTEGRATORS[integrator].algebra
    evaluations = done.evaluations + COMPLEX * size * done.jacobians
    return float(each * evaluations + cubic * size**3 * done.factorisations + square * size**2 * done.evaluations)
