"""The classical Runge-Kutta method for eight runs at once: `flexmb.integrate.rk4` in lanes, all at the same time."""

from __future__ import annotations

from flexmb.integrate.control import ACCEPTED, SAMPLES, copy, permitted, stretch
from flexmb.integrate.lane_problem import any_chosen, lane_derivative, mark_finite, project_start, set_all, store_lane
from flexmb.integrate.rk4 import advance, weigh
from flexmb.jit.kernel import helper, kernel, written_out
from flexmb.jit.lanes import LANES
from flexmb.tables.status import NONFINITE, OK


@written_out
def _step(problem, s, entries, t, last, h, counts):
    """s.trial = y(t + h) from s.y; no stage is later than `last`. Returns a status code."""
    set_all(entries.time, t)
    copy(s.y, s.trial)
    status = lane_derivative(problem, s, 0, counts)
    set_all(entries.time, t + 0.5 * h)
    for stage in range(1, 3):
        if status == OK:
            advance(s.y, 0.5 * h, s.k[stage - 1], s.trial)
            status = lane_derivative(problem, s, stage, counts)
    set_all(entries.time, min(t + h, last))
    if status == OK:
        advance(s.y, h, s.k[2], s.trial)
        status = lane_derivative(problem, s, 3, counts)
    weigh(s.y, h, s.k, s.trial)
    return status


@helper
def _store(entries, sample, out, counts):
    """out[lane, sample] = the state of each lane."""
    for lane in range(LANES):
        store_lane(entries.y, lane, out[lane, sample])
        counts[lane, SAMPLES] = sample + 1


@kernel
def rk4_lanes(problem, s, entries, clock, accuracy, out, counts):
    """Integrate from the states s.y (n,LANES) as `rk4` does each of them; returns (status code, time of its end).

    out (LANES,T,n): states at every time of the clock. counts (LANES,COUNTS). The status is OK unless all lanes have
    failed: those that failed alone are not finite at the end.
    """
    times, segment_ends, _ = clock
    t = times[0]
    project_start(problem, s, entries, t)
    _store(entries, 0, out, counts)
    segment = 0
    for sample in range(1, times.shape[0]):
        while t < times[sample]:
            start = t
            end, steps, h, last = stretch(start, times[sample], segment_ends[segment], accuracy.step)
            for j in range(steps):
                status = permitted(accuracy.max_steps, counts[0])
                if status == OK:
                    status = _step(problem, s, entries, t, last, h, counts)
                if status != OK:
                    return status, t
                mark_finite(s.trial, s.chosen)
                if not any_chosen(entries):
                    return NONFINITE, t
                t = end if j == steps - 1 else start + (j + 1) * h
                set_all(entries.time, t)
                problem.project(problem.stages, problem.manifold)
                copy(s.trial, s.y)
                for lane in range(LANES):
                    counts[lane, ACCEPTED] += 1
            if t == segment_ends[segment]:
                segment += 1
        _store(entries, sample, out, counts)
    return OK, t
