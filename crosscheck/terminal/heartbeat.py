"""A line every half a minute for output that goes to a file: which runs are going on, how many are done, how long yet.

A job of continuous integration that prints nothing for ten minutes is stopped by some services, and looks dead.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence

from rich.console import Console

from crosscheck.records.kinds import RunRecord
from crosscheck.running.expected import Remaining
from crosscheck.running.job import Job
from crosscheck.running.scheduler import Event
from crosscheck.terminal.text import words
from crosscheck.terminal.time_left import in_words

EVERY_S = 30.0
NAMED = 3  # running jobs that a line names


class Heartbeat:
    """Hears the events of a session, and prints a line every `every_s` seconds from `start` to `stop`.

    A thread prints, since a long run sends no events.
    """

    def __init__(
        self, console: Console, every_s: float = EVERY_S, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._console = console
        self._every_s = every_s
        self._clock = clock
        self._begin = clock()
        self._lock = threading.Lock()  # events come from another thread
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._beat, daemon=True)
        self._running: dict[int, str] = {}
        self._remaining = Remaining()
        self._count = 0
        self._done = 0

    def start(self) -> None:
        """Begin to print."""
        self._begin = self._clock()
        self._thread.start()

    def stop(self) -> None:
        """Print no more."""
        self._over.set()
        self._thread.join()

    def hear(self, jobs: Sequence[Job], event: Event) -> None:
        """Take note of one event."""
        with self._lock:
            if len(jobs) > self._count:  # an outcome may ask for more jobs
                new = range(self._count, len(jobs))
                self._remaining.expect((number, jobs[number].engine, jobs[number].expected_s) for number in new)
                self._count = len(jobs)
            title, passed = jobs[event.job].title, self._clock() - self._begin
            match event.kind:
                case "started":
                    self._running[event.job] = title
                    self._remaining.started(event.job, passed)
                case "emitted":
                    if isinstance(event.content, str):
                        self._running[event.job] = f"{title}: {event.content}"
                    elif isinstance(event.content, RunRecord) and event.content.effort:
                        self._running[event.job] = f"{title}: {event.content.effort} done"
                case "ended" | "crashed" | "stopped":
                    self._running.pop(event.job, None)
                    self._remaining.ended(event.job, passed)
                    self._done += 1

    def line(self) -> str:
        """The state of the session in one line."""
        with self._lock:
            passed = self._clock() - self._begin
            seconds = self._remaining.seconds(passed)
            left = "" if seconds is None else f", about {in_words(seconds)} left"
            running = list(self._running.values())
            more = f", and {len(running) - NAMED} more" if len(running) > NAMED else ""
            what = f"running {', '.join(running[:NAMED])}{more}" if running else "no run has begun"
            done = f"{self._done} of {self._count} runs done" if self._count else "planning the runs"
            return f"{done} after {in_words(passed)}{left}; {what}"

    def _beat(self) -> None:
        while not self._over.wait(self._every_s):
            self._console.print(words(self.line()), soft_wrap=True)
