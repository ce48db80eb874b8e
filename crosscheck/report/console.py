"""Tables for the terminal."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from rich.console import Console
from rich.markup import escape
from rich.table import Column, Table

from crosscheck.engine_list import EngineState
from crosscheck.library import Case
from crosscheck.report.outcome import Outcome
from crosscheck.report.summary import pair
from crosscheck.verdict import Verdict

STATUSES = ("agree", "differ", "unresolved", "refused", "failed", "did not run")
SHOWN = 20


def print_outcome(console: Console, outcome: Outcome) -> int:
    """Show the verdicts; returns the exit code: 0 where all is as expected, else 1."""
    if outcome.all:
        console.print(_verdict_table(outcome.all))
    for group in list(_groups(outcome.unexpected).values())[:SHOWN]:
        worst = max(group, key=lambda verdict: verdict.E or 0.0)
        channels = worst.channel if len(group) == 1 else f"{len(group)} channels, worst {worst.channel}"
        where = f"{worst.case}, {worst.comparison}, {pair(worst)}, {channels}"
        text = f"{worst.status}, expected {worst.expected}: {worst.reason}"
        console.print(f"[red]✕[/red] {escape(where)}: {escape(text)}", highlight=False, soft_wrap=True)
    for each in outcome.not_run:
        where = f"{each.case}, {each.variant}, {each.engine}"
        console.print(f"[yellow]–[/yellow] {escape(where)} did not run: {escape(each.reason)}", soft_wrap=True)
    for line in outcome.broken[:SHOWN]:
        console.print(f"[red]✕[/red] {escape(line)}", highlight=False, soft_wrap=True)
    colour = "green" if outcome.ok else "red"
    console.print(f"[bold {colour}]{outcome.headline}[/bold {colour}]")
    return 0 if outcome.ok else 1


def _verdict_table(verdicts: Sequence[Verdict]) -> Table:
    """Counts of statuses by case and comparison; green what is as expected, red what is not."""
    occurring = [status for status in STATUSES if any(verdict.status == status for verdict in verdicts)]
    table = Table("case", "comparison", "as expected", *occurring, header_style="bold")
    groups: dict[tuple[str, str], list[Verdict]] = {}
    for verdict in verdicts:
        name = "negative controls" if verdict.kind == "control" else verdict.comparison
        groups.setdefault((verdict.case, name), []).append(verdict)
    previous = ""
    for (case, name), group in groups.items():
        good = sum(verdict.ok for verdict in group)
        colour = "green" if good == len(group) else "red"
        cells = [_count(group, status) for status in occurring]
        shown = "" if case == previous else escape(case)
        table.add_row(shown, escape(name), f"[{colour}]{good} of {len(group)}[/{colour}]", *cells)
        previous = case
    return table


def _count(group: list[Verdict], status: str) -> str:
    found = [verdict for verdict in group if verdict.status == status]
    if not found:
        return ""
    return f"[{'green' if all(verdict.ok for verdict in found) else 'red'}]{len(found)}[/]"


def _groups(verdicts: Iterable[Verdict]) -> dict[tuple[str, ...], list[Verdict]]:
    """Verdicts of one pair in one comparison with one status, together."""
    groups: dict[tuple[str, ...], list[Verdict]] = {}
    for verdict in verdicts:
        groups.setdefault((verdict.case, verdict.comparison, pair(verdict), verdict.status), []).append(verdict)
    return groups


def cases_table(cases: Iterable[Case]) -> Table:
    """The case library."""
    table = Table("case", "title", "tags", "variants", "engines", header_style="bold")
    for case in cases:
        engines = dict.fromkeys(name for each in case.run.variants for name in (*each.engines, *each.also))
        variants = ", ".join(variant.name for variant in case.run.variants)
        table.add_row(case.name, case.run.title, ", ".join(case.run.tags), variants, ", ".join(engines))
    return table


def engines_table(states: Iterable[EngineState]) -> Table:
    """The engines."""
    table = Table(Column("engine", no_wrap=True), "what it is", "version", "how to install", header_style="bold")
    for state in states:
        version = (
            "[yellow]not installed[/yellow]" if state.version is None else f"[green]{escape(state.version)}[/green]"
        )
        table.add_row(state.name, escape(state.summary), version, escape(state.advice))
    return table
