"""DOP853 for eight runs at once: `flexmb.integrate.dop853` in lanes, each with its own time, step and samples."""

from __future__ import annotations

from flexmb.integrate.control import CALM, SAMPLES, copy
from flexmb.integrate.dop853_formulas import END, ERROR_EXPONENT, interpolate
from flexmb.integrate.dop853_lane_steps import attempt, first_step, last_stages
from flexmb.integrate.lane_control import RUNNING, any_running, awaits_sample, begin_segment, go_on, propose
from flexmb.integrate.lane_problem import any_chosen, lane_derivative, mark_finite, project_start, store_lane
from flexmb.jit.kernel import helper, kernel
from flexmb.jit.lanes import LANES, select
from flexmb.tables.status import NONFINITE, OK


@helper
def _begin(problem, s, entries, control, clock, out, counts):
    """Project the initial states, store them as first samples, and start the first segment of every lane."""
    times, segment_ends, _ = clock
    project_start(problem, s, entries, times[0])
    for lane in range(LANES):
        store_lane(entries.y, lane, out[lane, 0])
        counts[lane, SAMPLES] = 1
        control.t[lane], control.error_before[lane] = times[0], CALM
        control.status[lane] = RUNNING
        begin_segment(control, segment_ends, lane)


@helper
def _derivative_at_start(problem, s, entries, control, counts):
    """k[0] of all lanes at the start of a segment, where f may jump: its limit from the right. Lanes whose derivative
    is not finite end."""
    for lane in range(LANES):
        entries.time[0, lane] = control.t[lane]
    copy(s.y, s.trial)
    status = lane_derivative(problem, s, 0, counts)
    mark_finite(s.k[0], s.chosen)
    for lane in range(LANES):
        if control.status[lane] == RUNNING and entries.chosen[0, lane] == 0.0:
            control.status[lane] = NONFINITE
    return status


@helper
def _store_samples(problem, s, entries, control, times, out, counts):
    """Store the samples in accepted steps, their ends included; the interpolant is computed if a lane needs it.

    Each pass stores one sample of every lane that has samples left. Interpolated states are projected.
    """
    built = False
    while True:
        waiting, inside = False, False
        for lane in range(LANES):
            entries.fraction[0, lane], entries.time[0, lane] = 1.0, control.end[lane]
            if entries.chosen[0, lane] == 1.0 and awaits_sample(control, times, counts, lane):
                waiting = True
                time = times[counts[lane, SAMPLES]]
                if time < control.end[lane]:
                    inside = True
        if not waiting:
            return OK
        if inside:
            if not built:
                status = last_stages(problem, s, entries, control, counts)
                if status != OK:
                    return status
                built = True
            for lane in range(LANES):
                if entries.chosen[0, lane] == 1.0 and awaits_sample(control, times, counts, lane):
                    time = times[counts[lane, SAMPLES]]
                    entries.time[0, lane] = time
                    entries.fraction[0, lane] = (time - control.t[lane]) / (control.end[lane] - control.t[lane])
            interpolate(s.y, s.f, s.fraction[0], s.trial)
            problem.project(problem.stages, problem.manifold)
        for lane in range(LANES):
            if entries.chosen[0, lane] == 1.0 and awaits_sample(control, times, counts, lane):
                sample = counts[lane, SAMPLES]
                at_end = times[sample] == control.end[lane]
                store_lane(entries.y_new if at_end else entries.trial, lane, out[lane, sample])
                counts[lane, SAMPLES] = sample + 1


@kernel
def dop853_lanes(problem, s, entries, control, clock, accuracy, out, counts):
    """Integrate from the states s.y (n,LANES), each as `dop853` does; returns a status code.

    clock: output times (T,) and segment ends (LANES,S) of each lane. out (LANES,T,n), counts (LANES,COUNTS). The status
    is OK unless no lane can continue; control.status (LANES,) is OK for lanes that have reached their end.
    """
    times, segment_ends, _ = clock
    _begin(problem, s, entries, control, clock, out, counts)
    status = _derivative_at_start(problem, s, entries, control, counts)
    if status == OK:
        status = first_step(problem, s, entries, control, accuracy, counts)
    if status != OK:
        return status
    while any_running(control):
        propose(entries, control, segment_ends, accuracy, counts)
        status = attempt(problem, s, entries, control, accuracy, counts)
        if status == OK and any_chosen(entries):
            status = _store_samples(problem, s, entries, control, times, out, counts)
            accepted = s.chosen[0] > 0.0
            for i in range(s.y.shape[0]):
                s.y[i] = select(accepted, s.y_new[i], s.y[i])
                s.k[0, i] = select(accepted, s.k[END, i], s.k[0, i])
        if status != OK:
            return status
        if go_on(entries, control, segment_ends, ERROR_EXPONENT, counts):
            status = _derivative_at_start(problem, s, entries, control, counts)
            if status != OK:
                return status
    return OK
