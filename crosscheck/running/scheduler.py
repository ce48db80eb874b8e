"""The interface of schedulers: they take jobs and yield events; the death of a worker costs only its job.

`pool` runs jobs in processes of this machine, `dask_cluster` on those of a Dask cluster; `schedulers` selects one by
its address. Cases, refinements, controls, stability maps and sweeps all run through this interface."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Generator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

TIME_LIMIT_S = 1800.0  # default for a job; the longest of the shipped cases takes 14 s without compiling

Emit = Callable[[Any], None]
Function = Callable[[Any, Emit], None]


@dataclass(frozen=True)
class Event:
    """Job number `job` started, emitted `content`, ended, crashed, or was stopped at a limit.

    For the last two `content` says how. Exactly one of the last three is the last event of a job.
    """

    job: int
    kind: Literal["started", "emitted", "ended", "crashed", "stopped"]
    content: Any = None

    @property
    def status_of_end(self) -> Literal["crashed", "did not finish"]:
        """The status of a job that crashed or was stopped."""
        return "crashed" if self.kind == "crashed" else "did not finish"


@dataclass(frozen=True)
class Limits:
    """Limits of a session; None leaves one to the scheduler, to the case or to `TIME_LIMIT_S`.

    `workers` is the number of jobs at a time (by default one per core, or per thread of a cluster), `time_s` the time
    limit of a job, `memory_bytes` the memory limit of its process (by default an equal part of the memory).
    """

    workers: int | None = None
    time_s: float | None = None
    memory_bytes: float | None = None


BY_DEFAULT = Limits()


def one_kind(job: Any) -> str:
    """The kind of a job, where all jobs are of one kind."""
    return ""


def usual_limit(job: Any) -> float:
    """The time limit of a job, where all have `TIME_LIMIT_S`."""
    return TIME_LIMIT_S


Events = Generator[Event, None, None]


@dataclass(frozen=True)
class Work:
    """Jobs, and how they are to be run: `function(job, emit)` for each, where no other job runs in the same process.

    `function` must be importable by name. `jobs` may grow while the events are read, since an outcome can ask for more.
    What jobs print on this machine goes to the file `log`. `workers` is the number of jobs at a time, by default one
    per core, or per thread of a cluster. `kind(job)` names what a process has to load or compile for a job: a process
    serves one kind. A job is stopped after `time_limit_s(job)`, or when its process with all its descendants exceeds
    `memory_limit_bytes`, by default an equal part of the memory.
    """

    function: Function
    jobs: Sequence[Any]
    log: str
    workers: int | None = None
    kind: Callable[[Any], str] = one_kind
    time_limit_s: Callable[[Any], float] = usual_limit
    memory_limit_bytes: float | None = None


Scheduler = Callable[[Work], Events]
"""Runs the jobs, and yields what happens to them. Closing the iterator stops everything."""


class Waiting:
    """Queues of the numbers of waiting jobs, one for each kind; false if all are empty."""

    def __init__(self) -> None:
        self._jobs: dict[str, deque[int]] = {}

    def __bool__(self) -> bool:
        return any(self._jobs.values())

    def add(self, job: int, kind: str) -> None:
        self._jobs.setdefault(kind, deque()).append(job)

    def take(self, own: str, taken: Collection[str], prepared: Collection[str]) -> tuple[int, str] | None:
        """The next job for a worker, with its kind: of the worker's `own` kind, else of one that no worker runs, else
        of a `prepared` one.

        None if every waiting job is of a kind that another worker runs (`taken`) and that is not prepared: kernels that
        its first job compiles and caches are not compiled twice.
        """
        open_kinds = [kind for kind, jobs in self._jobs.items() if jobs and (kind in prepared or kind not in taken)]
        if not open_kinds:
            return None
        chosen = min(open_kinds, key=lambda kind: (kind != own, kind in taken, self._jobs[kind][0]))
        return self._jobs[chosen].popleft(), chosen
