"""One sampled controller that acts, in floats or in dual numbers, apart from the schedule of a run."""

from flexmb.control.laws import act
from flexmb.jit.kernel import kernel


@kernel
def sample(t, i, s):
    """Evaluate controller i at its inputs among the signals; returns a status code."""
    o = s.controller[i]
    for j in range(o.inputs):
        s.input[o.input + j] = s.signal[s.wire[o.input + j]]
    return act(t, i, s)
