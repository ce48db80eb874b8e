"""The pool: every job is answered, a worker's death costs only its job, threads are limited, nothing is printed."""

import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest

from crosscheck.running.pool import run_jobs
from crosscheck.running.scheduler import Event, Work
from crosscheck.running.worker import LOG_LIMIT_BYTES, TICK_S, memory_limit


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
    events = list(run_jobs(Work(work, jobs, str(log), 2)))
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


def misbehave(job: str, emit: Callable[[object], None]) -> None:
    match job:
        case "hang":
            time.sleep(3600.0)
        case "eat":
            kept = []
            while True:
                kept.append(bytearray(2**25))
                time.sleep(0.002)
        case "raise":
            raise RuntimeError("a fault of the function itself")
        case "unreadable":
            emit(Unreadable())
        case "unsendable":
            emit(lambda: None)
        case "flood":
            for _ in range(300):
                os.write(1, b"x" * 2**20)
            time.sleep(3 * TICK_S)
    emit(job)


class Unreadable:
    """Cannot be made again where it arrives."""

    def __reduce__(self) -> tuple[object, ...]:
        return int, ("no number",)


@pytest.mark.parametrize(
    ("job", "kind", "words"),
    [
        ("hang", "stopped", "at its limit of 2 s"),
        ("eat", "stopped", "GB of memory where 0.4 GB are its part"),
        ("raise", "crashed", "RuntimeError ended the worker process: a fault of the function itself"),
        ("unreadable", "crashed", "sent what cannot be read (ValueError)"),
        ("unsendable", "crashed", "ended the worker process"),
    ],
)
def test_a_job_that_does_not_end_well_is_ended_and_the_others_go_on(
    tmp_path: Path, job: str, kind: str, words: str
) -> None:
    limit = {"hang": 2.0}
    events = list(
        run_jobs(
            Work(
                misbehave, [job, "good"], str(tmp_path / "log"), 1,
                time_limit_s=lambda job: limit.get(job, 60.0), memory_limit_bytes=0.4e9,
            )
        )
    )  # fmt: skip
    last = outcome(events, 0)[-1]
    assert (last[0], words in str(last[1])) == (kind, True), last
    assert outcome(events, 1)[-1] == ("ended", None)


def test_a_log_does_not_grow_without_bound(tmp_path: Path) -> None:
    log = tmp_path / "log"
    list(run_jobs(Work(misbehave, ["flood"], str(log), 1)))
    assert log.stat().st_size <= LOG_LIMIT_BYTES


def test_nothing_that_one_kind_leaves_in_its_process_reaches_another(tmp_path: Path) -> None:
    """The first job of each kind changes the folder, which the second of the same kind finds changed."""
    jobs = [("one", 0), ("one", 1), ("two", 0), ("two", 1)]
    events = run_jobs(Work(wander, jobs, str(tmp_path / "log"), 1, lambda job: job[0]))
    places = [event.content for event in events if event.kind == "emitted"]
    assert places == [os.getcwd(), "/", os.getcwd(), "/"]


def wander(job: tuple[str, int], emit: Callable[[object], None]) -> None:
    emit(os.getcwd())
    os.chdir("/")


def test_memory_of_the_machine_is_shared_out() -> None:
    assert memory_limit(1) == pytest.approx(4 * memory_limit(4))
    assert 0 < memory_limit(1) < psutil.virtual_memory().total


def test_no_jobs_no_workers(tmp_path: Path) -> None:
    assert list(run_jobs(Work(work, [], str(tmp_path / "log"), 2))) == []


def whoami(job: tuple[str, int], emit: Callable[[object], None]) -> None:
    emit(os.getpid())


def test_workers_stay_with_their_kind(tmp_path: Path) -> None:
    """Two workers, two kinds in turn: a process leaves its kind only when no job of it is left, so at most once."""
    jobs = [(kind, number) for number in range(4) for kind in ("one", "two")]
    events = run_jobs(Work(whoami, jobs, str(tmp_path / "log"), 2, lambda job: job[0]))
    done: dict[object, list[str]] = {}
    for event in events:
        if event.kind == "emitted":
            done.setdefault(event.content, []).append(jobs[event.job][0])
    assert {kinds[0] for kinds in done.values()} == {"one", "two"}
    for kinds in done.values():
        assert sum(a != b for a, b in zip(kinds, kinds[1:], strict=False)) <= 1


def test_only_one_worker_is_at_a_kind_until_its_first_job_is_done(tmp_path: Path) -> None:
    jobs = [("one", 0), ("one", 1), ("one", 2)]
    events = list(run_jobs(Work(whoami, jobs, str(tmp_path / "log"), 2, lambda job: job[0])))
    order = [(event.kind, event.job) for event in events if event.kind in ("started", "ended")]
    assert order[:2] == [("started", 0), ("ended", 0)]
    assert sorted(order[2:]) == [("ended", 1), ("ended", 2), ("started", 1), ("started", 2)]
