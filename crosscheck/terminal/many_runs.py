"""Stability maps and sweeps on the terminal: a bar while they run, then verdicts or statistics, and failures."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from rich.console import Console
from rich.progress import TimeRemainingColumn
from rich.text import Text

from crosscheck.running.scheduler import Limits, Scheduler
from crosscheck.sampling.outputs import Distribution, Estimated, SweepSummary
from crosscheck.stability.map import StabilityMap
from crosscheck.stability.picture import draw
from crosscheck.stability.run import Finished, run_map
from crosscheck.stability.verdict_file import VERDICTS, take_away_verdicts, write_verdicts
from crosscheck.terminal.progress import bars
from crosscheck.terminal.text import marked, words
from flexmb.output.files import folder, take_away
from flexmb.output.listing import Listing, figures, names


def run_and_draw(
    console: Console, chosen: Mapping[str, str], out: Path, pictures: Path, *, depth: int | None, fresh: bool,
    limits: Limits, scheduler: Scheduler,
) -> int:  # fmt: skip
    """Run maps, each from its provider, draw them, write their verdicts; the exit code: 0 if all agree, else 1."""
    verdicts = []
    folder(pictures)
    take_away_verdicts(list(chosen), pictures / VERDICTS)
    for name in chosen:
        take_away(pictures / f"{name}.svg")
    for name, provider in chosen.items():
        run = partial(run_map, name, out / f"{name}.jsonl", provider=provider)
        done = _run_map(console, name, partial(run, depth=depth, fresh=fresh, limits=limits, scheduler=scheduler))
        picture = draw(done, pictures / f"{name}.svg")
        verdicts.append(done.verdict)
        write_verdicts([done.verdict], pictures / VERDICTS)  # one by one: another process may write its own
        console.print(_verdict_line(done, picture), soft_wrap=True)
    good = sum(verdict.ok for verdict in verdicts)
    colour = "green" if good == len(verdicts) else "red"
    console.print(words(f"{good} of {len(verdicts)} maps agree with their overlays", f"bold {colour}"))
    return 0 if good == len(verdicts) else 1


def _run_map(console: Console, name: str, run: Callable[..., Finished]) -> Finished:
    with bars(console, TimeRemainingColumn()) as progress:
        task = progress.add_task(name, total=None)

        def hear(what: StabilityMap, done: int, known: int) -> None:
            progress.update(task, completed=done, total=known, description=f"{name}: cells known so far")

        return run(listener=hear)


def _verdict_line(done: Finished, picture: Path) -> Text:
    verdict = done.verdict
    cells = ", ".join(f"{count} {name}" for name, count in verdict.cells.items())
    far = "beyond the map" if verdict.distance < 0 else f"{verdict.distance}"
    text = f"{verdict.map}: {verdict.status}, farthest cell from the overlay {far}; {cells}; {verdict.seconds:.0f} s"
    worst = "" if verdict.ok or not verdict.worst else f"; {verdict.worst}"
    mark = ("✓", "green") if verdict.ok else ("✕", "red")
    return marked(*mark, f"{text}{worst} -> {picture}")


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
    several = len({distribution.engine for distribution in summary.distributions}) > 1
    for distribution in summary.distributions:
        name = f"{distribution.quantity} · {distribution.engine}" if several else distribution.quantity
        for statistic, number, its_error in _lines(distribution):
            table.add(name, statistic, number, its_error)
    return table


def _lines(distribution: Distribution) -> Iterator[tuple[str, str, str]]:
    """Statistic, value, standard error."""
    estimates = [("mean", distribution.mean), ("standard deviation", distribution.sd)]
    estimates += [(QUANTILES.get(p, p), quantile) for p, quantile in distribution.quantiles.items()]
    for name, estimate in estimates:
        if estimate is not None:
            error = estimate.standard_error
            yield name, _digits(estimate), "" if error is None else f"{error:.2g}"
    yield f"lowest, sample {distribution.lowest_at}", f"{distribution.lowest:.7g}", ""
    yield f"highest, sample {distribution.highest_at}", f"{distribution.highest:.7g}", ""


def _digits(estimate: Estimated) -> str:
    """An estimate with the digits that its standard error permits."""
    value, error = estimate.value, estimate.standard_error
    if not error or not value:
        return f"{value:.7g}"
    count = math.floor(math.log10(abs(value))) - math.floor(math.log10(error)) + 2
    return f"{value:.{min(max(count, 2), 15)}g}"
