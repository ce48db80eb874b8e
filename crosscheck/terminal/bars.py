"""Progress bars: description, count, elapsed time and time left."""

from __future__ import annotations

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    TextColumn,
    TimeElapsedColumn,
)
from rich.table import Column

WIDE = 80  # least columns of a terminal for a bar and the time left beside the description


def bars(console: Console, time_left: ProgressColumn, *, quiet: bool = False) -> Progress:
    """Bars that disappear when they end; a narrow terminal shows descriptions and counts only.

    A long description is continued in the next line.
    """
    place = Column(overflow="fold")
    description = TextColumn("{task.description}", markup=False, table_column=place)  # it contains names
    counts = MofNCompleteColumn(), TimeElapsedColumn()
    wide = console.width >= WIDE
    rest = (BarColumn(bar_width=24), *counts, time_left) if wide else counts
    return Progress(SpinnerColumn(), description, *rest, console=console, transient=True, disable=quiet)
