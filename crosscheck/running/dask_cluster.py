"""The scheduler of a Dask cluster: a Dask task for each job, which runs it in a process beside the Dask worker.

Dask finds the machines, survives the death of workers and gives their jobs to others, as often as the cluster's
`distributed.scheduler.allowed-failures` says. Limits of time and memory and the handling of crashes are those of the
local pool (`dask_worker`): a Dask task itself has no limits and shares its process with others.

The workers' machines need the same packages, and the files that scenes name under the same paths.
"""

from __future__ import annotations

import logging
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from math import inf
from queue import Empty, SimpleQueue

from distributed import Client, Future
from distributed.scheduler import KilledWorker

from crosscheck.library.own_files import code_here
from crosscheck.running.dask_worker import Crew, do_job
from crosscheck.running.scheduler import Event, Events, Waiting, Work
from crosscheck.running.worker import START_LIMIT_S, TICK_S

ANSWER_S = 10.0  # time limit for the answer of a Dask scheduler
OVERHEAD_S = 2 * START_LIMIT_S  # time that a Dask worker may take besides its job before it counts as hung


class ClusterError(OSError):
    """The cluster cannot be used: its scheduler does not answer, it has no workers, or they run other sources."""


@dataclass(frozen=True)
class DaskCluster:
    """Runs jobs on the cluster whose scheduler has the `address`, such as "tcp://10.0.0.1:8786"."""

    address: str

    def check(self) -> None:
        """Raise ClusterError unless the scheduler answers and all its workers run the sources that run here."""
        with self._client() as client:
            _require_same_sources(client, self.address)

    def __call__(self, work: Work) -> Events:
        """Run jobs; see `Work`. What they print stays with the Dask workers, in a file of their local directories."""
        with self._client() as client:
            _require_same_sources(client, self.address)
            dispatch = _Dispatch(client, self.address, work)
            with dispatch.session():
                yield from dispatch.events()

    @contextmanager
    def _client(self) -> Iterator[Client]:
        logging.getLogger("distributed").setLevel(logging.ERROR)  # workers may come and go
        try:
            client = Client(self.address, timeout=ANSWER_S, set_as_default=False)
        except (OSError, ValueError) as error:
            raise ClusterError(
                f"no Dask scheduler answers at {self.address} ({error}): start one with `dask scheduler`, "
                f"or run here with `--scheduler local`"
            ) from None
        try:
            yield client
        finally:
            client.close()


@dataclass
class _Flight:
    """A submitted job: its task, the worker for which it is meant, and the time by which it must have ended."""

    future: Future
    kind: str
    address: str
    begun: bool = False
    deadline: float = inf


