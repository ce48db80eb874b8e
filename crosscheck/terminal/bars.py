"""Progress bars: a line for the whole with bar, count, elapsed time and time left, and a line for each running job."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from rich.console import Console, RenderableType
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    Task,
    TextColumn,
    TimeElapsedColumn,
)
from rich.table import Column, Table

WIDE = 60  # least columns of a terminal for a bar and the elapsed time beside count and time left
LONGEST, BESIDES = 24, 50  # columns of a bar, and of what stands beside it


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
        whole: list[ProgressColumn] = [each for each in self.columns if isinstance(each, ProgressColumn)]
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
