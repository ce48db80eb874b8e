"""Ctrl-C while compiled code runs: the run ends at its next step, and its results up to there are kept."""

from __future__ import annotations

import _thread
import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from flexmb.run.trajectory import Trajectory
from flexmb.typing import Index

PATIENCE = 0.1  # s between checks for Ctrl-C, for systems where it does not interrupt waiting for a lock (Windows)


class Interrupted(KeyboardInterrupt):
    """Ctrl-C ended a run. `trajectory` holds the run up to there, as for any run that stopped early."""

    def __init__(self, trajectory: Trajectory) -> None:
        super().__init__(trajectory)
        self.trajectory = trajectory

    def __str__(self) -> str:
        return f"{self.trajectory.message}; the results up to there are in the attribute `trajectory`"


class _SpareThread:
    """A worker thread that is reused, because starting a thread costs as much as a short run."""

    def __init__(self) -> None:
        self.process = os.getpid()
        self._asked, self._work = _thread.allocate_lock(), list[Callable[[], None]]()
        self._asked.acquire()
        _thread.start_new_thread(self._serve, ())

    def do(self, work: Callable[[], None]) -> None:
        """Start `work`, which must not raise, once earlier work is done."""
        self._work.append(work)
        self._asked.release()

    def _serve(self) -> None:
        while True:
            self._asked.acquire()
            self._work.pop()()


_idle: list[_SpareThread] = []  # used by the main thread only


def _idle_worker() -> _SpareThread:
    """An idle worker thread. Threads of a parent process are discarded: they do not exist after a fork."""
    while _idle:
        worker = _idle.pop()
        if worker.process == os.getpid():
            return worker
    return _SpareThread()


class Stop:
    """Asks the runs of several threads to return soon; as `stop` of `interruptible` it is set like an array.

    flags: of runs that are there from the beginning; those that begin later are covered by `covering`.
    """

    def __init__(self, flags: Index) -> None:
        self._flags, self._running, self.asked = flags, dict[int, Index](), False

    def __setitem__(self, place: int, value: int) -> None:
        self.asked = True
        self._flags[:] = value
        for flag in list(self._running.values()):
            flag[place] = value

    @contextmanager
    def covering(self) -> Iterator[None]:
        """Runs that begin in this thread are covered."""
        _own.stop = self
        try:
            yield
        finally:
            _own.stop = None

    def run(self, run: Callable[..., Any], arguments: tuple[Any, ...], flag: Index) -> tuple[Any, bool]:
        """The result of a run in this thread, and whether it was asked to return; `flag` is what it looks at."""
        place = threading.get_ident()
        self._running[place] = flag
        if self.asked:  # before it was known to run
            flag[0] = 1
        try:
            return run(*arguments), self.asked
        finally:
            del self._running[place]


_own = threading.local()
"""`stop`: the `Stop` that covers the runs of a thread."""


def is_handed_over() -> bool:
    """Whether `interruptible` has another thread run what it is given."""
    return threading.current_thread() is threading.main_thread()


def interruptible(run: Callable[..., Any], arguments: tuple[Any, ...], stop: Index | Stop) -> tuple[Any, bool]:
    """The result of `run`, and whether Ctrl-C was pressed, in which case stop[0] = 1 asks `run` to return soon.

    Python handles signals in the main thread, and only between its own instructions: so compiled code runs in another
    thread, and the main one waits. When called from another thread, `run` is executed there, and is interrupted only if
    a `Stop` covers the runs of that thread.
    """
    if not is_handed_over():
        cover: Stop | None = getattr(_own, "stop", None)
        if cover is not None and not isinstance(stop, Stop):
            return cover.run(run, arguments, stop)
        return run(*arguments), False
    done, found = _thread.allocate_lock(), list[Any]()  # a bare lock, because an Event costs as much as a short run

    def work() -> None:
        try:
            found.append((run(*arguments), None))
        except BaseException as problem:
            found.append((None, problem))
        finally:
            done.release()

    def wait() -> None:
        while not found:
            done.acquire(timeout=PATIENCE)

    done.acquire()
    worker, interrupted = _idle_worker(), False
    worker.do(work)
    try:
        wait()
    except KeyboardInterrupt:
        stop[0], interrupted = 1, True
        wait()
    except BaseException:  # raised by a handler of another signal, such as an alarm
        stop[0] = 1
        wait()
        raise
    finally:
        if found:  # otherwise a second Ctrl-C was pressed, and the worker is still busy
            _idle.append(worker)
    result, problem = found[0]
    if problem is not None:
        raise problem
    return result, interrupted
