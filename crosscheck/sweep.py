"""Running many jobs: plan them, leave out what is already recorded, run the rest in a pool, record as results come.

`run_jobs` of `pool` is the local scheduler; any function with its signature can take its place.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from crosscheck.engines.registry import COMPILED_LIKE
from crosscheck.execute import execute
from crosscheck.library import Case
from crosscheck.plan import Job, plan
from crosscheck.pool import Event, run_jobs
from crosscheck.records import Archive, Record, RunRecord, environment, read

PROVIDER = "crosscheck.engines.registry:engines"
Listener = Callable[[Sequence[Job], Event], None]


def sweep(
    cases: Iterable[Case],
    asked: tuple[str, ...],
    records: Path,
    *,
    fresh: bool = False,
    workers: int | None = None,
    provider: str = PROVIDER,
    listener: Listener = lambda jobs, event: None,
) -> None:
    """Run cases and append to the file `records`; what it already holds of the same scenes is kept unless `fresh`.

    `asked` are the engines (none: all), `workers` the number of processes (default: one per core). `listener` hears
    every event, with the list of jobs.
    """
    if fresh:
        records.unlink(missing_ok=True)
    known = read(records) if records.exists() else []
    plans = [plan(case, asked, provider) for case in cases]
    jobs = [replace(job, done=_done(known, job)) for _, planned in plans for job in planned]
    archive = Archive(records)
    try:
        archive.write(environment())
        for record, _ in plans:
            archive.write(record)
        log = str(records.with_suffix(".log"))
        for event in run_jobs(execute, jobs, workers or os.cpu_count() or 1, log, kind=_engine):
            if isinstance(event.content, RunRecord):
                archive.write(event.content)
            elif event.kind == "crashed":
                archive.write(_crash(jobs[event.job], event.content))
            listener(jobs, event)
    finally:
        archive.close()


def _engine(job: Job) -> str:
    """A worker stays with its engine: each loads its library, or compiles its kernels, once."""
    return COMPILED_LIKE.get(job.engine, job.engine)


def _done(known: Sequence[Record], job: Job) -> frozenset[tuple[str, str, int, int]]:
    """Efforts of the job, with version and place in the ladder, whose outcome is already known for the same scene.

    A later record without an effort (missing engine, crash) withdraws the earlier ones.
    """
    done: set[tuple[str, str, int, int]] = set()
    for record in known:
        if not isinstance(record, RunRecord) or record.key[:4] != (job.case, job.variant, job.role, job.engine):
            continue
        if not record.effort:
            done.clear()
        elif record.status in ("finished", "diverged") and record.scene == job.scene_id:
            done.add((record.effort, record.version, record.rung, record.rungs))
    return frozenset(done)


def _crash(job: Job, how: str) -> RunRecord:
    return RunRecord(
        case=job.case,
        variant=job.variant,
        role=job.role,
        engine=job.engine,
        version="",
        scene=job.scene_id,
        status="failed",
        message=how,
    )
