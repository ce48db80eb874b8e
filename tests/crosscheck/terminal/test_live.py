"""Live progress: what stays on the screen after a job, a line every half a minute where output is redirected, and one
line for all accepted figures that are stale.
"""

import io
import re
import time

import msgspec
import numpy as np
import pytest
from rich.console import Console

from crosscheck.judging.outcome import SessionOutcome
from crosscheck.judging.verdict import Verdict
from crosscheck.records.kinds import RunRecord
from crosscheck.running.job import MAIN, Job
from crosscheck.running.scheduler import Event
from crosscheck.terminal import progress
from crosscheck.terminal.progress import Heartbeat, LiveProgress
from crosscheck.terminal.text import Verbosity
from crosscheck.terminal.verdicts import print_outcome


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
    monkeypatch.setattr(progress.Heartbeat.__init__, "__defaults__", (0.01, time.monotonic, "planning the runs"))
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


def test_what_comes_before_the_first_run_is_named() -> None:
    """Equations of a case's own may take minutes: on a terminal and beside it they are not called planning."""
    beat = Heartbeat(Console(file=io.StringIO()), first="evaluating closed forms")
    assert beat.line() == "evaluating closed forms after 1 s; no run has begun"
    screen = io.StringIO()
    with LiveProgress(Console(file=screen, width=200, force_terminal=True), first="evaluating closed forms") as live:
        time.sleep(0.3)
        before = screen.getvalue()
        live.hear(jobs(2), Event(0, "started"))
        assert live.bars.tasks[0].description == "all runs"
    assert "evaluating closed forms" in before


def test_it_ends_with_its_session() -> None:
    screen = io.StringIO()
    beat = Heartbeat(Console(file=screen), every_s=0.01)
    beat.start()
    beat.stop()
    before = screen.getvalue()
    time.sleep(0.05)
    assert screen.getvalue() == before


GOOD = Verdict(
    case="family/one", comparison="both", kind="comparison", channel="energy.total", variant_a="rigid",
    engine_a="native", variant_b="rigid", engine_b="pinocchio", level="rigid", status="agree", expected="agree",
    E=1e-9, U=1e-8, goal=1e-6, scale=1.0, reason="within U",
)  # fmt: skip


def shown_lines(*verdicts: Verdict, made_with: str = "flexmb 1.2, AMD", verbosity: Verbosity = Verbosity.NORMAL) -> str:
    screen = io.StringIO()
    cases = {verdict.case: [one for one in verdicts if one.case == verdict.case] for verdict in verdicts}
    outcome = SessionOutcome(verdicts=cases, absences=[], made_with=made_with)
    print_outcome(Console(file=screen, width=80), outcome, verbosity)
    return screen.getvalue()


def test_stale_figures_take_one_line_with_their_reasons_and_one_command() -> None:
    stale = [msgspec.structs.replace(GOOD, case=f"family/{name}", stale="other efforts") for name in ("one", "a b")]
    said = shown_lines(*stale, stale[0], msgspec.structs.replace(GOOD, stale="another scene, times or scale"))
    assert said.count("stale") == 1
    assert "4 accepted figures of 2 cases are stale (other efforts: 3; another scene, times or scale: 1)" in said
    assert "crosscheck run family/one 'family/a b' --accept" in said
    assert "1 accepted figure is stale (other efforts)" in shown_lines(stale[0])
    assert "stale" not in shown_lines(GOOD)


def test_what_is_worse_says_what_differs_and_what_to_do() -> None:
    worse = msgspec.structs.replace(GOOD, worse="U is 1e-05, accepted were 1e-08")
    said = shown_lines(GOOD, worse)
    assert "more than 10 times" in said and "(flexmb 1.2, AMD)" in said and "crosscheck run family/one --accept" in said
    assert "more than 10 times" not in shown_lines(GOOD)


@pytest.mark.parametrize("stale", ["", "other efforts"])
def test_the_headline_alone_where_it_is_asked_for(stale: str) -> None:
    worse = msgspec.structs.replace(GOOD, worse="U is 1e-05, accepted were 1e-08", stale=stale)
    assert shown_lines(worse, verbosity=Verbosity.QUIET).count("\n") == 1
