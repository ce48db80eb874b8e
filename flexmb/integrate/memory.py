"""Where a run can be taken up again: the state there, and what the next step needs to know of the steps before it.

A run is cut where it ends: its last step is shorter than the one that a longer run would make. So methods that adapt
their steps keep what they knew before that step was cut, at a time before the end. Taken up from there they go on as if
the run had never ended, to the last bit, and find by dense output what lies between the end and their first step's end.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexmb.integrate.control import ACCEPTED, SAMPLES, copy
from flexmb.jit.kernel import helper
from flexmb.typing import Real

# Entries of `numbers`: whether a run is taken up; the time of y; the next step and the error norm of the last one, and
# whether it was rejected; of methods of equal steps, the start of the stretch and how many of its steps are done; of
# methods with Jacobians, the step of the factors and the step before, 0 for none, whether the Jacobian is to be
# renewed, and whether it is of this place.
(
    TAKEN_UP, TIME, STEP, ERROR_BEFORE, RETRIED, STRETCH, DONE, FACTORED, STEP_BEFORE, RENEW, FRESH,
) = range(11)  # fmt: skip
NUMBERS = 11  # their number: length of `numbers`


class Memory(NamedTuple):
    """numbers (NUMBERS,) as named above; y (n,) = [q, u, work]; rows (k,n) that a method keeps, its Jacobian first."""

    numbers: Real
    y: Real
    rows: Real


def memory(n: int, rows: int) -> Memory:
    """Of a run that begins afresh."""
    return Memory(np.zeros(NUMBERS), np.zeros(n), np.zeros((rows, n)))


@helper
def begin(problem, times, y, scratch, memory, out, counts):
    """The time at which a run begins or is taken up. Puts y on its manifold; the first sample is stored if it is there.

    A state that is taken up lies on its manifold and keeps its last bits: only a copy in `scratch` (n,) is projected,
    by which closures learn on which branch they are.
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
    """Before a step of a method that adapts them, `known` (NUMBERS,) being its numbers. The first step of all depends
    on the length of the run: it is left to be found again."""
    numbers = memory.numbers
    copy(known, numbers)
    numbers[TIME] = t
    if counts[ACCEPTED] == 0 and numbers[TAKEN_UP] == 0.0:
        numbers[STEP] = 0.0
    copy(y, memory.y)


@helper
def keep_place(memory, t, y, stretch, done, known):
    """Before a step of a method that takes equal ones, `known` (NUMBERS,) being its numbers."""
    numbers = memory.numbers
    copy(known, numbers)
    numbers[TIME], numbers[STRETCH], numbers[DONE] = t, stretch, done
    copy(y, memory.y)
