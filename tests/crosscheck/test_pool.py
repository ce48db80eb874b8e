"""The pool: every job is answered, a worker's death costs only its job, threads are limited, nothing is printed."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path

from crosscheck.pool import Event, run_jobs


def work(job: str, emit: Callable[[object], None]) -> None:
    emit(f"{job} begun")
    match job:
        case "die":
            os._exit(7)
        case "print":
            print("from Python")
            sys.stdout.flush()
            os.write(1, b"from C\n")
        case "threads":
            emit(os.environ["OPENBLAS_NUM_THREADS"])


def outcome(events: list[Event], job: int) -> list[tuple[str, object]]:
    return [(event.kind, event.content) for event in events if event.job == job]


def test_every_job_is_answered_and_a_crash_costs_only_its_own(tmp_path: Path) -> None:
    jobs = ["good", "die", "better", "die", "best", "print", "threads"]
    log = tmp_path / "log"
    before = os.environ.get("OPENBLAS_NUM_THREADS")
    events = list(run_jobs(work, jobs, 2, str(log)))
    for number, job in enumerate(jobs):
        last = outcome(events, number)[-1]
        if job == "die":
            assert last == ("crashed", "the worker process died (exit code 7)")
        else:
            assert last == ("ended", None)
        assert ("emitted", f"{job} begun") in outcome(events, number)
    assert ("emitted", "1") in outcome(events, jobs.index("threads"))
    assert log.read_text(encoding="utf-8") == "from Python\nfrom C\n"
    assert os.environ.get("OPENBLAS_NUM_THREADS") == before


def test_no_jobs_no_workers(tmp_path: Path) -> None:
    assert list(run_jobs(work, [], 2, str(tmp_path / "log"))) == []


def whoami(job: tuple[str, int], emit: Callable[[object], None]) -> None:
    emit(os.getpid())


def test_workers_stay_with_their_kind(tmp_path: Path) -> None:
    """Two workers, two kinds in turn: a process leaves its kind only when no job of it is left, so at most once."""
    jobs = [(kind, number) for number in range(4) for kind in ("one", "two")]
    events = run_jobs(whoami, jobs, 2, str(tmp_path / "log"), kind=lambda job: job[0])
    done: dict[object, list[str]] = {}
    for event in events:
        if event.kind == "emitted":
            done.setdefault(event.content, []).append(jobs[event.job][0])
    assert {kinds[0] for kinds in done.values()} == {"one", "two"}
    for kinds in done.values():
        assert sum(a != b for a, b in zip(kinds, kinds[1:], strict=False)) <= 1


def test_only_one_worker_is_at_a_kind_until_its_first_job_is_done(tmp_path: Path) -> None:
    jobs = [("one", 0), ("one", 1), ("one", 2)]
    events = list(run_jobs(whoami, jobs, 2, str(tmp_path / "log"), kind=lambda job: job[0]))
    order = [(event.kind, event.job) for event in events if event.kind in ("started", "ended")]
    assert order[:2] == [("started", 0), ("ended", 0)]
    assert sorted(order[2:]) == [("ended", 1), ("ended", 2), ("started", 1), ("started", 2)]
