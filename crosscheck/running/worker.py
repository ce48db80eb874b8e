"""A worker: a process that takes jobs over a pipe, one after the other, and is supervised from outside.

It is a new process in a session of its own, and it serves one kind of jobs: nothing that a library leaves in its
process (folder, environment, warnings, threads) reaches another library. A job that exceeds its time limit, or whose
worker exceeds its memory limit, is stopped together with all processes that the worker started.
"""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterable, Mapping
from contextlib import suppress
from math import inf
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any, Literal

import psutil

from crosscheck.running.scheduler import Event, Function

# Processes with their descendants: measuring their memory, and ending them.

USABLE = 0.8  # of the memory; the rest is for the system and for the process that runs the workers
CGROUP = Path("/sys/fs/cgroup/memory.max")


def memory_limit(workers: int) -> float:
    """How many bytes each of the `workers` may hold, so that all of them together fit into the memory."""
    total = float(psutil.virtual_memory().total)
    with suppress(OSError, ValueError):  # a container may have less than its machine; "max" means no limit
        total = min(total, float(CGROUP.read_text(encoding="ascii")))
    return USABLE * total / workers


def memory_of(roots: Iterable[int]) -> dict[int, int]:
    """Resident memory in bytes of each process in `roots` together with its descendants."""
    held: dict[int, int] = dict.fromkeys(roots, 0)
    parents = {process.pid: process.info["ppid"] for process in psutil.process_iter(["ppid"])}
    for pid in parents:
        ancestor: int | None = pid
        while ancestor is not None and ancestor not in held:
            ancestor = parents.get(ancestor) or None
        if ancestor is not None:
            with suppress(psutil.Error):
                held[ancestor] += psutil.Process(pid).memory_info().rss
    return held


def end(process: BaseProcess) -> None:
    """Kill a process, its descendants, and its process group where it leads one."""
    assert process.pid is not None
    family: list[psutil.Process] = []
    with suppress(psutil.Error):
        family = psutil.Process(process.pid).children(recursive=True)
    if hasattr(os, "killpg"):
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)  # fails if the process did not become a group leader
    for each in family:
        with suppress(psutil.Error):
            each.kill()
    process.kill()
    process.join()


Method = Literal["spawn", "forkserver"]  # of multiprocessing
SPAWN: Method = "spawn"  # a new interpreter for each process, which inherits no state
START_LIMIT_S = 120.0  # for a worker to start and to read its job
TICK_S = 0.25
DEATH_S = 2.0  # between the end of a process's pipe and its exit code, at most
LOG_LIMIT_BYTES = 64 * 2**20
THREAD_LIMITS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
KERNELS = "FLEXMB_KERNELS"  # flexmb compiles kernels for each scene unless it is "general"
STDIN, STDOUT, STDERR = 0, 1, 2
_environment = threading.Lock()  # held while os.environ is changed to start a process


