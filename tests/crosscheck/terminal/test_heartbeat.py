"""A line every half a minute where output is redirected, and none on a terminal or for --quiet."""

from __future__ import annotations

import io
import time

import numpy as np
import pytest
from rich.console import Console

from crosscheck.running.job import MAIN, Job
from crosscheck.running.scheduler import Event
from crosscheck.terminal import progress
from crosscheck.terminal.progress import Heartbeat, LiveProgress
from crosscheck.terminal.text import Verbosity


def jobs(count: int) -> list[Job]:
    return [Job(f"a/case{n}", "rigid", MAIN, "mine", None, "", np.zeros(2), "m:e", "") for n in range(count)]


class Clock:
    """A clock that is set by hand."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def test_a_line_says_what_runs_how_much_is_done_and_how_long_yet() -> None:
    clock, asked = Clock(), jobs(8)
    beat = Heartbeat(Console(file=io.StringIO()), clock=clock)
    assert beat.line() == "planning the runs after 1 s; no run has begun"
    for number in range(5):
        beat.hear(asked, Event(number, "started"))
    clock.now += 60.0
    beat.hear(asked, Event(0, "ended"))
    beat.hear(asked, Event(1, "crashed", "it died"))
    beat.hear(asked, Event(2, "emitted", "rk4 h=0.01"))
    assert beat.line() == (  # three that have not begun, of a minute each, by five workers
        "2 of 8 runs done after 60 s, about 36 s left; "
        "running a/case2 · rigid · mine: rk4 h=0.01, a/case3 · rigid · mine, a/case4 · rigid · mine"
    )
    beat.hear(asked, Event(5, "started"))
    assert beat.line().endswith("a/case4 · rigid · mine, and 1 more")
    beat.hear(jobs(9), Event(8, "started"))
    assert beat.line().startswith("2 of 9 runs done")


def shown(monkeypatch: pytest.MonkeyPatch, verbosity: Verbosity, terminal: bool) -> str:
    monkeypatch.setattr(progress.Heartbeat.__init__, "__defaults__", (0.01, time.monotonic))
    screen = io.StringIO()
    with LiveProgress(Console(file=screen, width=200, force_terminal=terminal), verbosity) as live:
        live.hear(jobs(2), Event(0, "started"))
        until = time.monotonic() + 5.0
        while "runs done" not in screen.getvalue() and verbosity is Verbosity.NORMAL and time.monotonic() < until:
            if terminal:
                break
            time.sleep(0.01)
        time.sleep(0.1)
    return screen.getvalue()


def test_redirected_output_has_it_and_nothing_else_has(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "0 of 2 runs done after" in shown(monkeypatch, Verbosity.NORMAL, terminal=False)
    assert "runs done" not in shown(monkeypatch, Verbosity.NORMAL, terminal=True)
    assert "runs done" not in shown(monkeypatch, Verbosity.QUIET, terminal=False)


def test_it_ends_with_its_session() -> None:
    screen = io.StringIO()
    beat = Heartbeat(Console(file=screen), every_s=0.01)
    beat.start()
    beat.stop()
    before = screen.getvalue()
    time.sleep(0.05)
    assert screen.getvalue() == before
