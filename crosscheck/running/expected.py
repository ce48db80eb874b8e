"""Estimates of how long jobs will take, from how long they took last time."""

from __future__ import annotations

from collections.abc import Iterable

from crosscheck.records.kinds import RunRecord
from crosscheck.running.rung import repeats_of

BESIDES_S = 0.05  # of a job besides its runs: reading it, packing and sending its results


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
    """An estimate of the remaining time, scaled by the time that the jobs ended so far have taken.

    So the number of parallel jobs and the share of recorded runs need not be known. A job without a known time counts
    as an average one.
    """

    def __init__(self) -> None:
        self._open: dict[int, float] = {}
        self._done = 0.0

    def expect(self, jobs: Iterable[tuple[int, float | None]]) -> None:
        """Add jobs by number, with their expected seconds."""
        given = list(jobs)
        known = [seconds for _, seconds in given if seconds is not None]
        average = sum(known) / len(known) if known else 1.0
        self._open |= {number: average if seconds is None else seconds for number, seconds in given}

    def ended(self, job: int) -> None:
        """A job has ended in some way."""
        self._done += self._open.pop(job)

    def seconds(self, elapsed_s: float) -> float | None:
        """Seconds to the end, `elapsed_s` after the beginning; None before anything has ended."""
        return elapsed_s * sum(self._open.values()) / self._done if self._done else None
