"""What a user asks of an initial state: which values are to be kept, and which are guesses.

A value is *given* if it is not what it is by default (zero, and no rotation), or if it is named where a run begins; it
is *insisted* on if the scene marks its coordinate by `given = true`, or again if it is named. Values that belong
together, as those of a quaternion or a vector, are given together.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexmb.typing import Index, Real

MOVED = 1e-6  # of a value, or absolute below 1: people write six digits, and stabilised runs drift by less
MOST_NAMES = 5

Value = tuple[tuple[int, ...], tuple[int, ...]]
"""Of one value: its places in [q, u, work], and the speeds that must not change for it to stay."""


class KeptValues(NamedTuple):
    """Places in [q, u, work] of coordinates and of speeds that stay as they are, and speeds that nothing may move."""

    coordinates: Index
    speeds: Index
    fixed: Index


class Wishes(NamedTuple):
    """Of all coordinates, or of all speeds."""

    given: tuple[Value, ...] = ()
    insisted: tuple[Value, ...] = ()


class AskedFor(NamedTuple):
    """modes: all of them, as values; prescribed: numbers of speeds that move by themselves. names: of all places in
    [q, u].

    is_marked: what is insisted on is so in the scene, and not to keep it is an error.
    """

    coordinates: Wishes
    speeds: Wishes
    coordinate_count: int
    modes: tuple[Value, ...]
    prescribed: frozenset[int]
    names: tuple[str, ...]
    is_marked: bool

    def hold(self, values: tuple[Value, ...], *, modes: bool) -> KeptValues:
        """Of these values, with all modes too if these are not to move."""
        values = (*values, *self.modes) if modes else values
        places = [place for value, _ in values for place in value]
        fixed = {speed for _, speeds in values for speed in speeds}
        return KeptValues(
            np.array([place for place in places if place < self.coordinate_count], np.int64),
            np.array([place for place in places if place >= self.coordinate_count], np.int64),
            np.array(sorted(fixed - self.prescribed), np.int64),
        )

    def name(self, value: Value) -> str:
        """The name of its first place."""
        return self.names[value[0][0]]

    def broken(self, before: Real, after: Real) -> str:
        """What of it was not kept between two [q, u, work], "<name> from ... to ..."; "" if nothing.

        Beside coordinates that are insisted on, and were kept, others are guesses that say which branch is meant.
        """
        of_coordinates = self.coordinates.insisted or self.coordinates.given
        asked = [place for value, _ in (*of_coordinates, *self.speeds.given) for place in value]
        moved = [i for i in asked if abs(after[i] - before[i]) > MOVED * max(1.0, abs(before[i]))]
        told = [f'"{self.names[i]}" from {before[i]:.6g} to {after[i]:.6g}' for i in moved[:MOST_NAMES]]
        left = len(moved) - len(told)
        return ", ".join(told) + (f", and {left} more" if left else "")


_NONE = np.zeros(0, np.int64)
NO_HOLD = KeptValues(_NONE, _NONE, _NONE)
NOTHING_ASKED = AskedFor(Wishes(), Wishes(), 0, (), frozenset(), (), is_marked=False)
