"""Step control of eight adaptive runs, one per lane: time, step, samples, segments, and the end of each run.

All lanes try a step together. A lane that has reached its end, or whose run has failed, tries steps of length zero
until the others have ended.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from flexmb.integrate.control import (
    ACCEPTED,
    REJECTED,
    SAMPLES,
    next_step,
    retreat,
    shorter,
    step_end,
    step_factor,
)
from flexmb.jit.kernel import helper
from flexmb.jit.lanes import LANES
from flexmb.tables.status import NONFINITE, OK, STEP_TOO_SMALL


class LaneControl(NamedTuple):
    """The run of each lane (LANES,): time, proposed step, end and length of the present trial step (s), last time of a
    stage (s), error norms of this step and of the previous accepted one, whether the last step was rejected, segment,
    number of segments, and status, which is RUNNING until the run ends.
    """

    t: np.ndarray
    h: np.ndarray
    end: np.ndarray
    length: np.ndarray
    last: np.ndarray
    error: np.ndarray
    error_before: np.ndarray
    rejected: np.ndarray
    segment: np.ndarray
    ends: np.ndarray
    status: np.ndarray


RUNNING = -1


def lane_control(ends: np.ndarray) -> LaneControl:
    """The control of new runs; ends (LANES,): their numbers of segments."""
    floats, integers = np.zeros((7, LANES)), np.zeros((2, LANES), np.int64)
    return LaneControl(*floats, *integers, ends, np.full(LANES, RUNNING))


@helper
def set_times(entries, control, fraction):
    """Set the time of each lane to this fraction of its step, but not later than the last time of a stage."""
    for lane in range(LANES):
        time = control.t[lane] + fraction * control.length[lane]
        entries.time[0, lane] = min(time, control.last[lane])


@helper
def begin_segment(control, segment_ends, lane):
    """Start the next segment of a lane, or end its run."""
    segment = control.segment[lane]
    if segment == control.ends[lane]:
        control.status[lane] = OK
    else:
        control.end[lane] = segment_ends[lane, segment]
        control.last[lane] = np.nextafter(control.end[lane], control.t[lane])
        control.rejected[lane] = 0


@helper
def propose(entries, control, segment_ends, accuracy, counts):
    """Set end and length of the next trial step of each lane; the length is zero for lanes that have ended."""
    for lane in range(LANES):
        t = control.t[lane]
        end = t
        if control.status[lane] == RUNNING:
            last = segment_ends[lane, control.segment[lane]]
            status, end = step_end(t, control.h[lane], last, STEP_TOO_SMALL, accuracy.max_steps, counts[lane])
            if status != OK:
                control.status[lane] = status
                end = t
        control.end[lane] = end
        control.length[lane] = end - t
        entries.h[0, lane] = control.length[lane]


@helper
def go_on(entries, control, segment_ends, exponent, counts):
    """Update time and step of each lane after a trial step; returns whether a lane has entered another segment.

    The error of the method is O(h^exponent).
    """
    entered = False
    for lane in range(LANES):
        if control.status[lane] != RUNNING:
            continue
        length, error, rejected = control.length[lane], control.error[lane], control.rejected[lane] == 1
        if entries.chosen[0, lane] == 1.0:
            end = control.end[lane]
            cut = end == segment_ends[lane, control.segment[lane]]
            factor = step_factor(error, control.error_before[lane], exponent, rejected)
            control.h[lane] = next_step(control.h[lane], length, factor, cut)
            control.t[lane], control.error_before[lane] = end, error
            control.rejected[lane] = 0
            counts[lane, ACCEPTED] += 1
            if cut:
                control.segment[lane] += 1
                begin_segment(control, segment_ends, lane)
                entered = entered or control.status[lane] == RUNNING
        else:
            factor = shorter(error, exponent) if math.isfinite(error) else retreat(NONFINITE)
            control.h[lane] = length * factor
            control.rejected[lane] = 1
            counts[lane, REJECTED] += 1
    return entered


@helper
def any_running(control):
    found = False
    for lane in range(LANES):
        found = found or control.status[lane] == RUNNING
    return found


@helper
def awaits_sample(control, times, counts, lane):
    """Whether the accepted step of a lane contains another sample."""
    sample = counts[lane, SAMPLES]
    return sample < times.shape[0] and times[sample] <= control.end[lane]
