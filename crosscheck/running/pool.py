"""A small process pool that survives its workers: jobs go out over pipes, events come back as they happen.

Each worker is a fresh ("spawn") process in a session of its own; one that dies takes only its job with it. A worker
serves one kind of jobs, so that nothing which an engine leaves behind in its process (folder, environment, warnings,
threads) reaches another engine. A job that exceeds its time or its worker its memory is stopped, and whatever the
worker started ends with it.

Why not a pool from a library: the standard pools and loky fail as a whole when a process is killed, which an engine's
crash in C++ does, and have no limit of time. Pebble (5.2) has one and survives the death of a worker, but it gives a
job to whichever worker comes first (kernels would be compiled once a worker and engines would share processes), hands
out one result a job (here every effort is recorded as it ends, so that a killed run loses nothing), watches no memory,
and ends a worker without what that started. What a library does carry, processes and their memory, is psutil's.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from math import inf
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, Literal

from crosscheck.running.processes import end, memory_limit, memory_of

TIME_LIMIT_S = 1800.0  # of a job, unless it is given; the longest of the shipped cases' takes 14 s, compilation apart
START_LIMIT_S = 120.0  # for a worker to start and to read its job
TICK_S = 0.25
LOG_LIMIT_BYTES = 64 * 2**20
THREAD_LIMITS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
KERNELS = "FLEXMB_KERNELS"  # flexmb's, which compiles for what a scene contains unless it is "general"
STDIN, STDOUT, STDERR = 0, 1, 2

Function = Callable[[Any, Callable[[Any], None]], None]


@dataclass(frozen=True)
class Limits:
    """What running many jobs may take; None leaves it to the machine, to the case or to `TIME_LIMIT_S`.

    `workers` is the number of processes (by default one per core), `time_s` how long a job may take, and `memory_bytes`
    how much a worker may hold (by default an equal part of what the machine has).
    """

    workers: int | None = None
    time_s: float | None = None
    memory_bytes: float | None = None

    @property
    def processes(self) -> int:
        """How many workers there are."""
        return self.workers or os.cpu_count() or 1


BY_DEFAULT = Limits()


@dataclass(frozen=True)
class Event:
    """What happened to job number `job`: it started, emitted `content`, ended, crashed or was stopped at a limit.

    Of the last two `content` says how.
    """

    job: int
    kind: Literal["started", "emitted", "ended", "crashed", "stopped"]
    content: Any = None


@dataclass
class _Worker:
    """A place in the crew, with a process once it has had a job."""

    process: BaseProcess | None = None
    pipe: Connection | None = None
    job: int | None = None
    kind: str = ""
    deadline: float = inf
    limit_s: float = inf

    @property
    def pid(self) -> int:
        """Of its process, 0 where it has none."""
        return 0 if self.process is None else self.process.pid or 0


def run_jobs(
    function: Function,
    jobs: Sequence[Any],
    workers: int,
    log: str,
    kind: Callable[[Any], str] = lambda job: "",
    time_limit_s: Callable[[Any], float] = lambda job: TIME_LIMIT_S,
    memory_limit_bytes: float | None = None,
) -> Iterator[Event]:
    """Run `function(job, emit)` for every job in `workers` processes; events in the order in which they come.

    `function` must be importable by name. `kind(job)` names what a worker has to load or compile for a job: workers
    stay with their kind while there are jobs of it. Only one worker is at a kind until its first job is done, so that
    what that job compiles and leaves on disk is not compiled twice. Whatever workers print goes to the file `log`,
    which starts again when it becomes too long. Numerical libraries get one thread per worker, and flexmb
    compiles general kernels where FLEXMB_KERNELS says nothing: a session has dozens of scenes, and kernels made for one
    serve few others. Closing the iterator early stops the workers.

    A job is stopped after `time_limit_s(job)`, or when its worker with all that this started holds more memory than
    `memory_limit_bytes` (by default an equal part of what the machine has).

    `jobs` may grow while its events are read: what an event brings to light can ask for more jobs.
    """
    kinds: list[str] = []
    waiting: list[int] = []
    prepared: set[str] = set()
    memory_bytes = memory_limit_bytes or memory_limit(workers)
    watched = time.monotonic()
    crew = [_Worker() for _ in range(workers)]
    try:
        while len(kinds) < len(jobs) or waiting or any(worker.job is not None for worker in crew):
            waiting += range(len(kinds), len(jobs))
            kinds += [kind(job) for job in jobs[len(kinds) :]]
            for worker in crew:
                if worker.job is None and (job := _next_job(worker, crew, waiting, kinds, prepared)) is not None:
                    _hand_out(worker, job, jobs, kinds, function, log)
                    worker.limit_s = time_limit_s(jobs[job])
                    yield Event(job, "started")
            busy = [worker for worker in crew if worker.job is not None]
            ready = wait([worker.pipe for worker in busy if worker.pipe is not None], TICK_S)
            held: dict[int, int] = {}
            if time.monotonic() > watched + TICK_S:
                held, watched = memory_of(pid for worker in busy if (pid := worker.pid)), time.monotonic()
                _keep_short(log)
            for worker in busy:
                event = _receive(worker) if worker.pipe in ready else _watch(worker, held, memory_bytes)
                if event is None:
                    continue
                if event.kind != "emitted":
                    worker.job = None
                if event.kind in ("crashed", "stopped"):
                    _dismiss(worker)
                elif event.kind == "ended":
                    prepared.add(worker.kind)
                yield event
    finally:
        for worker in crew:
            _dismiss(worker)


def _start(worker: _Worker, function: Function, log: str) -> None:
    """Give a worker a process; the thread limits are set in the environment it inherits, before it imports anything."""
    context = get_context("spawn")
    here, there = context.Pipe()
    its_own = dict.fromkeys(THREAD_LIMITS, "1") | {KERNELS: os.environ.get(KERNELS, "general")}
    before = {name: os.environ.get(name) for name in its_own}
    os.environ.update(its_own)
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
    worker.process, worker.pipe = process, here


def _dismiss(worker: _Worker) -> None:
    """End a worker's process and all that it started."""
    if worker.process is not None and worker.pipe is not None:
        worker.pipe.close()
        end(worker.process)
    worker.process = worker.pipe = None


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