@dataclass
class _Dispatch:
    """One session: distributes the jobs and yields their events."""

    client: Client
    address: str
    work: Work
    name: str = field(default_factory=lambda: f"crosscheck-{uuid.uuid4().hex}")
    known: int = 0
    waiting: Waiting = field(default_factory=Waiting)
    flights: dict[int, _Flight] = field(default_factory=dict)
    threads: dict[str, int] = field(default_factory=dict)
    kinds: dict[str, str] = field(default_factory=dict)  # of each worker's last job
    prepared: set[tuple[str, str]] = field(default_factory=set)  # machines with kinds whose first job has ended there
    news: SimpleQueue[tuple[str, int]] = field(default_factory=SimpleQueue)

    @contextmanager
    def session(self) -> Iterator[None]:
        """Install the processes on the workers, which report when jobs begin; in the end remove all from the
        cluster."""
        self.client.register_plugin(Crew(self.name), name=self.name)
        self.client.subscribe_topic(self.name, lambda event: self.news.put(("begun", event[1])))
        try:
            yield
        finally:
            if self.client.status == "running":
                self.client.cancel([flight.future for flight in self.flights.values()])
                self.client.unsubscribe_topic(self.name)
                self.client.unregister_worker_plugin(self.name)

    def events(self) -> Iterator[Event]:
        looked, somebody = -inf, time.monotonic()
        while self.known < len(self.work.jobs) or self.waiting or self.flights:
            now = time.monotonic()
            if now > looked + TICK_S:
                looked = now
                self._look(now)
                somebody = now if self.threads else somebody
                if now > somebody + START_LIMIT_S:
                    raise ClusterError(f"the cluster at {self.address} has had no worker for {START_LIMIT_S:g} s")
            self._send_out()
            try:
                what, number = self.news.get(timeout=TICK_S)
            except Empty:
                yield from self._given_up()
                continue
            flight = self.flights.get(number)
            if flight is None:
                continue
            if not flight.begun:
                flight.begun = True
                yield Event(number, "started")
            if what == "begun":  # possibly for the second time, on another worker
                flight.deadline = time.monotonic() + self.work.time_limit_s(self.work.jobs[number]) + OVERHEAD_S
            else:
                yield from self._landed(number, self.flights.pop(number))

    def _look(self, now: float) -> None:
        """Update the list of workers and the queue of jobs."""
        if self.client.status != "running":
            raise ClusterError(f"the Dask scheduler at {self.address} is gone; what came from it is recorded")
        self.threads = dict(self.client.nthreads())
        for number in range(self.known, len(self.work.jobs)):
            self.waiting.add(number, self.work.kind(self.work.jobs[number]))
        self.known = len(self.work.jobs)

    def _send_out(self) -> None:
        """Give every free thread a job. Without workers one task is submitted, for which the cluster may start one."""
        places = self.threads or {"": 1}
        for address, threads in places.items():
            load = sum(flight.address == address for flight in self.flights.values())
            for _ in range(threads - load):
                if len(self.flights) >= (self.work.workers or inf) or not self._send_to(address):
                    break

    def _send_to(self, address: str) -> bool:
        """Submit the job that suits a worker best; if Dask chooses another worker, only the speed changes."""
        host = _host(address)
        taken = {flight.kind for flight in self.flights.values() if _host(flight.address) == host}
        prepared = {kind for place, kind in self.prepared if place == host}
        chosen = self.waiting.take(self.kinds.get(address, ""), taken, prepared)
        if chosen is None:
            return False
        number, kind = chosen
        job = self.work.jobs[number]
        future = self.client.submit(
            do_job, self.name, code_here(), number, self.work.function, job, kind, self.work.time_limit_s(job),
            self.work.memory_limit_bytes, key=f"{self.name}-{number}", pure=False,
            workers=[address] if address else None, allow_other_workers=bool(address),
        )  # fmt: skip
        self.flights[number] = _Flight(future, kind, address)
        self.kinds[address] = kind
        future.add_done_callback(lambda _: self.news.put(("landed", number)))
        return True

    def _landed(self, number: int, flight: _Flight) -> Iterator[Event]:
        """The events of a job whose task has ended; exactly one of them is its last."""
        if flight.future.status == "cancelled":
            raise ClusterError(f"the Dask scheduler at {self.address} has dropped a job; what came before is recorded")
        try:
            limit_s = self.work.time_limit_s(self.work.jobs[number])
            events: list[Event] = flight.future.result(timeout=limit_s + OVERHEAD_S)
        except KilledWorker as error:
            times = error.allowed_failures + 1
            events = [Event(number, "crashed", f"the Dask worker died, {times} times when it was tried again")]
        except Exception as error:
            events = [Event(number, "crashed", f"its Dask task failed: {type(error).__name__}: {error}")]
        flight.future.release()
        if events[-1].kind == "ended":
            self.prepared.add((_host(flight.address), flight.kind))
        yield from events

    def _given_up(self) -> Iterator[Event]:
        """Stop the jobs whose Dask worker should have ended them long ago."""
        for number, flight in list(self.flights.items()):
            if time.monotonic() > flight.deadline:
                self.client.cancel([flight.future])
                del self.flights[number]
                limit = self.work.time_limit_s(self.work.jobs[number])
                yield Event(number, "stopped", f"nothing was heard of it long after its limit of {limit:g} s")


def _require_same_sources(client: Client, address: str) -> None:
    try:
        sources = client.run(code_here)
    except Exception as error:
        raise ClusterError(
            f"a worker of {address} cannot load crosscheck ({type(error).__name__}: {error}): "
            "install there what is installed here"
        ) from None
    others = sorted(worker for worker, code in sources.items() if code != code_here())
    if others:
        raise ClusterError(
            f"workers run other sources than this process: {', '.join(others)}; install them, and restart"
        )


def _host(address: str) -> str:
    """The machine in the address of a worker."""
    return address.rpartition(":")[0]
