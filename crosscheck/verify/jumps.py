"""Samples at which the reference jumps (impacts, latches, steps of loads or controllers).

There a right result may have either side, and its event may come a little earlier or later than the reference's. Where
only a few samples of a channel are too far off, the reference is therefore taken on both sides of each, near enough
that smooth motion hardly changes: if it jumps and the sample lies on one of the sides, it is not compared.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from flexmb.run.channels import distance
from flexmb.typing import Real

FEW = 0.1  # of the samples may be too far off: more are no jump
STEEP = 4.0  # times the change on either side over the same interval: more is a jump


@dataclass(frozen=True)
class Suspect:
    """A channel with the values (T,k) of somebody, of which those at `places` are beyond `allowed` (SI).

    `near_s` is how far (s) events may be off in a result that is as accurate as the case asks for.
    """

    values: Real
    places: np.ndarray
    allowed: float
    near_s: float


def suspect(channel: str, values: Real, reference: Real, allowed: float, near_s: float) -> Suspect | None:
    """The samples that a jump may explain; None if none or too many are too far off."""
    places = np.flatnonzero(~(distance(channel, values, reference) <= allowed))
    return Suspect(values, places, allowed, near_s) if 0 < len(places) <= max(1, FEW * len(values)) else None


def at_jumps(
    suspects: Mapping[str, Suspect], times: Real, reference_at: Callable[[Real], Mapping[str, Real]], t_end: float
) -> dict[str, np.ndarray]:
    """For each suspected channel the indices of `times` (T,) s at which the reference jumps to or from its value."""
    asked = {name: _around(times[suspect.places], suspect.near_s) for name, suspect in suspects.items()}
    inside = np.unique(np.concatenate([rows.ravel() for rows in asked.values()]))
    inside = inside[(inside >= 0.0) & (inside <= t_end)]
    if not len(inside):
        return {}
    there = reference_at(inside)
    jumps = {}
    for name, suspect in suspects.items():
        if name in there:
            flags = [_jumps(name, suspect, i, row, inside, there[name]) for i, row in enumerate(asked[name])]
            jumps[name] = suspect.places[np.array(flags, bool)]
    return jumps


def _around(when: Real, near_s: float) -> Real:
    """Two times before and two behind each (n, 4)."""
    return when[:, None] + near_s * np.array([-2.0, -1.0, 1.0, 2.0])


def _jumps(channel: str, seen: Suspect, i: int, row: Real, times: Real, values: Real) -> bool:
    """Whether the reference jumps between the middle two of four times, and the sample lies on one of its sides."""
    if not (times[0] <= row[0] and row[-1] <= times[-1]):
        return False
    earlier, before, behind, later = (values[k : k + 1] for k in np.searchsorted(times, row))
    smooth = max(distance(channel, earlier, before)[0], distance(channel, behind, later)[0])
    mine = seen.values[seen.places[i]][None]
    near = min(distance(channel, mine, before)[0], distance(channel, mine, behind)[0])
    jump = distance(channel, before, behind)[0]
    return bool(jump > STEEP * smooth + seen.allowed and near <= 2.0 * smooth + seen.allowed)
