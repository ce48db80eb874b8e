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
ROUNDS = 8  # secants for a shift
FOUND = 1e-15  # of the duration: a smaller further shift is rounding
CONVERGING = 0.5  # of the remaining shift, at most, may be left after a secant
LIKE_A_SHIFT = 0.5  # of the difference, in the root mean square, may remain after the best shift to first order
DEGREES, ROUGH = (5, 3), 0.1  # of splines, whose derivatives are too rough where they differ by more than this part
CLOSE = 1e-3  # of the smallest step: at this distance from a sample the reference is differentiated
MOST = 0.1  # of the reference's duration: the largest shift
FEWEST = 8  # samples that must remain where both have values


@dataclass(frozen=True)
class Shift:
    """The values belong to times that are `late_s` (s) earlier: all of `channels` agree with the reference there.

    `step_s` (s) is the usual distance of two samples.
    """

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
    """The shift of all times with which most channels that move agree; None if there is none.

    A single channel may agree by chance, while a clock concerns all of them. The search starts from the channel whose
    difference is most like a shift, and takes the reference at shifted times as it is computed there. `reference_at`
    gives the channels (T,k) at times (s) between 0 and `t_end`.
    """
    rates = _rates(differing, reference_at, t_end)
    guesses = {channel: guess for channel, rate in rates.items() if (guess := _guess(differing[channel], rate))}
    if not guesses:
        return None
    leading = min(guesses, key=lambda channel: guesses[channel][1])
    late, seen = guesses[leading][0], differing[leading]
    before: tuple[float, float] | None = None
    for _ in range(ROUNDS):
        inside = (seen.times - late >= 0.0) & (seen.times - late <= t_end)
        if abs(late) > MOST * t_end or np.sum(inside) < FEWEST:
            return None
        there = reference_at(seen.times[inside] - late)
        agreeing = tuple(name for name, difference in differing.items() if _agrees(difference, there, inside))
        if len(agreeing) > 0.5 * sum(difference.is_visible and difference.varies for difference in differing.values()):
            return Shift(late, agreeing, float(np.median(np.diff(seen.times))))
        if leading not in there:
            return None
        left = _shift(seen.channel, seen.values[inside], there[leading], rates[leading][inside])
        is_stuck = before is not None and not abs(left) <= CONVERGING * abs(before[1])
        if is_stuck or abs(left) <= FOUND * t_end:
            return None  # the best shift is found, and does not explain the difference
        slope = -1.0 if before is None else (left - before[1]) / (late - before[0])
        before, late = (late, left), late - left / slope
    return None


def _guess(seen: Evidence, rate: Real) -> tuple[float, float] | None:
    """The shift (s) to first order, and which part of the difference it leaves; None if it is not like a shift."""
    apart = _apart(seen.channel, seen.values, seen.reference)
    late = _shift(seen.channel, seen.values, seen.reference, rate)
    left = float(np.linalg.norm(apart + late * rate) / np.linalg.norm(apart))
    return (late, left) if left <= LIKE_A_SHIFT else None


def _shift(channel: str, values: Real, reference: Real, rate: Real) -> float:
    """By how much (s) values are later than the reference, to first order."""
    whole = float(np.sum(rate * rate))
    return -float(np.sum(rate * _apart(channel, values, reference))) / whole if whole > 0.0 else 0.0


def _rates(
    differing: Mapping[str, Evidence], reference_at: Callable[[Real], Mapping[str, Real]], t_end: float
) -> dict[str, Real]:
    """The rates of change of the channels that move: by splines, or where these are too rough, by differences of the
    reference close to each sample."""
    rates, rough = {}, {}
    for channel, seen in differing.items():
        if len(seen.times) < FEWEST or not (seen.is_visible and seen.varies):
            continue
        rows = _continuous(channel, seen.reference)
        rates[channel], other = (
            np.asarray(make_interp_spline(seen.times, rows, k=degree).derivative()(seen.times), float)
            for degree in DEGREES
        )
        if np.linalg.norm(rates[channel] - other) > ROUGH * np.linalg.norm(other):
            del rates[channel]
            rough[channel] = seen
    vectors = [channel for channel in rough if not channel.endswith(".orientation")]  # quaternions may have any signs
    if not vectors:
        return rates
    times = rough[vectors[0]].times
    step = CLOSE * float(np.min(np.diff(times)))
    early, late = np.maximum(times - step, 0.0), np.minimum(times + step, t_end)
    asked = np.union1d(early, late)
    there = reference_at(asked)
    before, behind = np.searchsorted(asked, early), np.searchsorted(asked, late)
    for channel in vectors:
        if channel in there:
            rates[channel] = (there[channel][behind] - there[channel][before]) / (late - early)[:, None]
    return rates


def _continuous(channel: str, rows: Real) -> Real:
    """The rows; quaternions with signs that do not jump."""
    if not channel.endswith(".orientation"):
        return rows
    jumps = np.sum(rows[1:] * rows[:-1], axis=1) < 0.0
    return rows * np.cumprod(np.concatenate([[1.0], np.where(jumps, -1.0, 1.0)]))[:, None]


def _apart(channel: str, values: Real, reference: Real) -> Real:
    """The difference; of quaternions with the signs in which the reference is continuous."""
    reference = _continuous(channel, reference)
    if channel.endswith(".orientation"):
        values = values * np.where(np.sum(values * reference, axis=1) < 0.0, -1.0, 1.0)[:, None]
    return values - reference


def _agrees(seen: Evidence, there: Mapping[str, Real], inside: np.ndarray) -> bool:
    """Whether a channel that moves agrees with the shifted reference."""
    if seen.channel not in there or not (seen.is_visible and seen.varies):
        return False
    return bool(np.all(distance(seen.channel, seen.values[inside], there[seen.channel]) <= seen.allowed))


# Samples at which the reference jumps (impacts, latches, steps of loads or controllers). There a right result may have
# either side, and its event may come a little earlier or later than the reference's. Where only a few samples of a
# channel are too far off, the reference is therefore taken on both sides of each, near enough that smooth motion hardly
# changes: if it jumps and the sample lies on one of the sides, it is not compared.

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
