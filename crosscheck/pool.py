"""A small process pool that survives its workers: jobs go out over pipes, events come back as they happen.

Each worker is a fresh ("spawn") process; one that dies takes only its job with it and is replaced. The standard pools
fail as a whole when a process is killed, which an engine's crash in C++ does.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, Literal

THREAD_LIMITS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
STDOUT, STDERR = 1, 2

Function = Callable[[Any, Callable[[Any], None]], None]


@dataclass(frozen=True)
class Event:
    """What happened to job number `job`: it started, emitted `content`, ended, or crashed (`content` says how)."""

    job: int
    kind: Literal["started", "emitted", "ended", "crashed"]
    content: Any = None


@dataclass
class _Worker:
    process: BaseProcess
    pipe: Connection
    job: int | None = None
    kind: str = ""


def run_jobs(
    function: Function, jobs: Sequence[Any], workers: int, log: str, kind: Callable[[Any], str] = lambda job: ""
) -> Iterator[Event]:
    """Run `function(job, emit)` for every job in `workers` processes; events in the order in which they come.

    `function` must be importable by name. `kind(job)` names what a worker has to load or compile for a job: workers
    stay with their kind while there are jobs of it, and only one is at a kind until its first job is done, so that what
    that job leaves in caches on disk is not made twice. Whatever workers print goes to the file `log`. Numerical
    libraries get one thread per worker. Closing the iterator early stops the workers.

    `jobs` may grow while its events are read: what an event brings to light can ask for more jobs.
    """
    kinds: list[str] = []
    waiting: list[int] = []
    prepared: set[str] = set()
    crew: list[_Worker] = []
    try:
        while len(kinds) < len(jobs) or waiting or any(worker.job is not None for worker in crew):
            waiting += range(len(kinds), len(jobs))
            kinds += [kind(job) for job in jobs[len(kinds) :]]
            crew += [_start(function, log) for _ in range(min(workers, len(kinds)) - len(crew))]
            for worker in crew:
                if worker.job is None and (job := _next_job(worker, crew, waiting, kinds, prepared)) is not None:
                    yield _hand_out(worker, job, jobs, kinds)
            busy = [worker for worker in crew if worker.job is not None]
            ready = wait([worker.pipe for worker in busy])
            for worker in [each for each in busy if each.pipe in ready]:
                event = _receive(worker)
                yield event
                if event.kind == "crashed":
                    crew[crew.index(worker)] = _start(function, log)
                elif event.kind == "ended":
                    worker.job = None
                    prepared.add(worker.kind)
    finally:
        for worker in crew:
            worker.pipe.close()
            worker.process.terminate()
            worker.process.join()


def _start(function: Function, log: str) -> _Worker:
    """A new worker; the thread limits are set in the environment it inherits, before it imports anything."""
    context = get_context("spawn")
    here, there = context.Pipe()
    before = {name: os.environ.get(name) for name in THREAD_LIMITS}
    os.environ.update(dict.fromkeys(THREAD_LIMITS, "1"))
    process = context.Process(target=_serve, args=(there, function, log), daemon=True)
    try:
        process.start()
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
    there.close()
    return _Worker(process, here)


def _next_job(
    worker: _Worker, crew: list[_Worker], waiting: list[int], kinds: list[str], prepared: set[str]
) -> int | None:
    """Take the first waiting job of the worker's own kind, else of a kind nobody is at, else of a prepared kind."""
    taken = {other.kind for other in crew if other is not worker and other.job is not None}
    open_jobs = [job for job in waiting if kinds[job] in prepared or kinds[job] not in taken]
    if not open_jobs:
        return None
    chosen = min(open_jobs, key=lambda job: (kinds[job] != worker.kind, kinds[job] in taken, job))
    waiting.remove(chosen)
    return chosen


def _hand_out(worker: _Worker, job: int, jobs: Sequence[Any], kinds: list[str]) -> Event:
    worker.job, worker.kind = job, kinds[job]
    with suppress(BrokenPipeError):  # a worker that died before its first job is reported when it is read
        worker.pipe.send(jobs[job])
    return Event(job, "started")


def _receive(worker: _Worker) -> Event:
    assert worker.job is not None
    try:
        kind, content = worker.pipe.recv()
    except (EOFError, ConnectionResetError):
        worker.process.join()
        return Event(worker.job, "crashed", f"the worker process died (exit code {worker.process.exitcode})")
    return Event(worker.job, kind, content)


def _serve(pipe: Connection, function: Function, log: str) -> None:
    """A worker's life: jobs in, events out, until the pipe closes."""
    with open(log, "ab", buffering=0) as stream:
        os.dup2(stream.fileno(), STDOUT)
        os.dup2(stream.fileno(), STDERR)
    with suppress(EOFError):
        while True:
            job = pipe.recv()
            function(job, lambda content: pipe.send(("emitted", content)))
            pipe.send(("ended", None))
