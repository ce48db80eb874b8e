"""Places where a run pauses: where an entry of the state crosses a level, in the step or in its dense output.

A run pauses at the first of several levels that a step crosses. What crosses a level and comes back within a step is
not seen, as steps resolve the motion, unless the step starts at the level: what flies off and comes back at once is.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flexmb.jit.kernel import helper
from flexmb.typing import Index, Real

CROSSED = -1  # returned in place of a status code: no end of the run


class Watch(NamedTuple):
    """entry (k,) of y; level (k,); direction (k,): 1 rising, -1 falling, 0 either.

    side (k,): -1 where the entry is below its level, 1 above, kept from step to step; an entry at its level is on the
    side that it comes from. found (k,): 1 where a level is reached at the time at which a run paused.
    """

    entry: Index
    level: Real
    direction: Index
    side: Index
    found: Index


@helper
def crosses(side, after, direction):
    """Whether a value that was on a side of zero comes to it in this direction, or goes through it."""
    if side < 0:
        return after >= 0.0 and direction >= 0
    return side > 0 and after <= 0.0 and direction <= 0


@helper
def crosses_one(watch, i, y):
    """Whether y (n,) has come to level i."""
    return crosses(watch.side[i], y[watch.entry[i]] - watch.level[i], watch.direction[i])


@helper
def is_crossed(watch, y):
    """Whether a step to y (n,) crosses any level; where it does not, sides are those of y."""
    for i in range(watch.entry.shape[0]):
        if crosses_one(watch, i, y):
            return True
    for i in range(watch.entry.shape[0]):
        value = y[watch.entry[i]] - watch.level[i]
        if value != 0.0:
            watch.side[i] = -1 if value < 0.0 else 1
    return False


@helper
def note(watch, first, y):
    """What is crossed where a run pauses, at y (n,): the first level, and others that are reached at the same time."""
    for i in range(watch.entry.shape[0]):
        watch.found[i] = 1 if i == first or crosses_one(watch, i, y) else 0


def watch(entries: Sequence[int], levels: Sequence[float], directions: Sequence[int], sides: Sequence[int]) -> Watch:
    """Of lists of equal lengths."""
    whole = (np.array(each, np.int64) for each in (directions, sides, [0] * len(entries)))
    return Watch(np.array(entries, np.int64), np.array(levels, float), *whole)
