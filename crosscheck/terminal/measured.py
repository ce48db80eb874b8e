"""Measured sets on the terminal: which there are, the verdict of each series, and the budget of each point."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from crosscheck.terminal.text import words
from flexmb.output.listing import Listing, figures, names, prose

if TYPE_CHECKING:
    from crosscheck.validation.budget import Budget
    from crosscheck.validation.measured_set import MeasuredSet
    from crosscheck.validation.model import Listener


def sets_table(sets: Iterable[MeasuredSet]) -> Listing:
    """The measured sets."""
    table = Listing(*names("set"), *prose("title", "physics"), *figures("points"))
    for measured in sets:
        table.add(measured.name, measured.content.title, measured.content.physics, str(len(measured.points)))
    return table


def series_table(budget: Budget) -> Listing:
    """One row for each series; errors and uncertainties are relative to its size."""
    split = budget.of.content.split
    along = (f"horizon, {split.horizon}",) if split is not None and split.horizon else ()
    table = Listing(
        *names("series", "verdict"), *figures("within", "E rms", "E largest", "u_val rms", *along),
        *prose("not as the file says"), title=budget.of.content.title,
    )  # fmt: skip
    for verdict in budget.verdicts():
        standing = "validated within u_val" if verdict.standing == "validated" else "model error"
        numbers = [f"{value:.2%}" for value in (verdict.rms, verdict.largest, verdict.u_val)]
        numbers += [f"{verdict.horizon:.3g}" for _ in along]
        table.add(
            verdict.series.name, words(standing, "green" if verdict.ok else "red"),
            f"{verdict.within} of {verdict.points}", *numbers, verdict.fault,
        )  # fmt: skip
    return table


def identified_table(budget: Budget) -> Listing:
    """The inputs that were identified, as they were found, and their deviations."""
    found, content = budget.identified, budget.of.content
    title = "" if found is None else f"by {found.readings} readings, misfit {found.misfit:.2f}"
    table = Listing(*names("identified"), *figures("value", "deviation"), *names("unit"), title=title)
    for given in content.inputs:
        if given.name in content.fit:
            table.add(given.name, f"{given.value:.5g}", f"{given.deviation:.2g}", given.unit)
    return table


def points_table(budget: Budget) -> Listing:
    """One row for each point, in the unit of its series, with the input that contributes most."""
    sampled = budget.sampled
    more = () if sampled is None else ("sampled",)
    table = Listing(
        *names("series", "conditions"), *figures("D", "S", "E", "u_num", "u_input", *more, "u_D", "E / u_val"),
        *prose("most by"),
    )  # fmt: skip
    for i, point in enumerate(budget.of.points):
        conditions = " ".join(f"{key}={value:g}" for key, value in point.conditions.items())
        columns = [budget.measured, budget.predicted, budget.error, budget.u_num, budget.u_input]
        columns += [*([] if sampled is None else [sampled]), budget.u_D, budget.error / budget.u_val]
        table.add(point.series, conditions, *(f"{column[i]:.3g}" for column in columns), budget.most_by(i))
    return table


@contextmanager
def told_progress(console: Console, name: str) -> Iterator[Listener]:
    """A bar that says how many of a set's evaluations of its model are done; gone at the end."""
    bar = Progress(
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), console=console, transient=True
    )  # fmt: skip
    with bar:
        task = bar.add_task(name, total=None)

        def listener(done: int, of: int) -> None:
            bar.update(task, completed=done, total=of)

        yield listener
