"""What is observed at the samples of a run, in one compiled loop for all algorithms and scenes: by address."""

from __future__ import annotations

import math

import numpy as np

from flexmb.entry.observation import outputs, shapes
from flexmb.jit.direct import at_address, status_at
from flexmb.jit.kernel import kernel
from flexmb.tables.status import OK

_NONE = np.zeros(0, np.int64)
outputs_at = at_address(outputs(shapes(0, 0, 0, 0), _NONE, _NONE))


@kernel
def observe_samples(function, c, w, out, doubt, times, states, rows):
    """Rows (T,m) of out.every, out.drives and what is not written, at states (T,n) and times (T,); how many are sound.

    The first four are addresses, of a kernel (t, y, c, w, out) and of what it takes; doubt (1,) is that of w. The loop
    ends where a status is not OK, a number is not finite, or a pivot may be rounding: for Python to look into.
    """
    o = outputs_at(out)
    n, nu = o.every.shape[0], o.drives.shape[0]
    for sample in range(times.shape[0]):
        status = status_at(function, (times[sample], states[sample], c, w, out))
        if status != OK or doubt[0] != 0:
            return sample
        for i in range(n):
            if not math.isfinite(o.every[i]):
                return sample
            rows[sample, i] = o.every[i]
        for j in range(nu):
            rows[sample, n + j] = o.drives[j]
    return times.shape[0]
