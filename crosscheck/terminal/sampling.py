"""A sweep on the terminal: a bar while it runs, a table of its statistics, and failures."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import TimeRemainingColumn

from crosscheck.sampling.statistics import Distribution, Estimated, SweepSummary
from crosscheck.terminal.progress import bars
from crosscheck.terminal.text import marked, words
from flexmb.output.listing import Listing, figures, names

QUANTILES = {"0.05": "5 %", "0.5": "median", "0.95": "95 %"}
SHOWN = 5  # failures; summary.json has all


@contextmanager
def sampling_bar(console: Console) -> Iterator[Callable[[int, int, int], None]]:
    """A listener that moves a bar."""
    with bars(console, TimeRemainingColumn()) as progress:
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


def _table(summary: SweepSummary) -> Listing:
    table = Listing(*names("quantity", "in"), *figures("value", "standard error"))
    several = len({each.engine for each in summary.distributions}) > 1
    for each in summary.distributions:
        name = f"{each.quantity} · {each.engine}" if several else each.quantity
        for statistic, number, its_error in _lines(each):
            table.add(name, statistic, number, its_error)
    return table


def _lines(each: Distribution) -> Iterator[tuple[str, str, str]]:
    """Statistic, value, standard error."""
    estimates = [("mean", each.mean), ("standard deviation", each.sd)]
    estimates += [(QUANTILES.get(p, p), quantile) for p, quantile in each.quantiles.items()]
    for name, estimate in estimates:
        if estimate is not None:
            error = estimate.standard_error
            yield name, _digits(estimate), "" if error is None else f"{error:.2g}"
    yield f"lowest, sample {each.lowest_at}", f"{each.lowest:.7g}", ""
    yield f"highest, sample {each.highest_at}", f"{each.highest:.7g}", ""


def _digits(estimate: Estimated) -> str:
    """An estimate with the digits that its standard error permits."""
    value, error = estimate.value, estimate.standard_error
    if not error or not value:
        return f"{value:.7g}"
    count = math.floor(math.log10(abs(value))) - math.floor(math.log10(error)) + 2
    return f"{value:.{min(max(count, 2), 15)}g}"
