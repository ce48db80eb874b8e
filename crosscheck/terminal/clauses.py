"""How an engine keeps the contract, on the terminal."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console

from crosscheck.conformance.trial import ClauseOutcome, ClauseStatus, verdict_on
from crosscheck.terminal.text import marked, words
from crosscheck.terminal.verbosity import Verbosity

MARKS: dict[ClauseStatus, tuple[str, str]] = {
    "holds": ("✓", "green"), "broken": ("✕", "red"), "not offered": ("⊘", "yellow"), "missing": ("–", "yellow"),
}  # fmt: skip


def print_clauses(console: Console, name: str, outcomes: Sequence[ClauseOutcome], verbosity: Verbosity) -> None:
    """What is broken, with the sentence of the contract; all clauses with VERBOSE; the headline last."""
    for each in outcomes:
        if verbosity is Verbosity.VERBOSE or (verbosity is Verbosity.NORMAL and each.status == "broken"):
            text = f"{each.clause}: {each.status}" + (f": {each.message}" if each.message else "")
            console.print(marked(*MARKS[each.status], text), soft_wrap=True)
            if each.status == "broken":
                console.print(words(f"  the contract says: {each.sentence}"), soft_wrap=True)
    good, text = verdict_on(list(outcomes))
    console.print(words(f"{name}: {text}", "bold green" if good else "bold red"), soft_wrap=True)