def _hand_out(
    worker: _Worker, job: int, jobs: Sequence[Any], kinds: list[str], function: Function, log: str
) -> None:
    """Send a job to a worker; it gets a new process if it has none alive, or one that served another kind."""
    if worker.process is None or worker.kind != kinds[job] or not worker.process.is_alive():
        _dismiss(worker)
        _start(worker, function, log)
    worker.job, worker.kind = job, kinds[job]
    worker.deadline = time.monotonic() + START_LIMIT_S
    assert worker.pipe is not None
    with suppress(BrokenPipeError):  # a worker that died before its first job is reported when it is read
        worker.pipe.send(jobs[job])


def _receive(worker: _Worker) -> Event | None:
    """What a worker says; None where it says that it has begun, from when its time counts."""
    assert worker.job is not None and worker.pipe is not None
    try:
        kind, content = worker.pipe.recv()
    except (EOFError, OSError):
        return _death(worker)
    except Exception as error:  # what an engine wrote into the pipe, or an object that cannot be made here
        return Event(worker.job, "crashed", f"the worker process sent what cannot be read ({type(error).__name__})")
    if kind == "begun":
        worker.deadline = time.monotonic() + worker.limit_s
        return None
    return Event(worker.job, kind, content)


def _watch(worker: _Worker, held: dict[int, int], memory_bytes: float) -> Event | None:
    """The event that ends the job of a silent worker that is dead or exceeds a limit; None where it is just at work."""
    assert worker.job is not None and worker.process is not None and worker.pipe is not None
    if time.monotonic() > worker.deadline:
        return Event(worker.job, "stopped", f"it was stopped at its limit of {worker.limit_s:g} s")
    memory = held.get(worker.pid, 0)
    if memory > memory_bytes:
        sizes = f"{memory / 1e9:.3g} GB of memory where {memory_bytes / 1e9:.3g} GB are its part"
        return Event(worker.job, "stopped", f"it was stopped when it held {sizes}; fewer --jobs leave more to each")
    if not worker.process.is_alive() and not worker.pipe.poll():  # what it started may hold its pipe open
        return _death(worker)
    return None


def _death(worker: _Worker) -> Event:
    assert worker.job is not None and worker.process is not None
    patience = time.monotonic() + TICK_S
    while worker.process.exitcode is None and time.monotonic() < patience:  # `join` waits for ever if it lives on
        time.sleep(0.01)
    code = worker.process.exitcode
    how = "closed its pipe" if code is None else f"died (exit code {code})"
    return Event(worker.job, "crashed", f"the worker process {how}")


def _keep_short(log: str) -> None:
    """Empty a log that has become too long; workers append, so they go on at its new end."""
    with suppress(OSError):
        if os.path.getsize(log) > LOG_LIMIT_BYTES:
            os.truncate(log, 0)


def _serve(pipe: Connection, function: Function, log: str) -> None:
    """A worker's life: jobs in, events out, until the pipe closes or the parent is gone."""
    if hasattr(os, "setsid"):
        os.setsid()  # Ctrl-C is for the parent, which ends its workers; and a group can be ended as a whole
    with open(log, "ab", buffering=0) as stream, open(os.devnull, "rb") as nothing:
        os.dup2(nothing.fileno(), STDIN)
        os.dup2(stream.fileno(), STDOUT)
        os.dup2(stream.fileno(), STDERR)
    me = os.getpid()
    threading.Thread(target=_end_with, args=(os.getppid(),), daemon=True).start()

    def send(kind: str, content: Any = None) -> None:
        if os.getpid() != me:  # a process that a job forked and that came back out of it
            os._exit(1)
        pipe.send((kind, content))

    with suppress(EOFError):
        while True:
            job = pipe.recv()
            send("begun")
            try:
                function(job, lambda content: send("emitted", content))
            except BaseException as error:
                send("crashed", f"{type(error).__name__} ended the worker process: {error}")
                raise
            send("ended")


def _end_with(parent: int) -> None:
    """End this process when the parent is gone: who is killed cannot dismiss its workers."""
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(1)
