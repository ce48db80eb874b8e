"""Running cases: plan their jobs, leave out what is recorded already, run the rest and record every result."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import TypedDict, Unpack

import msgspec

from crosscheck.engines.answers import clean
from crosscheck.engines.registry import PROVIDER, SERVED_WITH
from crosscheck.library.find import Case
from crosscheck.records.archive import Archive, read
from crosscheck.records.contracts import contracts
from crosscheck.records.kinds import CaseRecord, ChartRecord, Confirmed, Record, RunRecord
from crosscheck.records.machine import environment
from crosscheck.running.charting import blank, work
from crosscheck.running.expected import expected_seconds
from crosscheck.running.job import Done, Job
from crosscheck.running.plan import plan
from crosscheck.running.pool import run_jobs
from crosscheck.running.scheduler import BY_DEFAULT, Event, Limits, Scheduler, Work

Listener = Callable[[Sequence[Job], Event], None]
FollowUp = Callable[[CaseRecord, Sequence[Job], Sequence[Record]], Sequence[Job]]
"""Further jobs of a case, from its jobs and what all of them have recorded."""


class How(TypedDict, total=False):
    """Options of `run_planned` that `sweep` has too."""

    fresh: bool
    scheduler: Scheduler
    listener: Listener
    follow: FollowUp


def sweep(
    cases: Iterable[Case],
    asked: tuple[str, ...],
    records: Path,
    *,
    provider: str = PROVIDER,
    limits: Limits = BY_DEFAULT,
    **how: Unpack[How],
) -> None:
    """Run cases, with the runs for their animations, and append to the file `records`.

    Recorded runs with the same scene, effort and `made_by` are confirmed and not repeated, unless `fresh`. `asked` are
    the engines (none: all). An engine that exceeds one of the `limits` on a scene is stopped; a case may have its own
    time limit. `listener` is called with the list of jobs and every event. After Ctrl-C or an error of the scheduler
    the records are valid, and the next call continues from there.
    """
    plans = [plan(case, asked, provider, limits.time_s, films=True) for case in cases]
    run_planned(plans, asked, records, limits=limits, **how)


def run_planned(
    plans: Sequence[tuple[CaseRecord, list[Job]]],
    asked: tuple[str, ...],
    records: Path,
    *,
    fresh: bool = False,
    limits: Limits = BY_DEFAULT,
    scheduler: Scheduler = run_jobs,
    listener: Listener = lambda jobs, event: None,
    follow: FollowUp = lambda case, jobs, records: (),
) -> None:
    """Run planned jobs, as `sweep` does; when all jobs of a case have ended, those that `follow` gives of it too."""
    if fresh:
        records.unlink(missing_ok=True)
    known = read(records) if records.exists() else []
    took = expected_seconds(known)
    jobs = [
        replace(job, done=_done(known, job), expected_s=took.get(job.work)) for _, planned in plans for job in planned
    ]
    whole = Work(
        work, jobs, str(records.with_suffix(".log")), limits.workers, library, _time_limit, limits.memory_bytes
    )
    doing: dict[int, str] = {}
    found = _RecordsOfCases(plans, known)
    with (
        closing(Archive(records)) as archive,
        closing(scheduler(whole)) as events,
    ):
        here = environment(tuple(record.case for record, _ in plans), asked, confirms=True)
        archive.write(msgspec.structs.replace(here, contracts=contracts(records.parent, (job.engine for job in jobs))))
        for record, _ in plans:
            archive.write(record)
        for event in events:
            if isinstance(event.content, RunRecord | ChartRecord | Confirmed):
                archive.write(event.content)
                found.add(event.content)
            elif event.kind == "emitted":
                doing[event.job] = event.content
            elif event.kind in ("crashed", "stopped"):
                event = replace(event, content=f"{event.content}, while at {doing.get(event.job, 'its start')}")
                cut = _cut_short(jobs[event.job], event)
                archive.write(cut)
                found.add(cut)
            listener(jobs, event)
            ended = event.kind in ("ended", "crashed", "stopped") and found.end(jobs[event.job])
            if ended:
                jobs += follow(*ended)


class _RecordsOfCases:
    """What the jobs of each case have recorded or confirmed, until all of them have ended."""

    def __init__(self, plans: Sequence[tuple[CaseRecord, list[Job]]], known: Sequence[Record]) -> None:
        self._cases = {record.case: (record, planned) for record, planned in plans}
        self._left = Counter(job.case for _, planned in plans for job in planned)
        self._known = [record for record in known if isinstance(record, RunRecord)]
        self._charted = [record for record in known if isinstance(record, ChartRecord)]
        self._records: dict[str, list[Record]] = {}

    def add(self, record: RunRecord | ChartRecord | Confirmed) -> None:
        """Note a record; of one that confirms others these, as they are."""
        own = self._records.setdefault(record.case, [])
        if isinstance(record, Confirmed):
            key = (record.variant, record.role, record.engine, record.scene, record.made_by)
            own += [
                run
                for run in self._known
                if run.case == record.case
                and (run.variant, run.role, run.engine, run.scene, run.made_by) == key
            ]
        else:
            own.append(record)

    def end(self, job: Job) -> tuple[CaseRecord, list[Job], list[Record]] | None:
        """A job has ended: what its case has found if it was the last one, with earlier runs for its charts."""
        self._left[job.case] -= 1
        if self._left[job.case] or job.case not in self._cases:
            return None
        record, planned = self._cases.pop(job.case)
        earlier = [record for record in self._charted if record.case == job.case]
        return record, planned, [*earlier, *self._records.pop(job.case, [])]


def library(job: Job) -> str:
    """The kind of a job: a worker serves one library, so that it is loaded and its kernels are compiled once."""
    return SERVED_WITH.get(job.engine, job.engine)


def _time_limit(job: Job) -> float:
    return job.time_limit_s


def _done(known: Sequence[Record], job: Job) -> frozenset[Done]:
    """Recorded outcomes of the job's efforts for the same scene.

    A later record without an effort (missing engine, crash) invalidates the earlier ones, and one of the same effort
    replaces it, as where it is judged: it may be another rung of another ladder.
    """
    done: dict[str, Done] = {}
    for record in known:
        if not isinstance(record, RunRecord) or record.key[:4] != (job.case, job.variant, job.role, job.engine):
            continue
        if not record.effort:
            done.clear()
            continue
        done.pop(record.effort, None)
        if record.status in ("finished", "diverged") and record.scene == job.scene_id:
            done[record.effort] = Done(record.effort, record.made_by, record.rung, record.rungs)
    return frozenset(done.values())


def _cut_short(job: Job, event: Event) -> RunRecord | ChartRecord:
    if job.charted is not None:
        return msgspec.structs.replace(blank(job), message=clean(f"{event.status_of_end}: {event.content}"))
    return msgspec.structs.replace(job.blank, status=event.status_of_end, message=clean(event.content))
