"""A sweep on the terminal: a bar while it runs, a table of its statistics, and what gave no result."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    SpinnerColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Column, Table

from crosscheck.sampling.statistics import Distribution, Estimated, SweepSummary
from crosscheck.terminal.text import marked, words

SHOWN = 5  # failures; summary.json has all


@contextmanager
def sampling_bar(console: Console) -> Iterator[Callable[[int, int, int], None]]:
    """A listener that moves a bar."""
    with Progress(
        SpinnerColumn(), TextColumn("{task.description}", markup=False), BarColumn(bar_width=24), MofNCompleteColumn(),
        TimeElapsedColumn(), TimeRemainingColumn(), console=console, transient=True,
    ) as progress:  # fmt: skip
        task = progress.add_task("samples", total=None)

        def hear(done: int, known: int, lost: int) -> None:
            without = f", {lost} without a result" if lost else ""
            progress.update(task, completed=done, total=known, description=f"samples{without}")

        yield hear


def print_summary(console: Console, summary: SweepSummary) -> None:
    """Statistics with their standard errors, and failures."""
    console.print(_table(summary))
    for failure in summary.failures[:SHOWN]:
        place = ", ".join(f"{name} = {value:g}" for name, value in failure.parameters.items())
        what = " ".join(failure.message.split())
        text = f"sample {failure.sample} in {failure.engine} ({place}): {failure.status}: {what}"
        console.print(marked("✕", "red", text), soft_wrap=True)
    if len(summary.failures) > SHOWN:
        console.print(words(f"... and {len(summary.failures) - SHOWN} more without a result"))
    counts = ", ".join(f"{count} {status}" for status, count in summary.statuses.items())
    console.print(words(f"{summary.samples} samples: {counts}", "bold green" if summary.ok else "bold red"))


def _table(summary: SweepSummary) -> Table:
    texts = ("quantity", "engine")
    numbers = ("samples", "mean", "sd", "5 %", "median", "95 %", "lowest", "highest")
    table = Table(*texts, *(Column(name, justify="right") for name in numbers), header_style="bold")
    for each in summary.distributions:
        table.add_row(words(each.quantity), words(each.engine), *map(words, _cells(each)))
    return table


def _cells(each: Distribution) -> list[str]:
    estimates = (each.mean, each.sd, *(each.quantiles.get(p) for p in ("0.05", "0.5", "0.95")))
    return [str(each.count), *map(_cell, estimates), f"{each.lowest:.6g}", f"{each.highest:.6g}"]


def _cell(estimate: Estimated | None) -> str:
    if estimate is None:
        return "-"
    if estimate.standard_error is None:
        return f"{estimate.value:.6g}"
    return f"{estimate.value:.6g} ± {estimate.standard_error:.2g}"
