"""The memory from which a run is resumed: a state, and the data of earlier steps that the next step needs.

The end of a run cuts its last step short. So methods that adapt their steps save their memory before that step, at a
time before the end. Resumed from there, a run is bit-identical to one that was not interrupted; its first step ends
after the end of the first run, and dense output gives the states in between.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexmb.integrate.control import ACCEPTED, SAMPLES, copy
from flexmb.jit.kernel import helper
from flexmb.typing import Real

# Entries of `numbers`: whether a run is resumed; the time of y; the size of the next step, the error norm of the last
# one, and whether it was rejected; for methods of equal steps, the start of the interval that is divided evenly and the
# number of steps done in it; for methods with Jacobians, the step sizes of the factors and of the last step, 0 for
# none, whether the Jacobian is to be renewed, and whether it was evaluated at the present state.
(
    TAKEN_UP, TIME, STEP, ERROR_BEFORE, RETRIED, STRETCH, DONE, FACTORED, STEP_BEFORE, RENEW, FRESH,
) = range(11)  # fmt: skip
NUMBERS = 11  # their number: length of `numbers`


class Memory(NamedTuple):
    """numbers (NUMBERS,) as named above; y (n,) = [q, u, work]; rows (k,n) of the method, its Jacobian first."""

    numbers: Real
    y: Real
    rows: Real


def memory(n: int, rows: int) -> Memory:
    """The memory of a new run."""
    return Memory(np.zeros(NUMBERS), np.zeros(n), np.zeros((rows, n)))


@helper
def begin(problem, times, y, scratch, memory, out, counts):
    """The time at which a run begins or resumes. Projects y to its manifold; stores the first sample if it is due.

    The state of a resumed run is on its manifold and must keep its last bits, so only a copy in `scratch` (n,) is
    projected, by which closures determine their branch.
    """
    numbers = memory.numbers
    if numbers[TAKEN_UP] == 0.0:
        numbers[TIME] = numbers[STRETCH] = times[0]
        problem.project(times[0], y, problem.constants)
    else:
        copy(y, scratch)
        problem.project(numbers[TIME], scratch, problem.constants)
    if numbers[TIME] == times[0]:
        copy(y, out[0])
        counts[SAMPLES] = 1
    return numbers[TIME]


@helper
def keep(memory, t, y, known, counts):
    """Save the memory of a method that adapts its steps before a step; known (NUMBERS,): its numbers. The size of a
    run's first step depends on the run's length, so it is not saved but determined again."""
    numbers = memory.numbers
    copy(known, numbers)
    numbers[TIME] = t
    if counts[ACCEPTED] == 0 and numbers[TAKEN_UP] == 0.0:
        numbers[STEP] = 0.0
    copy(y, memory.y)


@helper
def keep_place(memory, t, y, stretch, done, known):
    """Save the memory of a method of equal steps before a step; known (NUMBERS,): its numbers."""
    numbers = memory.numbers
    copy(known, numbers)
    numbers[TIME], numbers[STRETCH], numbers[DONE] = t, stretch, done
    copy(y, memory.y)
