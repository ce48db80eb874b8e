"""Places where a run pauses: where an entry of the state crosses a level, in the step or in its dense output.

What is said here of one level holds for each of several; a step pauses at the first that it crosses. A coordinate that
crosses a level twice within a step is not seen: steps resolve the motion.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexmb.jit.kernel import helper
from flexmb.typing import Index, Real

CROSSED = -1  # returned in place of a status code: no end of the run


class Watch(NamedTuple):
    """entry (k,) of y; level (k,); direction (k,): 1 rising, -1 falling, 0 either; found (1,): which was crossed."""

    entry: Index
    level: Real
    direction: Index
    found: Index


@helper
def crosses(before, after, direction):
    """Whether a value goes through zero or comes to it. One that starts at zero has been there before."""
    if before < 0.0:
        return after >= 0.0 and direction >= 0
    return before > 0.0 and after <= 0.0 and direction <= 0


@helper
def crosses_one(watch, i, y, y_new):
    """Whether the step from y to y_new (n,) crosses level i."""
    entry, level = watch.entry[i], watch.level[i]
    return crosses(y[entry] - level, y_new[entry] - level, watch.direction[i])


@helper
def is_crossed(watch, y, y_new):
    """Whether the step from y to y_new (n,) crosses any level."""
    for i in range(watch.entry.shape[0]):  # noqa: SIM110 (a generator inside any() costs an allocation in compiled code)
        if crosses_one(watch, i, y, y_new):
            return True
    return False


def watch(entries: list[int], levels: list[float], directions: list[int]) -> Watch:
    """Of lists of equal lengths."""
    return Watch(
        np.array(entries, np.int64), np.array(levels, float), np.array(directions, np.int64), np.zeros(1, np.int64)
    )
