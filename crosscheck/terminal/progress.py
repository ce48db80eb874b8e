"""Progress of a session: a bar over all jobs and a line for each running one, or a line every half a minute.

The bar has count, elapsed time and time left. Output that goes to a file has the lines: a job of continuous integration
that prints nothing for ten minutes is stopped by some services, and looks dead.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable, Sequence
from types import TracebackType

from rich.console import Console, RenderableType
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    Task,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
)
from rich.table import Column, Table
from rich.text import Text

from crosscheck.records.kinds import ChartRecord, RunRecord
from crosscheck.running.expected import Remaining
from crosscheck.running.job import Job
from crosscheck.running.scheduler import Event
from crosscheck.terminal.text import Verbosity, words
from flexmb.output.printable import printable

ENDINGS = {
    "finished": "[green]✓[/green]",
    "diverged": "[magenta]✕[/magenta]",
    "failed": "[red]✕[/red]",
    "crashed": "[red]✕[/red]",
    "did not finish": "[red]✕[/red]",
    "refused": "[yellow]⊘[/yellow]",
    "did not run": "[yellow]–[/yellow]",
}
WIDE = 60  # least columns of a terminal for a bar and the elapsed time beside count and time left
LONGEST, BESIDES = 24, 50  # columns of a bar, and of what stands beside it
NONE = "no estimate yet"
EVERY_S = 30.0
NAMED = 3  # running jobs that a line names


class LiveProgress:
    """A context in which `hear` shows the events of a session; without a terminal only lasting lines are printed.

    Only VERBOSE has lasting lines, one for every job; otherwise failures are shown at the end. QUIET shows no bar.
    Where output is redirected, a line every half a minute says that the session goes on, unless it is QUIET. `first`:
    what is done before the first run.
    """

    def __init__(
        self, console: Console, verbosity: Verbosity = Verbosity.VERBOSE, first: str = "planning the runs"
    ) -> None:
        self._lasting = verbosity is Verbosity.VERBOSE
        self.bars = bars(console, TimeLeft(), quiet=verbosity is Verbosity.QUIET)
        self._overall: TaskID | None = None
        self._remaining = Remaining()
        self._begin = 0.0
        self._heard = 0
        self._lines: dict[int, TaskID] = {}
        self._records: dict[int, list[RunRecord]] = {}
        self._started: dict[int, float] = {}
        beats = verbosity is not Verbosity.QUIET and not console.is_terminal
        self._heartbeat = Heartbeat(console, first=first) if beats else None
        self._first: TaskID | None = self.bars.add_task(first, total=None, running=True)

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
        if self._first is not None:
            self.bars.remove_task(self._first)
            self._first = None
        if self._overall is None:
            self._overall = self.bars.add_task("all runs", total=len(jobs))
            self._begin = time.monotonic()
        if self._heard < len(jobs):  # an outcome may ask for more
            later = enumerate(jobs[self._heard :], start=self._heard)
            self._remaining.expect((number, job.engine, job.expected_s) for number, job in later)
            self._heard = len(jobs)
            self.bars.update(self._overall, total=len(jobs))
        title = printable(jobs[event.job].title)
        if event.kind == "started":
            self._started[event.job] = time.perf_counter()
            self._remaining.started(event.job, time.monotonic() - self._begin)
            self._records[event.job] = []
            self._lines[event.job] = self.bars.add_task(f"{title}: starting", total=None, running=True)
        elif event.kind == "emitted" and isinstance(event.content, RunRecord):
            self._records[event.job].append(event.content)
        elif event.kind == "emitted" and isinstance(event.content, ChartRecord):
            self._records[event.job] += event.content.runs
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
            return _ending_line(event.status_of_end, f"{title}: {event.status_of_end}: {event.content}")
        records, spent = self._records[event.job], time.perf_counter() - self._started[event.job]
        if not records:
            return _ending_line("finished", f"{title}: already recorded")
        last = records[-1]
        if last.status != "finished":
            return _ending_line(last.status, f"{title}: {last.status}: {_in_short(last.message)}")
        efforts = f"{len(records)} effort{'s' if len(records) > 1 else ''}"
        return _ending_line("finished", f"{title}: {efforts} in {spent:.1f} s")


def _ending_line(status: str, text: str) -> Text:
    """The mark of a status, and literal text: names and messages may look like markup."""
    return Text.from_markup(ENDINGS[status]) + Text(" " + printable(text))


def _in_short(message: str) -> str:
    """The headline of a message, its first problem and the remedy on one line; reports have the rest."""
    return " ".join(" ".join(message.splitlines()[:3]).split())


class Bars(Progress):
    """Bars that disappear when they end. A task with the field `running` has no bar.

    Count and times are never cut; a description that is too long for its line is continued in the next one.
    """

    def __init__(self, console: Console, time_left: ProgressColumn, quiet: bool) -> None:
        wide = console.width >= WIDE
        bar = BarColumn(bar_width=min(LONGEST, max(console.width - BESIDES, 1)))
        rest = (
            (bar, MofNCompleteColumn(), TimeElapsedColumn(), time_left) if wide else (MofNCompleteColumn(), time_left)
        )
        described = SpinnerColumn(), TextColumn("{task.description}", markup=False)  # a description contains names
        self._running: Sequence[ProgressColumn] = (*described, TimeElapsedColumn())
        super().__init__(*described, *rest, console=console, transient=True, disable=quiet)

    def get_renderables(self) -> Iterable[RenderableType]:
        """Running jobs below the whole, each kind with columns of its own."""
        tasks = [task for task in self.tasks if task.visible]
        whole: list[ProgressColumn] = [column for column in self.columns if isinstance(column, ProgressColumn)]
        yield _table(whole, [task for task in tasks if not task.fields.get("running")])
        yield _table(self._running, [task for task in tasks if task.fields.get("running")])


def bars(console: Console, time_left: ProgressColumn, *, quiet: bool = False) -> Bars:
    return Bars(console, time_left, quiet)


def _table(columns: Sequence[ProgressColumn], tasks: Sequence[Task]) -> Table:
    """Only the description may be broken, which is the second column."""
    places = [Column(overflow="fold") if number == 1 else Column(no_wrap=True) for number in range(len(columns))]
    table = Table.grid(*places, padding=(0, 1))
    for task in tasks:
        table.add_row(*(column(task) for column in columns))
    return table


class TimeLeft(ProgressColumn):
    """The time until a task's field `ends_at` (s, of `time.monotonic`), as far as it can be estimated."""

    max_refresh = 0.5

    def render(self, task: Task) -> Text:
        ends_at: float | None = task.fields.get("ends_at")
        return Text(NONE if ends_at is None else f"about {in_words(ends_at - time.monotonic())} left", "cyan")


def in_words(seconds: float) -> str:
    """A duration, rounded as an estimate; at least one second."""
    seconds = max(seconds, 1.0)
    for unit, size in (("h", 3600.0), ("min", 60.0)):
        if seconds >= 1.5 * size:
            return f"{seconds / size:.1f} {unit}" if seconds < 9.5 * size else f"{seconds / size:.0f} {unit}"
    return f"{seconds:.0f} s"


class Heartbeat:
    """Hears the events of a session, and prints a line every `every_s` seconds from `start` to `stop`.

    A thread prints, since a long run sends no events.
    """

    def __init__(
        self, console: Console, every_s: float = EVERY_S, clock: Callable[[], float] = time.monotonic,
        first: str = "planning the runs",
    ) -> None:  # fmt: skip
        self._console, self._first = console, first
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
            done = f"{self._done} of {self._count} runs done" if self._count else self._first
            return f"{done} after {in_words(passed)}{left}; {what}"

    def _beat(self) -> None:
        while not self._over.wait(self._every_s):
            self._console.print(words(self.line()), soft_wrap=True)
