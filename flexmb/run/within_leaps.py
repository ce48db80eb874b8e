"""Events whose instant lies within a leap of a closed chain over a singular position (`flexmb.closure.leap`).

Within a leap the motion is known from the leap's polynomial, but loads are not, and a new segment can start only far
enough from the singular position. Whether it can is tried, both forwards and with all speeds reversed, because an event
may reverse the motion. If it cannot, the event happens before its instant: at the start of the leap, or earlier by the
longest duration of a leap, which is 2^-9 of the time in which the mechanism moves by its own size.
"""

from __future__ import annotations

import numpy as np

from flexmb.integrate.settings import Settings
from flexmb.integrate.watch import Watch, watch
from flexmb.run.propagate import Raw, integrate
from flexmb.run.situation import Situation
from flexmb.system.system import System
from flexmb.tables.status import Status
from flexmb.typing import Real

AT_SINGULAR_POSITIONS = (Status.CLOSURE_SINGULAR, Status.BRANCH_UNKNOWN, Status.CLOSURE_OPEN)


def placed(situation: Situation, left: Settings, raw: Raw, levels: Watch, times: Real) -> tuple[Raw, float]:
    """A segment that reached a level, ended where the event happens, and how long (s) before its instant that is.

    left: settings with the number of steps that are left. times (T,) s: output times of the segment.
    """
    start, end = levels.leap.tolist()
    if not start < raw.t < end or _goes_on(situation, left, raw, end - start):
        return raw, 0.0
    before = raw.states[times[: len(raw.states)] <= start]
    return raw._replace(states=before, y=levels.before.copy(), t=start), raw.t - start


def too_near(situation: Situation, left: Settings, raw: Raw, t_start: float, due: float) -> float:
    """How long (s) before the time `due` its event has to happen, given the segment up to there; 0 if at that time.

    t_start (s): start of the segment, before which the event cannot happen.
    """
    longest = _longest_leap(situation.system, raw)
    if not longest < due - t_start:  # NaN is no length either
        return 0.0
    if raw.status is Status.OK:
        is_near = raw.t == due and not _goes_on(situation, left, raw, longest)
    else:
        is_near = raw.status in AT_SINGULAR_POSITIONS and due - raw.t <= longest
    return longest if is_near else 0.0


def _goes_on(situation: Situation, left: Settings, raw: Raw, span: float) -> bool:
    """Whether a segment of length `span` (s) can start where another ended, with its speeds and with reversed ones."""
    back = raw.y.copy()
    back[situation.speeds] *= -1.0
    for y in (raw.y.copy(), back):
        begin = situation.going_on(raw._replace(y=y))
        with situation.integration() as solve:
            nothing = watch((), (), (), (), (), (), solve.size)  # the same compiled code as for segments
            tried = integrate(solve, begin, np.array([raw.t, raw.t + span]), left, nothing, goes_on=True)
        if tried.status in AT_SINGULAR_POSITIONS:
            return False
    return True


def _longest_leap(system: System, raw: Raw) -> float:
    """The longest duration (s) of a leap at the end of a segment; infinite at rest."""
    from flexmb.closure.leap import LEAP  # imported here because trees do not need it

    assert system.closures is not None  # only chains leap
    return 2.0 * LEAP * system.closures.passing_time(raw.t, np.r_[raw.y[: system.nq + system.nu], 0.0])
