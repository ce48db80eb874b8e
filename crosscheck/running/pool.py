"""The local scheduler, a small process pool that survives its workers.

Each worker is a process of its own (`worker`); one that dies takes only its job with it.

Why not a pool from a library: the standard pools and loky fail as a whole when a process is killed, which an engine's
crash in C++ does, and have no limit of time. Pebble (5.2) has one and survives the death of a worker, but it gives a
job to whichever worker comes first (kernels would be compiled once a worker and engines would share processes), hands
out one result a job (here every effort is recorded as it ends, so that a killed run loses nothing), watches no memory,
and ends a worker without what that started. What a library does carry, processes and their memory, is psutil's.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from multiprocessing.connection import wait
from typing import Any

from crosscheck.running.processes import memory_limit, memory_of
from crosscheck.running.scheduler import Event, Events, Function, one_kind, usual_limit
from crosscheck.running.waiting import Waiting
from crosscheck.running.worker import SPAWN, TICK_S, Method, Worker, keep_short


def run_jobs(
    function: Function,
    jobs: Sequence[Any],
    workers: int | None,
    log: str,
    kind: Callable[[Any], str] = one_kind,
    time_limit_s: Callable[[Any], float] = usual_limit,
    memory_limit_bytes: float | None = None,
    method: Method = SPAWN,
) -> Events:
    """Run jobs in `workers` processes of this machine (by default one per core); see `Scheduler`.

    Only one worker is at a kind until its first job is done. The file `log` starts again when it becomes too long.
    Numerical libraries get one thread per worker, and flexmb compiles general kernels where FLEXMB_KERNELS says
    nothing: a session has dozens of scenes, and kernels made for one serve few others. By default each worker may hold
    an equal part of the machine's memory. `method` is how multiprocessing starts processes.
    """
    count = workers or os.cpu_count() or 1
    kinds: list[str] = []
    waiting = Waiting()
    prepared: set[str] = set()
    memory_bytes = memory_limit_bytes or memory_limit(count)
    watched = time.monotonic()
    crew = [Worker(method) for _ in range(count)]
    try:
        while len(kinds) < len(jobs) or waiting or any(worker.job is not None for worker in crew):
            for number in range(len(kinds), len(jobs)):
                kinds.append(kind(jobs[number]))
                waiting.add(number, kinds[number])
            for worker in crew:
                if worker.job is not None:
                    continue
                taken = {other.kind for other in crew if other.job is not None}
                chosen = waiting.take(worker.kind, taken, prepared)
                if chosen is not None:
                    number, its_kind = chosen
                    worker.hand_out(number, jobs[number], its_kind, function, log, time_limit_s(jobs[number]))
                    yield Event(number, "started")
            busy = [worker for worker in crew if worker.job is not None]
            ready = wait([worker.pipe for worker in busy if worker.pipe is not None], TICK_S)
            held: dict[int, int] = {}
            if time.monotonic() > watched + TICK_S:
                held, watched = memory_of(pid for worker in busy if (pid := worker.pid)), time.monotonic()
                keep_short(log)
            for worker in busy:
                event = worker.news(worker.pipe in ready, held, memory_bytes)
                if event is not None:
                    if event.kind == "ended":
                        prepared.add(worker.kind)
                    yield event
    finally:
        for worker in crew:
            worker.dismiss()
