"""What is observed at the samples of a run, in one compiled loop for all algorithms and scenes: by address."""

from __future__ import annotations

import math

import numpy as np

from flexmb.entry.observation import outputs, shapes
from flexmb.jit.direct import at_address, nothing_at, status_at
from flexmb.jit.kernel import kernel
from flexmb.tables.status import OK

_NONE = np.zeros(0, np.int64)
outputs_at = at_address(outputs(shapes(0, 0, 0, 0), _NONE, _NONE))


@kernel
def observe_samples(where, doubt, times, states, slope, rows):
    """Rows (T,m) of out.every, out.drives and what is not written, at states (T,n) and times (T,); how many are sound.

    where (5,): addresses of a right-hand side (t, y, dy, c, w) and its tables, of the kernel (c, w, out) that observes
    where it was evaluated, and of the outputs; doubt (1,) is that of w, slope (n,) is written. The loop ends where a
    status is not OK, a number is not finite, or a pivot may be rounding: for Python to look into.
    """
    motion, c, w, observe, out = where[0], where[1], where[2], where[3], where[4]
    o = outputs_at(out)
    n, nu = o.every.shape[0], o.drives.shape[0]
    for sample in range(times.shape[0]):
        status = status_at(motion, (times[sample], states[sample], slope, c, w))
        if status != OK or doubt[0] != 0:
            return sample
        nothing_at(observe, (c, w, out))
        for i in range(n):
            if not math.isfinite(o.every[i]):
                return sample
            rows[sample, i] = o.every[i]
        for j in range(nu):
            rows[sample, n + j] = o.drives[j]
    return times.shape[0]
