"""The outcome of a session on the terminal."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from rich.console import Console
from rich.table import Table
from rich.text import Text

from crosscheck.judging.outcome import SessionOutcome
from crosscheck.judging.verdict import STATUSES, Verdict
from crosscheck.terminal.text import marked, words

SHOWN = 20


def print_outcome(console: Console, outcome: SessionOutcome) -> int:
    """Show the verdicts; returns the exit code: 0 where all is as expected, else 1."""
    if outcome.all:
        console.print(_verdict_table(outcome.all))
    for group in list(_groups(outcome.unexpected).values())[:SHOWN]:
        worst = max(group, key=lambda verdict: verdict.E or 0.0)
        channels = worst.channel if len(group) == 1 else f"{len(group)} channels, worst {worst.channel}"
        where = f"{worst.case}, {worst.comparison}, {worst.pair}, {channels}"
        text = f"{worst.status}, expected {worst.expected}: {worst.reason}"
        console.print(marked("✕", "red", f"{where}: {text}"), soft_wrap=True)
    for each in outcome.lost:
        where = f"{each.case}, {each.variant}, {each.engine}"
        console.print(marked("–", "yellow", f"{where} {each.status}: {each.reason}"), soft_wrap=True)
    for case in outcome.idle:
        console.print(marked("–", "yellow", f"{case}: nothing was compared"), soft_wrap=True)
    for verdict in outcome.worse[:SHOWN]:
        console.print(marked("!", "yellow", f"{_place(verdict)} worse than recorded: {verdict.worse}"), soft_wrap=True)
    for verdict in outcome.unrecorded[:SHOWN] if outcome.strict else ():
        console.print(marked("!", "yellow", f"{_place(verdict)} has no accepted figures"), soft_wrap=True)
    for line in outcome.broken[:SHOWN]:
        console.print(marked("✕", "red", line), soft_wrap=True)
    colour = "green" if outcome.ok else "red"
    console.print(words(outcome.headline, f"bold {colour}"))
    return 0 if outcome.ok else 1


def _place(verdict: Verdict) -> str:
    return f"{verdict.case}, {verdict.comparison}, {verdict.pair}, {verdict.channel}"


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
        shown = "" if case == previous else case
        table.add_row(words(shown), words(name), words(f"{good} of {len(group)}", colour), *cells)
        previous = case
    return table


def _count(group: list[Verdict], status: str) -> Text:
    found = [verdict for verdict in group if verdict.status == status]
    return words(str(len(found) or ""), "green" if all(verdict.ok for verdict in found) else "red")


def _groups(verdicts: Iterable[Verdict]) -> dict[tuple[str, ...], list[Verdict]]:
    """Verdicts of one pair in one comparison with one status, together."""
    groups: dict[tuple[str, ...], list[Verdict]] = {}
    for verdict in verdicts:
        groups.setdefault((verdict.case, verdict.comparison, verdict.pair, verdict.status), []).append(verdict)
    return groups


