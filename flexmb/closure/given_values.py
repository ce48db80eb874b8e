"""Which values of an initial state must be kept, and which are only guesses.

A value is *given* if it differs from its default (zero, or no rotation) or is named in the call that starts the run. It
is *insisted* on if the scene marks its coordinate by `given = true` or if it is named in that call. All components of a
quaternion or vector have the same status.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexmb.typing import Index, Real

MOVED = 1e-6  # relative, absolute below 1: users write about six digits, and stabilised runs drift by less
MOST_NAMES = 5

Value = tuple[tuple[int, ...], tuple[int, ...]]
"""One value: its indices in [q, u, work], and the speeds that must be held so that it does not change."""


class KeptValues(NamedTuple):
    """Indices in [q, u, work] of the coordinates and speeds to keep, and the speeds that must not be changed."""

    coordinates: Index
    speeds: Index
    fixed: Index


class Wishes(NamedTuple):
    """The values of all coordinates, or of all speeds, by how firmly the user asked for them."""

    given: tuple[Value, ...] = ()
    insisted: tuple[Value, ...] = ()


class AskedFor(NamedTuple):
    """modes: all modal values; prescribed: indices of the prescribed speeds; names: of all entries of [q, u].

    is_marked: the insisted values are marked in the scene, and it is an error if they cannot be kept.
    """

    coordinates: Wishes
    speeds: Wishes
    coordinate_count: int
    modes: tuple[Value, ...]
    prescribed: frozenset[int]
    names: tuple[str, ...]
    is_marked: bool

    def hold(self, values: tuple[Value, ...], *, modes: bool) -> KeptValues:
        """What keeps these values, and all modal values too if `modes` is set."""
        values = (*values, *self.modes) if modes else values
        places = [place for value, _ in values for place in value]
        fixed = {speed for _, speeds in values for speed in speeds}
        return KeptValues(
            np.array([place for place in places if place < self.coordinate_count], np.int64),
            np.array([place for place in places if place >= self.coordinate_count], np.int64),
            np.array(sorted(fixed - self.prescribed), np.int64),
        )

    def name(self, value: Value) -> str:
        """The name of its first component."""
        return self.names[value[0][0]]

    def broken(self, before: Real, after: Real) -> str:
        """The given values that differ between two [q, u, work], as "<name> from ... to ..."; "" if none does; of
        many, those that moved most.

        If insisted coordinates were kept, the other coordinates count as guesses that select the assembly branch.
        """
        of_coordinates = self.coordinates.insisted or self.coordinates.given
        asked = [place for value, _ in (*of_coordinates, *self.speeds.given) for place in value]
        by = np.abs(after - before) / np.maximum(1.0, np.abs(before))
        moved = [i for i in asked if by[i] > MOVED]
        most = sorted(moved, key=lambda i: -by[i])[:MOST_NAMES]
        told = [f'"{self.names[i]}" from {before[i]:.6g} to {after[i]:.6g}' for i in moved if i in most]
        left = len(moved) - len(told)
        return ", ".join(told) + (f", and {left} more" if left else "")


_NONE = np.zeros(0, np.int64)
NO_HOLD = KeptValues(_NONE, _NONE, _NONE)
NOTHING_ASKED = AskedFor(Wishes(), Wishes(), 0, (), frozenset(), (), is_marked=False)
