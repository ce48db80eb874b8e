"""The local scheduler: a process pool in which the death of a worker costs only its job.

No library has such a pool. The standard pools and loky fail as a whole when a process is killed, as by an engine's
crash in C++, and have no time limits. Pebble (5.2) has time limits and survives dead workers, but it gives a job to any
free worker (kernels would be compiled by every worker, and engines would share processes), returns one result a job
(here every effort is recorded as it ends, so that a killed session loses nothing), limits no memory, and leaves the
descendants of a worker alive. psutil measures and ends processes."""

from __future__ import annotations

import os
import time
from multiprocessing.connection import wait

from crosscheck.running.scheduler import Event, Events, Waiting, Work
from crosscheck.running.worker import SPAWN, TICK_S, Method, Worker, keep_short, memory_limit, memory_of


def run_jobs(work: Work, method: Method = SPAWN) -> Events:
    """Run jobs in processes of this machine, which multiprocessing starts by `method`; see `Work`.

    Only one worker runs jobs of a kind until the first of them is done. The log is emptied when it becomes too long.
    Numerical libraries get one thread per worker. flexmb compiles general kernels unless FLEXMB_KERNELS is set: a
    session has dozens of scenes, and kernels made for one scene rarely serve another.
    """
    jobs = work.jobs
    count = work.workers or os.cpu_count() or 1
    kinds: list[str] = []
    waiting = Waiting()
    prepared: set[str] = set()
    memory_bytes = work.memory_limit_bytes or memory_limit(count)
    watched = time.monotonic()
    crew = [Worker(method) for _ in range(count)]
    try:
        while len(kinds) < len(jobs) or waiting or any(worker.job is not None for worker in crew):
            for number in range(len(kinds), len(jobs)):
                kinds.append(work.kind(jobs[number]))
                waiting.add(number, kinds[number])
            for worker in crew:
                if worker.job is not None:
                    continue
                taken = {other.kind for other in crew if other.job is not None}
                chosen = waiting.take(worker.kind, taken, prepared)
                if chosen is not None:
                    number, its_kind = chosen
                    job = jobs[number]
                    worker.hand_out(number, job, its_kind, work.function, work.log, work.time_limit_s(job))
                    yield Event(number, "started")
            busy = [worker for worker in crew if worker.job is not None]
            ready = wait([worker.pipe for worker in busy if worker.pipe is not None], TICK_S)
            held: dict[int, int] = {}
            if time.monotonic() > watched + TICK_S:
                held, watched = memory_of(pid for worker in busy if (pid := worker.pid)), time.monotonic()
                keep_short(work.log)
            for worker in busy:
                event = worker.news(worker.pipe in ready, held, memory_bytes)
                if event is not None:
                    if event.kind == "ended":
                        prepared.add(worker.kind)
                    yield event
    finally:
        for worker in crew:
            worker.dismiss()
