"""Events whose instant lies within a leap of a closed chain over a singular position (`flexmb.closure.leap`).

The motion there is known, by the leap's polynomial; loads are not, and a run can be taken up only where the singular
position itself is far enough. Whether it is, is tried, on the way on and on the way back, for an event may turn the
motion over. Where it is not, the event happens before its instant: where the leap starts, or as long before as leaps
last at most, a 2^-9 of the time in which the mechanism moves as far as it is large.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexmb.integrate.watch import Watch
from flexmb.run.propagate import Raw
from flexmb.run.situation import Situation
from flexmb.system.tree_system import System
from flexmb.tables.status import Status
from flexmb.typing import Real

AT_SINGULAR_POSITIONS = (Status.CLOSURE_SINGULAR, Status.BRANCH_UNKNOWN, Status.CLOSURE_OPEN)

Further = Callable[[Raw, float], Raw]
"""On from where a segment ended to a time (s), whatever comes to its level meanwhile."""


def placed(situation: Situation, raw: Raw, levels: Watch, times: Real, further: Further) -> tuple[Raw, float]:
    """A segment that came to a level, as it ends for the event, and how long (s) before the level that is.

    times (T,) s of its samples.
    """
    start, end = levels.leap.tolist()
    if not start < raw.t < end or _goes_on(situation, raw, end - start, further):
        return raw, 0.0
    before = raw.states[times[: len(raw.states)] <= start]
    return raw._replace(states=before, y=levels.before.copy(), t=start), raw.t - start


def too_near(situation: Situation, raw: Raw, t_start: float, due: float, further: Further) -> float:
    """How long (s) before a time that is due an event has to happen, after a run that was to end there; 0 for not.

    t_start (s): before it nothing can happen.
    """
    longest = _longest_leap(situation.system, raw)
    if longest >= due - t_start:
        return 0.0
    if raw.status is Status.OK:
        is_near = raw.t == due and not _goes_on(situation, raw, longest, further)
    else:
        is_near = raw.status in AT_SINGULAR_POSITIONS and due - raw.t <= longest
    return longest if is_near else 0.0


def _goes_on(situation: Situation, raw: Raw, span: float, further: Further) -> bool:
    """Whether a run can be taken up where a segment ended, for `span` (s), as it moves and the other way."""
    back = raw.y.copy()
    back[situation.speeds] *= -1.0
    return all(
        further(raw._replace(y=y), raw.t + span).status not in AT_SINGULAR_POSITIONS for y in (raw.y, back)
    )  # fmt: skip


def _longest_leap(system: System, raw: Raw) -> float:
    """How long (s) a leap may last where a segment ended; infinite at rest."""
    from flexmb.closure.leap import LEAP  # trees need none of it
    from flexmb.system.closed import ClosedSystem

    assert isinstance(system, ClosedSystem)
    return 2.0 * LEAP * system.closures.passing_time(raw.t, np.r_[raw.y[: system.nq + system.nu], 0.0])
