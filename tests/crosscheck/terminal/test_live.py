"""Live progress: what stays on the screen after a job."""

from __future__ import annotations

import io
import re
import time

import numpy as np
import pytest
from rich.console import Console

from crosscheck.records.kinds import RunRecord
from crosscheck.running.job import MAIN, Job
from crosscheck.running.scheduler import Event
from crosscheck.terminal.progress import LiveProgress


def lasting_line(message: str) -> str:
    """What stays of a job that did not run."""
    job = Job("case", "rigid", MAIN, "absent", None, "", np.zeros(2), "module:engines", "")
    record = RunRecord(
        case="case", variant="rigid", role=MAIN, engine="absent", version="", scene="", status="did not run",
        message=message,
    )  # fmt: skip
    screen = io.StringIO()
    with LiveProgress(Console(file=screen, width=200)) as live:
        for event in (Event(0, "started"), Event(0, "emitted", record), Event(0, "ended")):
            live.hear([job], event)
    return screen.getvalue()


@pytest.mark.parametrize("columns", [40, 100])
def test_what_runs_is_named_in_full_on_every_terminal(columns: int) -> None:
    job = Job("a_family_of_cases/a_case", "rigid", MAIN, "absent", None, "", np.zeros(2), "module:engines", "")
    screen = io.StringIO()
    with LiveProgress(Console(file=screen, width=columns, force_terminal=True)) as live:
        live.hear([job], Event(0, "started"))
        live.hear([job], Event(0, "emitted", "the finest effort"))
    shown = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", screen.getvalue())
    assert "…" not in shown and "finest" in shown
    assert ("━" in shown) is (columns == 100)


@pytest.mark.parametrize("columns", [40, 60, 80, 120])
@pytest.mark.parametrize("seconds", [None, 1.0, 2340.0, 36000.0])
def test_the_count_and_the_time_left_are_shown_on_one_line(columns: int, seconds: float | None) -> None:
    """However long the names of jobs are, of which many run and some have ended."""
    name = "spinning_beam/beam_k_subcritical_with_a_long_name"
    job = Job(name, "segments", MAIN, "native-frisch-as-printed", None, "", np.zeros(2), "module:engines", "")
    page = Console(file=io.StringIO(), width=columns)
    with LiveProgress(Console(file=io.StringIO(), width=columns, force_terminal=True)) as live:
        for number in range(120):
            live.hear([job] * 305, Event(number, "started"))
            live.hear([job] * 305, Event(number, "ended"))
        live.hear([job] * 305, Event(120, "started"))
        (task, *_) = live.bars.tasks
        live.bars.update(task.id, ends_at=None if seconds is None else time.monotonic() + seconds)
        page.print(*live.bars.get_renderables(), sep="\n")
    (first, *rest) = page.file.getvalue().splitlines()
    assert "120/305" in first and ("no estimate yet" if seconds is None else "left") in first
    assert ("━" in first) is (columns >= 60)
    assert "…" not in "".join((first, *rest)) and all(len(line.rstrip()) <= columns for line in (first, *rest))


def test_brackets_in_a_remedy_are_text_not_markup() -> None:
    remedy = "not installed: `pip install flexmb[peers]`"
    assert f"did not run: {remedy}" in lasting_line(remedy)


def test_first_problem_of_a_scene_stays_with_its_place() -> None:
    message = 'scene "s" has 2 problems:\n  1. $.bodies[1]: no mass\n     -> add it\n  2. $.hinges[0]: no axis\n'
    assert 'did not run: scene "s" has 2 problems: 1. $.bodies[1]: no mass -> add it\n' in lasting_line(message)
