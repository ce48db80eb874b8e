"""Times in another unit, and times that are shifted by any interval, as causes that concern a whole file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_interp_spline

from crosscheck.verify.evidence import Evidence
from flexmb.run.channels import distance
from flexmb.typing import Real

UNITS = {"milliseconds": 1e-3, "microseconds": 1e-6, "minutes": 60.0, "hours": 3600.0}  # in s
ROUNDS = 4  # Newton's iterations for a shift
LIKE_A_SHIFT = 0.5  # of the difference, in the root mean square, may remain after the best shift to first order
MOST = 0.1  # of the reference's duration: the largest shift
FEWEST = 8  # samples that must remain where both have values


@dataclass(frozen=True)
class Shift:
    """The values belong to times that are `late_s` (s) earlier: all of `channels` agree with the reference there."""

    late_s: float
    channels: tuple[str, ...]
    step_s: float

    @property
    def cause(self) -> str:
        """In words, with the part of a sample."""
        way = "late" if self.late_s > 0.0 else "early"
        part = abs(self.late_s) / self.step_s
        return f"the values are {abs(self.late_s):.6g} s too {way}, {part:.3g} of a sample: times shifted?"


def find_shift(
    differing: Mapping[str, Evidence], reference_at: Callable[[Real], Mapping[str, Real]], t_end: float
) -> Shift | None:
    """The shift of all times with which at least one moving channel agrees; None if there is none.

    It starts from the channel whose difference is most like a shift, and takes the reference at shifted times as it is
    computed there. `reference_at` gives the channels (T,k) at times (s) between 0 and `t_end`.
    """
    guesses = {channel: guess for channel, seen in differing.items() if (guess := _guess(seen)) is not None}
    if not guesses:
        return None
    leading = min(guesses, key=lambda channel: guesses[channel][1])
    late, seen = guesses[leading][0], differing[leading]
    for _ in range(ROUNDS):
        inside = (seen.times - late >= 0.0) & (seen.times - late <= t_end)
        if abs(late) > MOST * t_end or np.sum(inside) < FEWEST:
            return None
        there = reference_at(seen.times[inside] - late)
        agreeing = tuple(name for name, each in differing.items() if _agrees(each, there, inside))
        if agreeing:
            return Shift(late, agreeing, float(np.median(np.diff(seen.times))))
        if leading not in there:
            return None
        late += _further(seen, there[leading], inside)
    return None


def _guess(seen: Evidence) -> tuple[float, float] | None:
    """The shift (s) to first order, and which part of the difference it leaves; None if it is not like a shift."""
    if len(seen.times) < FEWEST or not seen.is_visible or not seen.varies:
        return None
    rate, apart = _rates(seen), _apart(seen.channel, seen.values, seen.reference)
    late = -float(np.sum(rate * apart) / np.sum(rate * rate))
    left = float(np.linalg.norm(apart + late * rate) / np.linalg.norm(apart))
    return (late, left) if left <= LIKE_A_SHIFT else None


def _further(seen: Evidence, there: Real, inside: np.ndarray) -> float:
    """The further shift (s) that remains where the reference is `there`."""
    rate = _rates(seen)[inside]
    return -float(np.sum(rate * _apart(seen.channel, seen.values[inside], there)) / np.sum(rate * rate))


def _rates(seen: Evidence) -> Real:
    """The rate of change of the reference: good enough for Newton's iterations, whatever the samples."""
    rows = seen.reference
    if seen.channel.endswith(".orientation"):
        jumps = np.sum(rows[1:] * rows[:-1], axis=1) < 0.0
        rows = rows * np.cumprod(np.concatenate([[1.0], np.where(jumps, -1.0, 1.0)]))[:, None]
    return np.asarray(make_interp_spline(seen.times, rows, k=5).derivative()(seen.times), float)


def _apart(channel: str, values: Real, reference: Real) -> Real:
    """The difference; of quaternions with the signs in which the reference is continuous."""
    if channel.endswith(".orientation"):
        jumps = np.sum(reference[1:] * reference[:-1], axis=1) < 0.0
        reference = reference * np.cumprod(np.concatenate([[1.0], np.where(jumps, -1.0, 1.0)]))[:, None]
        values = values * np.where(np.sum(values * reference, axis=1) < 0.0, -1.0, 1.0)[:, None]
    return values - reference


def _agrees(seen: Evidence, there: Mapping[str, Real], inside: np.ndarray) -> bool:
    """Whether a channel that moves agrees with the shifted reference."""
    if seen.channel not in there or not (seen.is_visible and seen.varies):
        return False
    return bool(np.all(distance(seen.channel, seen.values[inside], there[seen.channel]) <= seen.allowed))
