"""Tables for the terminal."""

from __future__ import annotations

from collections.abc import Iterable

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from crosscheck.engine_list import EngineState
from crosscheck.library import Case
from crosscheck.report.outcome import Outcome
from crosscheck.report.summary import pair
from crosscheck.report.views import Cell, overview

LOOKS = {"good": "green", "expected": "blue", "bad": "bold red", "empty": "dim"}
SHOWN = 20


def print_outcome(console: Console, outcome: Outcome) -> int:
    """Show the verdicts; returns the exit code: 0 where all is as expected, else 1."""
    table = Table(title=None, header_style="bold", show_lines=False)
    view = overview(outcome.verdicts)
    table.add_column("case, comparison")
    for column in view.columns:
        table.add_column(column)
    for row in view.rows:
        table.add_row(f"[bold]{escape(row.label)}[/bold]", *map(_cell, row.cells))
        for below in row.rows:
            table.add_row(f"  {escape(below.label)}", *map(_cell, below.cells))
    if view.rows:
        console.print(table)
    for verdict in outcome.unexpected[:SHOWN]:
        where = f"{verdict.case}, {verdict.comparison}, {verdict.channel}, {pair(verdict)}"
        text = f"{verdict.status}, expected {verdict.expected}: {verdict.reason}"
        console.print(f"[red]✕[/red] {escape(where)}: {escape(text)}", highlight=False, soft_wrap=True)
    if len(outcome.unexpected) > SHOWN:
        console.print(f"... and {len(outcome.unexpected) - SHOWN} more, in the report")
    for each in outcome.not_run:
        where = f"{each.case}, {each.variant}, {each.engine}"
        console.print(f"[yellow]–[/yellow] {escape(where)} did not run: {escape(each.reason)}", soft_wrap=True)
    colour = "green" if outcome.ok else "red"
    console.print(f"[bold {colour}]{outcome.headline}[/bold {colour}]")
    return 0 if outcome.ok else 1


def cases_table(cases: Iterable[Case]) -> Table:
    """The case library."""
    table = Table("case", "title", "tags", "variants", "engines", header_style="bold")
    for case in cases:
        engines = dict.fromkeys(engine for variant in case.run.variants for engine in variant.engines)
        variants = ", ".join(variant.name for variant in case.run.variants)
        table.add_row(case.name, case.run.title, ", ".join(case.run.tags), variants, ", ".join(engines))
    return table


def engines_table(states: Iterable[EngineState]) -> Table:
    """The engines."""
    table = Table("engine", "version", "how to install", header_style="bold")
    for state in states:
        version = (
            "[yellow]not installed[/yellow]" if state.version is None else f"[green]{escape(state.version)}[/green]"
        )
        table.add_row(state.name, version, escape(state.advice))
    return table


def _cell(cell: Cell) -> str:
    if not cell.text:
        return ""
    return f"[{LOOKS[cell.look]}]{cell.symbol} {escape(cell.text)}[/]"
