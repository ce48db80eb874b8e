"""The part of a session in a Dask worker: processes that run the jobs, supervised as by the local pool.

A job never runs in the Dask worker's own process, which an engine could crash, block, fill or change.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from multiprocessing import current_process
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any

from distributed import Worker as DaskWorker
from distributed import WorkerPlugin, get_worker

from crosscheck.library.own_files import code_here
from crosscheck.running.scheduler import Event, Function
from crosscheck.running.worker import TICK_S, Worker, keep_short, memory_limit, memory_of


class Crew(WorkerPlugin):
    """The processes of one session on one Dask worker."""

    def __init__(self, session: str) -> None:
        self.name = session

    def setup(self, worker: DaskWorker) -> None:
        self._dask_worker = worker
        self._guard = threading.Lock()
        self._idle: list[Worker] = []
        self._busy: set[Worker] = set()
        self._closed = False
        self._log = str(Path(worker.local_directory) / f"{self.name}.log")
        limit = worker.memory_manager.memory_limit
        threads = worker.state.nthreads
        self._memory_bytes = limit / threads if limit else memory_limit(threads)

    def teardown(self, worker: DaskWorker) -> None:
        """End all processes; their jobs count as crashed."""
        with self._guard:
            self._closed = True
            idle, busy = self._idle, set(self._busy)
            self._idle = []
        for each in idle:
            each.dismiss()
        for each in busy:
            each.kill()

    def events(
        self, number: int, function: Function, job: Any, kind: str, limit_s: float, memory_bytes: float | None
    ) -> Iterator[Event]:
        """Run a job in a process of its kind; the last event says how it ended."""
        worker = self._engage(kind)
        try:
            worker.hand_out(number, job, kind, function, self._log, limit_s)
            watched = time.monotonic()
            while worker.job is not None:
                ready = bool(wait([worker.pipe], TICK_S)) if worker.pipe is not None else False
                held: dict[int, int] = {}
                if time.monotonic() > watched + TICK_S:
                    held, watched = memory_of([worker.pid]), time.monotonic()
                    keep_short(self._log)
                event = worker.news(ready, held, memory_bytes or self._memory_bytes)
                if event is not None:
                    yield event
        finally:
            self._release(worker)

    def has_begun(self, number: int) -> None:
        """Report to the session that the job has started."""
        self._dask_worker.log_event(self.name, number)

    def _engage(self, kind: str) -> Worker:
        """An idle worker of that kind, else any idle or new one."""
        with self._guard:
            of_kind = [worker for worker in self._idle if worker.kind == kind]
            worker = (of_kind or self._idle or [Worker()])[0]
            if worker in self._idle:
                self._idle.remove(worker)
            self._busy.add(worker)
        return worker

    def _release(self, worker: Worker) -> None:
        with self._guard:
            self._busy.discard(worker)
            if not self._closed:
                self._idle.append(worker)
                return
        worker.dismiss()


def do_job(
    session: str, code: str, number: int, function: Function, job: Any, kind: str, limit_s: float,
    memory_bytes: float | None,
) -> list[Event]:  # fmt: skip
    """The Dask task of a job: the events of the job.

    They are returned at the end of the task, so that a job which is repeated after the death of a Dask worker counts
    once.
    """
    if code != code_here():  # a worker that joined after the session had checked all
        return [Event(number, "crashed", "this Dask worker runs other sources: install the same, and restart it")]
    current_process().daemon = False  # daemons, as Dask's workers are, may not start processes; ours end with them
    crew = get_worker().plugins[session]
    assert isinstance(crew, Crew)
    crew.has_begun(number)
    return list(crew.events(number, function, job, kind, limit_s, memory_bytes))
