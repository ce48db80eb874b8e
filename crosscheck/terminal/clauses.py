"""The outcome of the contract's clauses on the terminal."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console

from crosscheck.conformance.trial import ClauseOutcome, ClauseStatus, to_offer, verdict_on
from crosscheck.terminal.text import marked, words
from crosscheck.terminal.verbosity import Verbosity

MARKS: dict[ClauseStatus, tuple[str, str]] = {
    "holds": ("✓", "green"), "broken": ("✕", "red"), "not offered": ("⊘", "yellow"), "missing": ("–", "yellow"),
}  # fmt: skip


def print_clauses(console: Console, name: str, outcomes: Sequence[ClauseOutcome], verbosity: Verbosity) -> None:
    """What is broken, with the sentence of the contract; what to offer for clauses that were not tried, in a line each;
    the headline last. With VERBOSE every clause."""
    for each in outcomes:
        if verbosity is Verbosity.VERBOSE or (verbosity is Verbosity.NORMAL and each.status == "broken"):
            text = f"{each.clause}: {each.status}" + (f": {each.message}" if each.message else "")
            console.print(marked(*MARKS[each.status], text), soft_wrap=True)
            if each.status == "broken":
                console.print(words(f"  the contract says: {each.sentence}"), soft_wrap=True)
    for offer, clauses in to_offer(list(outcomes)).items() if verbosity is not Verbosity.QUIET else ():
        many = f"{len(clauses)} clauses are" if len(clauses) > 1 else "1 clause is"
        console.print(marked("⊘", "yellow", f"{many} tried if you {offer}: {', '.join(clauses)}"), soft_wrap=True)
    verdict = verdict_on(list(outcomes))
    colour = "red" if not verdict.kept else "green" if verdict.whole else "yellow"
    console.print(words(f"{name}: {verdict.text}", f"bold {colour}"), soft_wrap=True)
