"""Estimates of how long jobs will take, from how long they took last time, or from how long their like takes now."""

from __future__ import annotations

from collections.abc import Iterable

from crosscheck.engines.registry import OWN_CODE
from crosscheck.records.kinds import RunRecord
from crosscheck.running.rung import repeats_of

BESIDES_S = 0.05  # of a job besides its runs: reading it, packing and sending its results
LIKE = 2  # ended jobs of an engine from which the time of its others is estimated: the first one also loads it
OTHER_CODES = (
    6.0  # times as long as ours a job of another code takes; 4.9 s and 0.8 s on average in the canonical cases
)
SEEN = 0.1  # share of the work that must be done before an estimate, and that counts as "as long as last time"


def expected_seconds(records: Iterable[object]) -> dict[tuple[str, ...], float]:
    """Seconds by case, variant, role and engine: the latest compilation and the latest run of every effort."""
    latest = {record.key: record for record in records if isinstance(record, RunRecord)}
    compiling: dict[tuple[str, ...], float] = {}
    running: dict[tuple[str, ...], float] = {}
    for (*work, _), record in latest.items():
        repeats = repeats_of(record.wall_s) if record.status == "finished" else 1
        compiling[tuple(work)] = max(compiling.get(tuple(work), 0.0), record.compile_s)
        running[tuple(work)] = running.get(tuple(work), BESIDES_S) + repeats * record.wall_s
    return {work: compiling[work] + seconds for work, seconds in running.items()}


class Remaining:
    """An estimate of the remaining time: the work of the open jobs, at the pace at which work has been done so far.

    A job counts with the seconds that it took last time, scaled by how much longer the ended jobs took than theirs. One
    never recorded counts as the mean of the ended jobs of its engine, for engines differ more than cases do. As
    long as nothing is known of an engine, it counts as `OTHER_CODES` of our own jobs, or as one if it is our own. There
    is no estimate before the share `SEEN` of the work is done: it would tell how long it takes to start.
    """

    def __init__(self) -> None:
        self._open: dict[int, tuple[str, float | None]] = {}  # engine and expected seconds
        self._started: dict[int, float] = {}
        self._took: dict[str, list[float]] = {}  # by engine
        self._all_expected = self._known_took = self._known_expected = 0.0

    def expect(self, jobs: Iterable[tuple[int, str, float | None]]) -> None:
        """Add jobs by number, with their engine and their expected seconds."""
        for number, engine, seconds in jobs:
            self._open[number] = engine, seconds
            self._all_expected += seconds or 0.0

    def started(self, job: int, at_s: float) -> None:
        """A job has started, `at_s` after the beginning."""
        self._started[job] = at_s

    def ended(self, job: int, at_s: float) -> None:
        """A job has ended in some way."""
        engine, expected = self._open.pop(job)
        took = at_s - self._started.pop(job)
        self._took.setdefault(engine, []).append(took)
        if expected is not None:
            self._known_took += took
            self._known_expected += expected

    def seconds(self, at_s: float) -> float | None:
        """Seconds to the end; None as long as they cannot be estimated."""
        left = sum(max(self._whole(*job) - self._running_s(number, at_s), 0.0) for number, job in self._open.items())
        done = sum(map(sum, self._took.values()))
        if not self._took or done < SEEN * (done + left):
            return None
        busy = done + sum(self._running_s(number, at_s) for number in self._started)
        return left * at_s / busy if busy else None

    def _whole(self, engine: str, expected: float | None) -> float:
        """The estimated seconds of a job from its start to its end."""
        if expected is not None:
            before = SEEN * self._all_expected
            return expected * (self._known_took + before) / (self._known_expected + before)
        like = self._took.get(engine, [])
        if len(like) >= LIKE:
            return sum(like[1:]) / len(like[1:])
        weights = {name: 1.0 if name in OWN_CODE else OTHER_CODES for name in (*self._took, engine)}
        work = sum(weights[name] * len(took) for name, took in self._took.items())
        return weights[engine] * sum(map(sum, self._took.values())) / work if work else 0.0

    def _running_s(self, job: int, at_s: float) -> float:
        return at_s - self._started.get(job, at_s)
