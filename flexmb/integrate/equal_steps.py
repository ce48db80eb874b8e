"""The loop of the methods of equal steps: each interval between samples and segment ends is divided evenly.

When a step is complete, it is first searched for crossings of watched levels, then its end becomes the last good state.
A step that meets a singular position of a closed chain is replaced by a detour, if the method has one.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from flexmb.integrate.control import ACCEPTED, SAMPLES, Interval, copy, permitted, stretch
from flexmb.integrate.leap import may_leap
from flexmb.integrate.memory import DONE, STRETCH, begin, keep_place
from flexmb.integrate.watch import pause, watches
from flexmb.jit.kernel import helper
from flexmb.tables.status import OK


class FixedMethod(NamedTuple):
    """The functions of a method that the loop calls. `known` (NUMBERS,) holds the numbers of
    `flexmb.integrate.memory.Memory` before a step, s the arrays of the method. All functions except `state_at` are
    marked by `handed_in`:

    attempt(problem, step, h, ends, s, known, accuracy, counts) -> status code makes a step of size h (s): its end,
    projected, goes into ends.y_new, and the slope there into ends.dy_new.
    detour(problem, watch, status, step, ends, s, samples, run) -> (status code, time of ends.y) integrates to the end
    of a step that met a singular position, or further.
    accept(s) is called after a successful step.
    enter(known) discards what is not valid across the end of a segment.
    recall(problem, memory, s, known, accuracy, counts) and keep(memory, s) read and write all else that the method
    needs to resume a run.
    state_at: see `flexmb.integrate.watch`; it is given the arrays `looking`, which only it uses.
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
    """Integrate y' = f(t, y) from ends.y as described in `Integrator`: (status code, time of the last good state).

    arrays: s and `Ends`; run: accuracy and counts.
    """
    attempt, detour, accept, enter, recall, keep_more, state_at, looking = method
    times, segment_ends, _ = clock
    s, ends = arrays
    accuracy, counts = run
    y, samples = ends.y, (times, out)
    t = begin(problem, times, y, ends.y_new, memory, out, counts)
    known = memory.numbers.copy()
    recall(problem, memory, s, known, accuracy, counts)
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
                if watches(watch):
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
        if counts[SAMPLES] == sample:  # otherwise a leap has stored it
            copy(y, out[sample])
            counts[SAMPLES] = sample + 1
    keep_place(memory, t, y, t, 0, known)
    keep_more(memory, s)
    return OK, t
