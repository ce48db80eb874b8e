"""Invariances on the terminal: cases by invariances, then what differs."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console
from rich.text import Text

from crosscheck.biting.invariance_runs import InvarianceVerdict
from crosscheck.biting.invariances import INVARIANCES
from crosscheck.terminal.text import words
from flexmb.output.listing import Listing, names

MARKS = {"agree": "✓", "not applicable": "–"}
STYLES = {"agree": "green", "not applicable": "dim"}


def print_invariances(console: Console, verdicts: Sequence[InvarianceVerdict], verbose: bool = False) -> int:
    """Print the verdicts; the exit code: 1 where one is neither *agree* nor *not applicable*."""
    table = Listing(*names("case", *(each.name for each in INVARIANCES)))
    for case in dict.fromkeys(verdict.case for verdict in verdicts):
        row = {verdict.invariance: verdict.status for verdict in verdicts if verdict.case == case}
        table.add(case, *(_cell(row[each.name]) for each in INVARIANCES))
    console.print(table)
    console.print(words("✓ the results are the same, – the invariance says nothing about the scene"))
    for verdict in verdicts:
        if not verdict.ok or verbose:
            style = STYLES.get(verdict.status, "red")
            console.print(words(_line(verdict), style), soft_wrap=True)
    return 0 if all(verdict.ok for verdict in verdicts) else 1


def _cell(status: str) -> Text:
    return words(MARKS.get(status, status), STYLES.get(status, "red"))


def _line(verdict: InvarianceVerdict) -> str:
    where = f" {verdict.channel}:" if verdict.channel else ""
    more = f" ({len(verdict.differing)} of {verdict.channels} channels differ)" if verdict.differing else ""
    return f"{verdict.case}: {verdict.invariance}: {verdict.status}:{where} {verdict.reason}{more}"
