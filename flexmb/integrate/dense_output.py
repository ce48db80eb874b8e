"""Samples within a step, by the dense output of the method."""

from __future__ import annotations

from flexmb.integrate.control import SAMPLES, copy
from flexmb.jit.kernel import helper
from flexmb.tables.status import OK


@helper
def store_samples(problem, step, ends, state_at, s, samples, run):
    """Store the samples in a step, its end included; returns a status code.

    `state_at` is the method's function described in `flexmb.integrate.watch`. samples: (times, states); run: accuracy
    and counts.
    """
    times, out = samples
    _, counts = run
    sample = counts[SAMPLES]
    while sample < times.shape[0] and times[sample] <= step.end:
        if times[sample] == step.end:
            copy(ends.y_new, out[sample])
        else:
            status = state_at(problem, step, ends, s, times[sample], out[sample], run)
            if status != OK:
                return status
        sample += 1
        counts[SAMPLES] = sample
    return OK
