"""A run followed again over all of its steps, for its envelope.

Output times are chosen before a run, and peaks of loads lie between them: right behind events, and within steps. So
each part of the run between two events is integrated twice more, from the same start by the same method: first to know
where its steps end, then with output times at these, at points within each step, and on both sides of every instant at
which a function of time or a controller's output jumps. Outputs are evaluated there as at any output time. In methods
of equal steps points within steps would divide them, so that only their ends are taken.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from flexmb.control.schedule import slack
from flexmb.integrate.control import COUNTS, STOP
from flexmb.integrate.settings import Settings
from flexmb.integrate.watch import nothing_watched
from flexmb.run.envelope import PartialEnvelope
from flexmb.run.interruption import interruptible
from flexmb.run.origin import Beginning
from flexmb.run.outputs import ending, observed
from flexmb.run.peaks import INSIDE, part_of
from flexmb.run.propagate import Integration, Raw, integrate, integration
from flexmb.run.run_arrays import joined
from flexmb.run.times import clock_of, sample_bytes
from flexmb.run.trajectory import Trajectory
from flexmb.system.algorithm import Algorithm
from flexmb.system.system import System
from flexmb.tables.state import DynamicsError
from flexmb.tables.status import OK, Status
from flexmb.typing import Flags, Index, Real

MEMORY = 2**27  # bytes of outputs that are held at once
TOGETHER = 4  # equal steps, through whose ends a polynomial is put
ROOM = 1000  # steps beyond those that are expected
FEWEST = 16  # steps whose outputs are held at once in any case


class Stretch(NamedTuple):
    """A part of a run without events, of a system, from its beginning to a time (s)."""

    system: System
    begin: Beginning
    stop: float


class Steps(NamedTuple):
    """ends (N+1,) s of the steps of a stretch, its start among them; which (N,) are leaps over singular positions; and
    breaks (s), at which something jumps."""

    ends: Real
    leap: Flags
    breaks: Real


class FollowedRun:
    """How the stretches of a run are followed.

    times (T,) s: output times of the run, from its start; expected: a number of steps.
    """

    def __init__(
        self, times: Real, settings: Settings, algorithm: Algorithm, stabilise: float, expected: int
    ) -> None:  # fmt: skip
        self._times, self._algorithm, self._stabilise = times, algorithm, stabilise
        self._settings = replace(settings, max_steps=settings.max_steps + ROOM)
        self._expected = expected

    def __call__(self, course: Iterable[Stretch], until: float) -> Iterator[PartialEnvelope]:
        """Extremes in all stretches, up to a time (s). DynamicsError where the motion cannot be followed."""
        for system, given, end in course:
            start, stop = max(given.state.t, float(self._times[0])), min(end, until)
            if not stop > start:
                continue
            begin = given._replace(y=given.y.copy(), memory=None)  # a restart's memory would end its first step later
            with integration(system, self._algorithm, self._stabilise, self._settings.integrator) as solve:
                steps = self._steps(solve, begin, stop)
                after = np.searchsorted(steps.ends, start, side="right")
                ends, leap = np.r_[start, steps.ends[after:]], steps.leap[after - 1 :]
                yield from self._parts(solve, begin, steps._replace(ends=ends, leap=leap))

    def _steps(self, solve: Integration, begin: Beginning, stop: float) -> Steps:
        """The steps of a stretch, recorded."""
        method, start, system = self._settings.integrator, begin.state.t, solve.system
        between = self._times[(self._times > start) & (self._times < stop)] if method.fixed else []
        times, room = np.array([start, *between, stop]), self._expected + ROOM
        while True:
            counts = np.zeros(COUNTS, np.int64)
            clock = clock_of(system, start, times, method.fixed, breaks=False)
            accuracy = self._settings.accuracy(system.nq, system.nu)
            y, clock, accuracy = solve.begin(begin._replace(y=begin.y.copy()), clock, accuracy, counts)
            posed, record = solve.recorded(room)
            out = np.empty((len(times), len(y)))
            given = y, clock, accuracy, out, counts, method.memory(len(y)), nothing_watched()
            run = method.entered(posed, *given)
            (status, t), interrupted = interruptible(
                lambda *given, run=run, posed=posed: run(posed, *given), given, counts[STOP : STOP + 1]
            )
            solve.ended(None)
            _check(solve, status, t, interrupted)
            count = int(record.count[0])
            if count <= room:
                break
            room = count + 1
        ends = np.minimum(record.time[:count], stop)
        distinct = np.r_[True, np.diff(ends) > 0.0]
        twice = np.flatnonzero(~distinct)
        ends, leap = ends[distinct], np.zeros(count, bool)
        leap[np.searchsorted(ends, record.time[twice])] = True
        inner = clock.segment_ends[(clock.segment_ends > start) & (clock.segment_ends < stop)]
        return Steps(ends, leap[1 : len(ends)], np.array([*np.unique(inner), stop]))

    def _parts(self, solve: Integration, begin: Beginning, steps: Steps) -> Iterator[PartialEnvelope]:
        """Extremes in groups of steps whose outputs are held at once; each group begins where the last one ended."""
        N, system = len(steps.ends) - 1, solve.system
        most = max(FEWEST, MEMORY // (sample_bytes(system) * (len(INSIDE) + 2)))
        for first in range(0, N, most):
            last = min(first + most, N)
            inside = (steps.breaks > steps.ends[first]) & (steps.breaks <= steps.ends[last])
            group = Steps(steps.ends[first : last + 1], steps.leap[first:last], steps.breaks[inside])
            panels = _fixed_panels(group) if self._settings.integrator.fixed else _panels(group)
            times = np.unique(np.concatenate([[begin.state.t], *(panel.ravel() for panel in panels)]))
            raw = integrate(solve, begin, times, self._settings, breaks=last < N, goes_on=True)
            _check(solve, raw.status, raw.t, raw.interrupted)
            yield from self._seen(solve, raw, times, panels, group)
            q_and_u = np.r_[raw.y[: system.nq + system.nu], 0.0]
            begin = Beginning(system.layout.known(raw.t, q_and_u), raw.y, None, raw.controllers)

    def _seen(
        self, solve: Integration, raw: Raw, times: Real, panels: list[Real], group: Steps
    ) -> Iterator[PartialEnvelope]:
        """Extremes in a group of steps, from the states (T,n) at times (T,) s."""
        tiny = 4.0 * slack(times[0], times[-1]) if solve.feedback is not None else 0.0
        before = np.minimum(np.nextafter(group.breaks, -np.inf), group.breaks - tiny)
        at_breaks = np.searchsorted(times, group.breaks)
        before = np.maximum(before, times[np.maximum(at_breaks - 1, 0)])  # a step may be as short as rounding
        order = np.argsort(np.r_[times, before], kind="stable")
        where = np.empty(len(order), np.int64)
        where[order] = np.arange(len(order))
        t, states = np.r_[times, before][order], np.vstack([raw.states, raw.states[at_breaks]])[order]
        run, known = self._observed(solve, raw, t, states)
        renumbered = np.cumsum(known) - 1
        steps, left_out = len(group.ends) - 1, int(np.sum(~known))
        for panel in panels:
            places = where[np.searchsorted(times, panel)]
            ends_at = np.searchsorted(group.breaks, panel[:, -1])
            jumps = np.isin(panel[:, -1], group.breaks)
            places[jumps, -1] = where[len(times) + ends_at[jumps]]
            whole = np.all(known[places], axis=1) & np.all(np.diff(t[places], axis=1) > 0.0, axis=1)
            yield part_of(run, renumbered[places[whole]], steps, left_out)
            steps = left_out = 0

    def _observed(self, solve: Integration, raw: Raw, t: Real, states: Real) -> tuple[Trajectory, Flags]:
        """The outputs at times t (T,) and states (T,n), and at which of them they could be evaluated."""
        known, done, whole = np.ones(len(t), bool), 0, None
        while done < len(t):
            rest = raw._replace(states=states[done:])
            part = observed(solve.system, t[done:], rest, self._algorithm, solve)
            if part.status is Status.INTERRUPTED:
                raise KeyboardInterrupt
            whole = part if whole is None else _after(whole, part)
            done += len(part.t)
            known[done : done + 1] = False
            done += 1
        assert whole is not None  # there is at least one time
        return whole, known


def _after(first: Trajectory, later: Trajectory) -> Trajectory:
    return joined(first, later) if len(later.t) else first


def _panels(group: Steps) -> list[Real]:
    """Times (P,k) of the points of steps; loads are not known within a leap."""
    start, end = group.ends[:-1, None], group.ends[1:, None]
    s = np.array([0.0, *INSIDE, 1.0])
    every = start + s * (end - start)
    every[:, -1:] = end  # not as rounded
    distinct = np.all(np.diff(every, axis=1) > 0.0, axis=1) & ~group.leap
    return [part for part in (every[distinct], every[~distinct][:, [0, -1]]) if len(part)]


def _fixed_panels(group: Steps) -> list[Real]:
    """Times (P,k) of the ends of a few steps in a row, between which nothing jumps."""
    edges = np.unique([0, *np.searchsorted(group.ends, group.breaks), len(group.ends) - 1])
    rows = dict[int, list[Index]]()
    for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        for i in range(a, b, TOGETHER):
            row = np.arange(i, min(i + TOGETHER, b) + 1)
            rows.setdefault(len(row), []).append(row)
    return [group.ends[np.array(row)] for row in rows.values()]


def _check(solve: Integration, status: int, t: float, interrupted: bool) -> None:
    if interrupted:
        raise KeyboardInterrupt
    if status != OK:
        error = DynamicsError(f"the run for the envelope {ending(solve.system, Status(status), solve.fault, t)}")
        error.status = Status(status)
        raise error
