"""Live progress: what stays on the screen after a job."""

from __future__ import annotations

import io

import numpy as np
from rich.console import Console

from crosscheck.live import LiveProgress
from crosscheck.plan import MAIN, Job
from crosscheck.pool import Event
from crosscheck.records import RunRecord


def test_brackets_in_a_remedy_are_text_not_markup() -> None:
    job = Job("case", "rigid", MAIN, "absent", None, "", np.zeros(2), "module:engines")
    remedy = "not installed: `pip install flexmb[peers]`"
    record = RunRecord(
        case="case", variant="rigid", role=MAIN, engine="absent", version="", scene="", status="did not run",
        message=remedy,
    )  # fmt: skip
    screen = io.StringIO()
    with LiveProgress(Console(file=screen, width=200)) as live:
        for event in (Event(0, "started"), Event(0, "emitted", record), Event(0, "ended")):
            live.hear([job], event)
    assert f"did not run: {remedy}" in screen.getvalue()
