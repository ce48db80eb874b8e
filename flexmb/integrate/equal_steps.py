"""The loop of the methods that take equal steps: every stretch between samples and ends of segments is divided evenly.

A step that is made ends in this order: it is looked into for levels that are watched, then its end becomes the last
good state. A step that meets a singular position of a closed chain is made in another way, if the method knows one.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from flexmb.integrate.control import ACCEPTED, SAMPLES, Interval, copy, permitted, stretch
from flexmb.integrate.leap import may_leap
from flexmb.integrate.memory import DONE, STRETCH, begin, keep_place
from flexmb.integrate.watch import pause
from flexmb.jit.kernel import helper
from flexmb.tables.status import OK


class FixedMethod(NamedTuple):
    """What a method brings to the loop. `known` (NUMBERS,) are the numbers of `flexmb.integrate.memory.Memory` as they
    are before a step, s are arrays of the method, and all functions but `state_at` are marked by `handed_in`:

    attempt(problem, step, h, ends, s, known, accuracy, counts) -> status code makes a step of size h (s): its end,
    projected, goes into ends.y_new, and the slope there into ends.dy_new.
    detour(problem, watch, status, step, ends, s, samples, run) -> (status code, time of ends.y) goes on to the end of a
    step that met a singular position, or further.
    accept(s) follows a step that was made.
    enter(known) forgets what does not hold across the end of a segment.
    recall(memory, s, known, accuracy, counts) and keep(memory, s) read and write what else the method keeps for a run
    that is taken up.
    state_at: see `flexmb.integrate.watch`; it is handed `looking`, arrays of its own.
    """

    attempt: Any
    detour: Any
    accept: Any
    enter: Any
    recall: Any
    keep: Any
    state_at: Any
    looking: Any


@helper
def equal_steps(method, problem, arrays, clock, out, run, memory, watch):
    """Integrate y' = f(t, y) from ends.y as told by `Integrator`: (status code, time of the last good state).

    arrays: s and `Ends`; run: accuracy and counts.
    """
    attempt, detour, accept, enter, recall, keep_more, state_at, looking = method
    times, segment_ends, _ = clock
    s, ends = arrays
    accuracy, counts = run
    y, samples = ends.y, (times, out)
    t = begin(problem, times, y, ends.y_new, memory, out, counts)
    known = memory.numbers.copy()
    recall(memory, s, known, accuracy, counts)
    start, done, segment = known[STRETCH], int(known[DONE]), 0
    for sample in range(counts[SAMPLES], times.shape[0]):
        while t < times[sample]:
            end, steps, h, last = stretch(start, times[sample], segment_ends[segment], accuracy.step)
            for j in range(done, steps):
                status = permitted(accuracy.max_steps, counts)
                if status != OK:
                    keep_place(memory, t, y, start, j, known)
                    keep_more(memory, s)
                    return status, t
                step = Interval(t, end if j == steps - 1 else start + (j + 1) * h, last)
                status = attempt(problem, step, h, ends, s, known, accuracy, counts)
                if may_leap(status):
                    status, t = detour(problem, watch, status, step, ends, s, samples, run)
                    if status == OK:
                        break
                if status != OK:
                    return status, t
                if watch is not None:
                    status, t_at = pause(problem, watch, step, ends, state_at, looking, samples, run)
                    if status != OK:
                        return status, t_at
                accept(s)
                t = step.end
                copy(ends.y_new, y)
                counts[ACCEPTED] += 1
            start, done = t, 0
            if t == segment_ends[segment]:
                segment += 1
                enter(known)
        if counts[SAMPLES] == sample:  # not met within a leap
            copy(y, out[sample])
            counts[SAMPLES] = sample + 1
    keep_place(memory, t, y, t, 0, known)
    keep_more(memory, s)
    return OK, t
