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
from flexmb.run.switching import timing_of
from flexmb.system.tree_system import System
from flexmb.tables.status import Status
from flexmb.typing import Real

AT_SINGULAR_POSITIONS = (Status.CLOSURE_SINGULAR, Status.BRANCH_UNKNOWN, Status.CLOSURE_OPEN)

Further = Callable[[Raw, float], Raw]
"""On from where a piece ended to a time (s), whatever comes to its level meanwhile."""


def goes_on(raw: Raw, span: float, further: Further, speeds: slice) -> bool:
    """Whether a run can be taken up where a piece ended, for `span` (s), as it moves and the other way.

    speeds: their places in y.
    """
    back = raw.y.copy()
    back[speeds] *= -1.0
    return all(
        further(raw._replace(y=y), raw.t + span).status not in AT_SINGULAR_POSITIONS for y in (raw.y, back)
    )  # fmt: skip


def placed(raw: Raw, levels: Watch, times: Real, further: Further, speeds: slice) -> tuple[Raw, float]:
    """A piece that came to a level, as it ends for the event, and how long (s) before the level that is.

    times (T,) s of its samples.
    """
    start, end = levels.leap.tolist()
    if not start < raw.t < end or goes_on(raw, end - start, further, speeds):
        return raw, 0.0
    before = raw.states[times[: len(raw.states)] <= start]
    return raw._replace(states=before, y=levels.before.copy(), t=start), raw.t - start


def ends_within(system: System, raw: Raw, t: float) -> float:
    """How long (s) leaps last near a time that a run did not come to, for a singular position; 0 where they do not, or
    where the scene's profiles end before."""
    longest = longest_leap(system, raw) if raw.status in AT_SINGULAR_POSITIONS and system.scene.closures else 0.0
    return longest if t - raw.t <= longest <= timing_of(system).end - t and longest < np.inf else 0.0


def longest_leap(system: System, raw: Raw) -> float:
    """How long (s) a leap may last where a piece ended; infinite at rest."""
    from flexmb.closure.leap import LEAP  # trees need none of it
    from flexmb.system.closed import ClosedSystem

    assert isinstance(system, ClosedSystem)
    return 2.0 * LEAP * system.closures.passing_time(raw.t, np.r_[raw.y[: system.nq + system.nu], 0.0])
