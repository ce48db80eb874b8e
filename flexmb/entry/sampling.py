"""Outputs at all samples of a run, in one compiled loop that calls the kernels of any algorithm by address."""

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
    """Write out.every and out.drives at states (T,n) and times (T,) to rows (T,m); returns the number of valid rows.

    where (5,): addresses of a right-hand side (t, y, dy, c, w), of its c and w, of the kernel (c, w, out) that computes
    the outputs after it, and of the outputs; doubt (1,) is that of w; slope (n,) is overwritten. The loop ends at the
    first sample with a status other than OK, a number that is not finite, or a doubtful pivot, which Python examines.
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
