"""Progress of a session: a bar over all jobs, a line for each running job, and a lasting line for ended ones."""

from __future__ import annotations

import time
from collections.abc import Sequence
from types import TracebackType

from rich.console import Console
from rich.progress import TaskID
from rich.text import Text

from crosscheck.records.kinds import RunRecord
from crosscheck.running.expected import Remaining
from crosscheck.running.job import Job
from crosscheck.running.scheduler import Event
from crosscheck.terminal.bars import bars
from crosscheck.terminal.heartbeat import Heartbeat
from crosscheck.terminal.time_left import TimeLeft
from crosscheck.terminal.verbosity import Verbosity
from flexmb.output.printable import printable

MARKS = {
    "finished": "[green]✓[/green]",
    "diverged": "[magenta]✕[/magenta]",
    "failed": "[red]✕[/red]",
    "crashed": "[red]✕[/red]",
    "did not finish": "[red]✕[/red]",
    "refused": "[yellow]⊘[/yellow]",
    "did not run": "[yellow]–[/yellow]",
}


class LiveProgress:
    """A context in which `hear` shows the events of a session; without a terminal only lasting lines are printed.

    Only VERBOSE has lasting lines, one for every job; otherwise failures are shown at the end. QUIET shows no bar.
    Where output is redirected, a line every half a minute says that the session goes on, unless it is QUIET.
    """

    def __init__(self, console: Console, verbosity: Verbosity = Verbosity.VERBOSE) -> None:
        self._lasting = verbosity is Verbosity.VERBOSE
        self.bars = bars(console, TimeLeft(), quiet=verbosity is Verbosity.QUIET)
        self._overall: TaskID | None = None
        self._remaining = Remaining()
        self._begin = 0.0
        self._lines: dict[int, TaskID] = {}
        self._records: dict[int, list[RunRecord]] = {}
        self._started: dict[int, float] = {}
        beats = verbosity is not Verbosity.QUIET and not console.is_terminal
        self._heartbeat = Heartbeat(console) if beats else None

    def __enter__(self) -> LiveProgress:
        self.bars.start()
        if self._heartbeat is not None:
            self._heartbeat.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if self._heartbeat is not None:
            self._heartbeat.stop()
        self.bars.stop()

    def hear(self, jobs: Sequence[Job], event: Event) -> None:
        """Show one event."""
        if self._heartbeat is not None:
            self._heartbeat.hear(jobs, event)
        if self._overall is None:
            self._overall = self.bars.add_task("all runs", total=len(jobs))
            self._remaining.expect((number, job.engine, job.expected_s) for number, job in enumerate(jobs))
            self._begin = time.monotonic()
        title = printable(jobs[event.job].title)
        if event.kind == "started":
            self._started[event.job] = time.perf_counter()
            self._remaining.started(event.job, time.monotonic() - self._begin)
            self._records[event.job] = []
            self._lines[event.job] = self.bars.add_task(f"{title}: starting", total=None, running=True)
        elif event.kind == "emitted" and isinstance(event.content, RunRecord):
            self._records[event.job].append(event.content)
        elif event.kind == "emitted" and isinstance(event.content, str):
            self.bars.update(self._lines[event.job], description=f"{title}: {printable(event.content)}")
        elif event.kind != "emitted":
            self.bars.remove_task(self._lines.pop(event.job))
            now = time.monotonic()
            self._remaining.ended(event.job, now - self._begin)
            seconds = self._remaining.seconds(now - self._begin)
            self.bars.update(self._overall, advance=1, ends_at=None if seconds is None else now + seconds)
            if self._lasting:
                self.bars.console.print(self._ending(title, event))

    def _ending(self, title: str, event: Event) -> Text:
        """The lasting line of a job."""
        if event.kind in ("crashed", "stopped"):
            status = "crashed" if event.kind == "crashed" else "did not finish"
            return _line(status, f"{title}: {status}: {event.content}")
        records, spent = self._records[event.job], time.perf_counter() - self._started[event.job]
        if not records:
            return _line("finished", f"{title}: already recorded")
        last = records[-1]
        if last.status != "finished":
            return _line(last.status, f"{title}: {last.status}: {_in_short(last.message)}")
        efforts = f"{len(records)} effort{'s' if len(records) > 1 else ''}"
        return _line("finished", f"{title}: {efforts} in {spent:.1f} s")


def _line(status: str, text: str) -> Text:
    """The mark of a status, and literal text: names and messages may look like markup."""
    return Text.from_markup(MARKS[status]) + Text(" " + printable(text))


def _in_short(message: str) -> str:
    """The headline of a message, its first problem and the remedy on one line; reports have the rest."""
    return " ".join(" ".join(message.splitlines()[:3]).split())
