"""Bars of progress: what runs, how many of how many are done, since when, and for how long still."""

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

WIDE = 80  # columns of a terminal, from which a bar and the time left have a place beside a description


def bars(console: Console, time_left: ProgressColumn, *, quiet: bool = False) -> Progress:
    """Bars that disappear when they end; a narrow terminal shows descriptions and counts only.

    A description that is longer than its place goes on in the next line.
    """
    place = Column(overflow="fold")
    description = TextColumn("{task.description}", markup=False, table_column=place)  # names stand in it
    counts = MofNCompleteColumn(), TimeElapsedColumn()
    wide = console.width >= WIDE
    rest = (BarColumn(bar_width=24), *counts, time_left) if wide else counts
    return Progress(SpinnerColumn(), description, *rest, console=console, transient=True, disable=quiet)