class Worker:
    """A slot for a process, which starts with the first job, and again after it has ended.

    `method` is how multiprocessing starts it, `job` the number of the present job (None when idle), `kind` the kind of
    jobs that the process serves.
    """

    def __init__(self, method: Method = SPAWN) -> None:
        self._method = method
        self.job: int | None = None
        self.kind = ""
        self.pipe: Connection | None = None
        self._process: BaseProcess | None = None
        self._deadline = inf
        self._limit_s = inf

    @property
    def pid(self) -> int:
        """The number of its process, 0 if it has none."""
        return 0 if self._process is None else self._process.pid or 0

    def hand_out(self, number: int, job: Any, kind: str, function: Function, log: str, limit_s: float) -> None:
        """Send a job; a new process is started if there is none alive or it served another kind."""
        if self._process is None or self.kind != kind or not self._process.is_alive():
            self.dismiss()
            self._start(function, log)
        self.job, self.kind, self._limit_s = number, kind, limit_s
        self._deadline = time.monotonic() + START_LIMIT_S
        assert self.pipe is not None
        with suppress(BrokenPipeError):  # the death of a worker is reported when its pipe is read
            self.pipe.send(job)

    def news(self, ready: bool, held: Mapping[int, int], memory_bytes: float) -> Event | None:
        """The next event, None if there is none; `ready` says that the pipe can be read.

        `held` is the memory of processes by pid, as far as it was measured. After the last event of a job the worker is
        idle, and its process is ended unless the job ended normally.
        """
        event = self._receive() if ready else self._watch(held, memory_bytes)
        if event is not None and event.kind != "emitted":
            self.job = None
            if event.kind != "ended":
                self.dismiss()
        return event

    def kill(self) -> None:
        """End its process and all that this started; to be called from another thread than the one that reads events,
        which is told of the end."""
        if self._process is not None:
            end(self._process)

    def dismiss(self) -> None:
        """End its process and all that this started."""
        if self._process is not None and self.pipe is not None:
            self.pipe.close()
            end(self._process)
        self._process = self.pipe = None

    def _start(self, function: Function, log: str) -> None:
        """Start a process; the thread limits must be in its environment before it imports anything."""
        context: Any = get_context(self._method)  # the contexts' common base type declares no Process
        here, there = context.Pipe()
        process = context.Process(target=_serve, args=(there, function, log), daemon=True)
        with _environment:
            its_own = dict.fromkeys(THREAD_LIMITS, "1") | {KERNELS: os.environ.get(KERNELS, "general")}
            before = {name: os.environ.get(name) for name in its_own}
            os.environ.update(its_own)
            try:
                process.start()
            finally:
                for name, value in before.items():
                    if value is None:
                        del os.environ[name]
                    else:
                        os.environ[name] = value
        there.close()
        self._process, self.pipe = process, here

    def _receive(self) -> Event | None:
        """The event that it sent; None for the message that the job has begun, which starts its time limit."""
        assert self.job is not None and self.pipe is not None
        try:
            kind, content = self.pipe.recv()
        except (EOFError, OSError):
            return self._death()
        except Exception as error:  # an engine wrote into the pipe, or the object cannot be unpickled here
            return Event(self.job, "crashed", f"the worker process sent what cannot be read ({type(error).__name__})")
        if kind == "begun":
            self._deadline = time.monotonic() + self._limit_s
            return None
        return Event(self.job, kind, content)

    def _watch(self, held: Mapping[int, int], memory_bytes: float) -> Event | None:
        """The event that ends its job because it exceeds a limit or its process is dead; else None."""
        assert self.job is not None and self._process is not None and self.pipe is not None
        if time.monotonic() > self._deadline:
            return Event(self.job, "stopped", f"it was stopped at its limit of {self._limit_s:g} s")
        memory = held.get(self.pid, 0)
        if memory > memory_bytes:
            sizes = f"{memory / 1e9:.3g} GB of memory where {memory_bytes / 1e9:.3g} GB are its part"
            return Event(self.job, "stopped", f"it was stopped when it held {sizes}; fewer --jobs leave more to each")
        if not self._process.is_alive() and not self.pipe.poll():  # a child of it may keep the pipe open
            return self._death()
        return None

    def _death(self) -> Event:
        assert self.job is not None and self._process is not None
        until = time.monotonic() + DEATH_S
        while self._process.exitcode is None and time.monotonic() < until:  # `join` could wait forever
            time.sleep(0.01)
        code = self._process.exitcode
        how = "closed its pipe" if code is None else f"died (exit code {code})"
        return Event(self.job, "crashed", f"the worker process {how}")


def keep_short(log: str) -> None:
    """Empty a log that has become too long; workers append, so they continue at its new end."""
    with suppress(OSError):
        if os.path.getsize(log) > LOG_LIMIT_BYTES:
            os.truncate(log, 0)


def _serve(pipe: Connection, function: Function, log: str) -> None:
    """The main loop of a worker process: jobs in, events out, until the pipe closes or the parent is gone."""
    if hasattr(os, "setsid"):
        os.setsid()  # Ctrl-C goes to the parent only, and all descendants can be ended as a group
    with open(log, "ab", buffering=0) as stream, open(os.devnull, "rb") as nothing:
        os.dup2(nothing.fileno(), STDIN)
        os.dup2(stream.fileno(), STDOUT)
        os.dup2(stream.fileno(), STDERR)
    me = os.getpid()
    threading.Thread(target=_end_with, args=(os.getppid(),), daemon=True).start()

    def send(kind: str, content: Any = None) -> None:
        if os.getpid() != me:  # a forked child of a job that returned from it
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
    """End this process when the parent is gone: a killed parent cannot end its workers."""
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(1)
