"""SciPy's integrators around the equations of motion of peers that have dynamics and no fit integrator of their own."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp

from crosscheck.engines.contract import Effort
from crosscheck.engines.functions_of_time import breaks_between
from flexmb.scene.functions import Function
from flexmb.typing import Real

# Angles of elastic chains are a thousandth of a radian: coarser absolute tolerances let their fastest modes ring.
_SMALL = 1e-3
# Coordinates and speeds are of order one to a hundred, so below this the error control would chase round-off.
_ROUND_OFF = 1e-13


def integrate(
    rate: Callable[[float, Real], Real], y: Real, functions: list[Function], times: Real, effort: Effort
) -> tuple[list[Real], int, str]:
    """States at the sample times reached, evaluations of the right-hand side, and why it stopped early.

    It restarts wherever a function of time is not smooth, so that the error control never steps over a kink; the
    right-hand side sees the limit from the left at the end of a stretch.
    """
    ends = [times[0], *breaks_between(functions, times[0], times[-1]), times[-1]]
    states = [y]
    evaluations = 0
    for begin, end in pairwise(ends):
        before_end = np.nextafter(end, begin)
        inside = times[(times > begin) & (times <= end)]
        solved = solve_ivp(
            lambda t, y, last=before_end: rate(min(t, last), y),
            (begin, end), y, method=effort.method, t_eval=np.union1d(inside, [end]),
            rtol=effort.value, atol=max(_SMALL * effort.value, _ROUND_OFF),
        )  # fmt: skip
        evaluations += solved.nfev
        good = np.isfinite(solved.y).all(axis=0)
        count = len(good) if good.all() else int(np.argmin(good))
        states += [solved.y[:, k] for k in range(count) if solved.t[k] in inside]
        if solved.status != 0 or count < len(good):
            stopped = solved.t[count - 1] if count else begin
            return states, evaluations, f"stopped after t = {stopped:g} s: {solved.message}"
        y = solved.y[:, -1]
    return states, evaluations, ""
