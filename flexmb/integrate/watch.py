"""Finds where an entry of the state, or a signal, reaches a level, in the dense output of a step; the run pauses there.

A run pauses at the first of the levels that a step reaches. A quantity whose side of its level differs between the ends
of a step has reached the level. If the sides are equal, it may have crossed twice: where it moves towards the level at
the start of the step and away from it at the end, its turning point is searched for. So crossings are found for a
quantity with one turning point within a step, but may be missed between two turning points.

An integrator says what a step is: `Ends`, and a helper `state_at(problem, step, ends, s, t, result, run)`, marked by
`handed_on`, that puts the state at a time t (s) within it into `result` (n,) and returns a status code; s is whatever
that helper needs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from flexmb.integrate.control import ACCEPTED, SAMPLES, Interval, copy
from flexmb.integrate.problem import Accuracy
from flexmb.jit.bundle import AnyBundle, bundle
from flexmb.jit.direct import addresses, status_at
from flexmb.jit.kernel import helper, kernel, sweep
from flexmb.jit.pointer import REAL, STATUS, VECTOR
from flexmb.tables.status import OK
from flexmb.typing import Index, Real

CROSSED = -1  # returned in place of a status code: no end of the run
UNKNOWN = 2  # a side that the first step determines
RESTED = 2  # factor on `came` for a quantity that has rested at its level for a step

_FINEST = 2.0**-52  # fraction of a step: resolution of times within it
_NEAR = 2.0**-13  # fraction of a step over which rates are computed as differences
_NARROW = 2.0**-20  # fraction of a step: accuracy of a turning point, where values are flat and then exact to rounding
_NOWHERE, _PASSES, _TURNS = range(3)  # relation of a quantity to its level in a step


@bundle
class Watch:
    """What a run watches. As a tuple, its seventeen arrays were copied and counted in every call: short steps of `rk4`
    took twice as long (measured), and an integrator had half as much code again.

    entry (k,) of y, or -1 - j for signal j; level (k,); direction (k,): 1 rising, -1 falling, 0 either.

    side (k,): -1 where it is below its level, 1 above, 0 at it, kept from step to step. came (k,): of what is at its
    level where a run begins and may go either way, the side that it came from, else 0; see `RESTED`. still (k,): what
    moves by less within a step is at rest; 0 for entries of y, which are exact. found (k,): 1 where a level is reached
    at the time at which a run paused, and rate (k,) per second there, of signals. value, after, reach (k,): scratch:
    above its level, its side at the end of a step, and what becomes of it there. signal (S,): scratch; empty where only
    entries are watched. leap (2,): start and end (s) of the leap in which a level is reached, NaN if it is none; before
    (n,): y at its start. kept (1,): 1 where the run can be resumed from before a step that its end shortened;
    kept_side, kept_came (k,): as they were there.
    look (1,): address of the kernel look(t, y, signal, constants), which finds all signals and returns a status code.
    """

    entry: Index
    level: Real
    direction: Index
    side: Index
    came: Index
    still: Real
    found: Index
    rate: Real
    value: Real
    after: Index
    reach: Index
    signal: Real
    leap: Real
    before: Real
    kept: Index
    kept_side: Index
    kept_came: Index
    look: Index

    def seeing(self, signals: int, look: Any, constants: Any) -> Watch:
        """The same with access to this number of signals, which the kernel `look` finds by a bundle of constants."""
        return replace(self, signal=np.zeros(signals), look=_address(look, constants))


class Ends(NamedTuple):
    """State y and slope dy (n,) at the start of a step, y_new and dy_new at its end."""

    y: np.ndarray
    dy: np.ndarray
    y_new: np.ndarray
    dy_new: np.ndarray


class Within(NamedTuple):
    """A step from `start` to `end` (s) to look into, by its `state_at`, which is handed `problem` and `s`.

    trial (n,): the state where it was looked into last; run: accuracy and counts.
    """

    problem: Any
    watch: Watch
    step: Interval
    ends: Ends
    state_at: Any
    s: Any
    trial: np.ndarray
    run: tuple[Accuracy, np.ndarray]


@helper
def watches(watch):
    """Whether there is anything to watch."""
    return watch.entry.shape[0] > 0


@helper
def crosses(side, after, direction):
    """Whether a value that was on a side of zero comes to it in this direction, or goes through it."""
    if side < 0:
        return after >= 0.0 and direction >= 0
    return side > 0 and after <= 0.0 and direction <= 0


@helper
def _side(value, still):
    """On which side of zero a value is; 0 at it."""
    if abs(value) <= still:
        return 0
    return -1 if value < 0.0 else 1


@helper
def _first_side(value, change, still):
    """The side of a value in the first step; a value at zero is on the side to which it moves within the step."""
    side = _side(value, still)
    return _side(change, still) if side == 0 else side


@helper
def _has_jumped(side, value, still):
    """Whether a signal is beyond its level where a step begins: a controller acted there, or a function switched."""
    return still > 0.0 and side * value < -still


@helper
def keep_sides(watch):
    """Save the sides, together with `flexmb.integrate.memory.keep`."""
    watch.kept[0] = 1
    for i in range(watch.entry.shape[0]):
        watch.kept_side[i], watch.kept_came[i] = watch.side[i], watch.came[i]


@helper
def _look(constants, watch, t, y):
    """watch.value of all at t and y (n,); a status code."""
    status = OK
    if watch.signal.shape[0] > 0:
        status = status_at(watch.look[0], (t, y, watch.signal, constants))
    for i in range(watch.entry.shape[0]):
        entry = watch.entry[i]
        watch.value[i] = (y[entry] if entry >= 0 else watch.signal[-1 - entry]) - watch.level[i]
    return status


@helper
def _rates(constants, watch, t, y, dy, ahead, trial):
    """watch.rate at t and y (n,), whose slope is dy; of signals by a difference over `ahead` (s). A status code."""
    status = OK
    if watch.signal.shape[0] > 0:
        for j in range(y.shape[0]):
            trial[j] = y[j] + ahead * dy[j]
        status = _look(constants, watch, t + ahead, trial)
        copy(watch.value, watch.rate)
        if status == OK:
            status = _look(constants, watch, t, y)
        for i in range(watch.entry.shape[0]):
            watch.rate[i] = (watch.rate[i] - watch.value[i]) / ahead
    else:
        status = _look(constants, watch, t, y)
    for i in range(watch.entry.shape[0]):
        if watch.entry[i] >= 0:
            watch.rate[i] = dy[watch.entry[i]]
    return status


@kernel
def meets(constants, watch, step, ends):
    """Whether a step may reach a level: (status, whether). If it does not, sides are updated to those at its end.

    `constants` are those of the problem. A kernel of its own, which all integrators share.
    """
    h, count, trial = step.end - step.start, watch.entry.shape[0], np.empty(ends.y.shape[0])
    before, begun = np.empty(count), np.empty(count)
    status = _rates(constants, watch, step.start, ends.y, ends.dy, _NEAR * h, trial)
    copy(watch.rate, before)
    copy(watch.value, begun)
    for i in range(count):
        if watch.side[i] == UNKNOWN:
            side = _first_side(watch.value[i], before[i] * h, watch.still[i])
            watch.side[i] = 0 if watch.came[i] != 0 else side
    if status == OK:
        status = _rates(constants, watch, min(step.end, step.last), ends.y_new, ends.dy_new, -_NEAR * h, trial)
    if status != OK:
        return status, False
    some = False
    for i in range(count):
        value = watch.value[i]
        if watch.came[i] != 0:
            _leave(watch, i, before[i] * h, value)
        side = watch.side[i]
        watch.reach[i] = _NOWHERE
        jumped = _has_jumped(side, begun[i], watch.still[i]) and crosses(side, begun[i], watch.direction[i])
        if jumped or crosses(side, value, watch.direction[i]):
            watch.reach[i] = _PASSES
        elif side != 0 and not crosses(side, value, 0) and side * before[i] < 0.0 and side * watch.rate[i] > 0.0:
            watch.reach[i] = _TURNS
        some = some or watch.reach[i] != _NOWHERE
        watch.after[i] = _side(value, watch.still[i] if side == 0 else 0.0)
    if not some:
        settle(watch)
    return OK, some


@helper
def _leave(watch, i, change, value):
    """The side on which i leaves its level, by its change in the first step or, from rest, that from which it came.

    A quantity that drifts past the level from rest reaches it again, even if it has rested there for a step before.
    """
    came = watch.came[i]
    side = 1 if came > 0 else -1
    if abs(change) > watch.still[i]:
        watch.side[i], watch.came[i] = side if abs(came) == RESTED or side * change > 0.0 else -side, 0
    elif abs(value) > watch.still[i]:
        watch.side[i], watch.came[i] = side, 0
    else:
        watch.came[i] = RESTED * side


@helper
def settle(watch):
    """Sides after a step in which no level was reached."""
    for i in range(watch.entry.shape[0]):
        if watch.after[i] != 0:
            watch.side[i] = watch.after[i]


@sweep
def end_at_crossing(within, times, out):
    """End a step that `meets` a level at the first one: its state in ends.y, and the samples before it stored.

    Returns (CROSSED, the time); (OK, .) where no level is reached after all, and sides are those of the step's end; or
    the status of what fails.
    """
    problem, watch, step, ends, state_at, s, trial, run = within
    t, first = math.inf, 0
    for i in range(watch.entry.shape[0]):
        if watch.reach[i] != _NOWHERE:
            status, low, high = OK, step.start, step.end
            if watch.reach[i] == _TURNS:
                status, low, high = _beyond(within, i)
            if status == OK and high < math.inf:
                status, high = _arrival(within, i, low, high)
            if status != OK:
                return status, step.start
            if high < t:
                t, first = high, i
    if t == math.inf:
        settle(watch)
        return OK, step.end
    counts = run[1]
    while counts[SAMPLES] < times.shape[0] and times[counts[SAMPLES]] < t:
        status = state_at(problem, step, ends, s, times[counts[SAMPLES]], out[counts[SAMPLES]], run)
        if status != OK:
            return status, step.start
        counts[SAMPLES] += 1
    status = _note(within, first, t)
    if status != OK:
        return status, step.start
    copy(trial, ends.y)
    counts[ACCEPTED] += 1
    return CROSSED, t


@sweep
def pause(problem, watch, step, ends, state_at, s, samples, run):
    """ends.y at the first level that a step comes to: (CROSSED, the time); or the status of what fails, and the start.

    If it reaches none: OK, and its end if it was searched, else its start. samples: times of samples, and samples; run:
    accuracy and counts.
    """
    status, some = meets(problem.constants, watch, step, ends)
    if status != OK or not some:
        return status, step.start
    within = Within(problem, watch, step, ends, state_at, s, np.empty(ends.y.shape[0]), run)
    return end_at_crossing(within, samples[0], samples[1])


@sweep
def _value_at(within, i, t):
    """How far i is above its level at a time within a step, with the state in `trial`: (status, value)."""
    problem, watch, step, ends, state_at, s, trial, run = within
    status = OK
    if t >= step.end:
        copy(ends.y_new, trial)
    elif t <= step.start:
        copy(ends.y, trial)
    else:
        status = state_at(problem, step, ends, s, t, trial, run)
    if status == OK:
        status = _look(problem.constants, watch, min(t, step.last), trial)
    return status, watch.value[i]


@sweep
def _beyond(within, i):
    """A bracket of the time at which a quantity with a turning point reaches its level: (status, low, high); high is
    inf if it does not.

    The turning point is bracketed by the sign of differences. If only the crossing on the way back is in the direction
    that counts, the side is set to that beyond the level.
    """
    watch, low, high = within.watch, within.step.start, within.step.end
    least = 4.0 * (np.nextafter(high, math.inf) - high)  # between times that rounding tells apart
    narrow, side = max(_NARROW * (high - low), least), watch.side[i]
    while high - low > narrow:
        middle = 0.5 * (low + high)
        status, one = _value_at(within, i, middle - 0.5 * narrow)
        other = 0.0
        if status == OK:
            status, other = _value_at(within, i, middle + 0.5 * narrow)
        if status != OK:
            return status, low, math.inf
        if side * one <= 0.0 or side * other <= 0.0:
            there = middle - 0.5 * narrow if side * one <= 0.0 else middle + 0.5 * narrow
            if crosses(side, -1.0 * side, watch.direction[i]):
                return OK, within.step.start, there
            watch.side[i] = -side
            return OK, there, within.step.end
        if side * other < side * one:
            low = middle
        else:
            high = middle
    return OK, low, math.inf


@sweep
def _arrival(within, i, low, high):
    """The time between two others at which i reaches its level, to rounding: (status, time).

    By the Illinois variant of the regula falsi, with a bisection every third time and where the step starts at the
    level. Near time 0, where ulp(t) becomes arbitrarily small, the resolution is that of the step's length.
    """
    side, last_side, count = within.watch.side[i], 0, 0
    finest = _FINEST * (within.step.end - within.step.start)
    status, below = _value_at(within, i, low)
    if _has_jumped(side, below, within.watch.still[i]):
        return status, low
    above = 0.0
    if status == OK:
        status, above = _value_at(within, i, high)
    while status == OK and above != 0.0 and high - low > max(2.0 * (np.nextafter(high, math.inf) - high), finest):
        middle, count = 0.5 * (low + high), count + 1
        if count % 3 != 0 and crosses(side, above, 0) and not crosses(side, below, 0):
            middle = low + (high - low) * below / (below - above)
            middle = max(middle, np.nextafter(low, high), low + 0.5 * finest)
            middle = min(middle, np.nextafter(high, low), high - 0.5 * finest)
        status, value = _value_at(within, i, middle)
        if crosses(side, value, 0):
            high, above = middle, value
            below = 0.5 * below if last_side > 0 else below
            last_side = 1
        else:
            low, below = middle, value
            above = 0.5 * above if last_side < 0 else above
            last_side = -1
    return status, high


@sweep
def _note(within, first, t):
    """What is reached at time t, the first level and others at the same time, and the rates of signals there.

    Leaves the state in `trial`; a status code.
    """
    watch, step = within.watch, within.step
    near = _NEAR * (step.end - step.start)
    other = t + near if t + near <= step.end else t - near
    status, _ = _value_at(within, first, other)
    copy(watch.value, watch.rate)
    if status == OK:
        status, _ = _value_at(within, first, t)
    for i in range(watch.entry.shape[0]):
        watch.rate[i] = (watch.rate[i] - watch.value[i]) / (other - t) if other != t else 0.0
        arrived = crosses(watch.side[i], watch.value[i], watch.direction[i])
        watch.found[i] = 1 if i == first or arrived else 0
    return status


@kernel
def _no_signals(t, y, signal, constants):
    return OK


def watch(
    entries: Sequence[int], levels: Sequence[float], directions: Sequence[int], sides: Sequence[int],
    came: Sequence[int], still: Sequence[float], size: int,
) -> Watch:  # fmt: skip
    """Of lists of equal lengths, for a state of `size` numbers; who has signals lets it see them by `Watch.seeing`."""
    count = len(entries)
    whole = [np.array(column, np.int64) for column in (entries, directions, sides, came)]
    return Watch(
        whole[0], np.array(levels, float), *whole[1:], np.array(still, float), np.zeros(count, np.int64),
        np.zeros(count), np.zeros(count), np.zeros(count, np.int64), np.zeros(count, np.int64), np.zeros(0),
        np.full(2, math.nan), np.zeros(size), np.zeros(1, np.int64), np.zeros(count, np.int64),
        np.zeros(count, np.int64), _address(_no_signals, AnyBundle._numba_type_),
    )  # fmt: skip


@cache
def nothing_watched() -> Watch:
    """Of a run that watches nothing, of any size: its arrays are empty, and nobody reads what is written to the rest.

    So integrators are compiled once, for runs with events and without.
    """
    return watch([], [], [], [], [], [], 0)


def _address(look: Any, constants: Any) -> Index:
    """(1,) Address of a kernel for `Watch.look`."""
    function, *_ = addresses(look, STATUS, REAL, VECTOR, VECTOR, constants)
    return np.array([function])
