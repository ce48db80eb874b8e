"""The outcome of the contract's clauses on the terminal."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from rich.console import Console
from rich.progress import TimeRemainingColumn

from crosscheck.conformance.trial import ClauseOutcome, ClauseStatus, Listener, to_offer, verdict_on
from crosscheck.terminal.progress import EVERY_S, bars
from crosscheck.terminal.text import Verbosity, marked, words

MARKS: dict[ClauseStatus, tuple[str, str]] = {
    "holds": ("✓", "green"), "broken": ("✕", "red"), "not offered": ("⊘", "yellow"), "missing": ("–", "yellow"),
}  # fmt: skip


@contextmanager
def clauses_bar(console: Console, name: str, count: int, quiet: bool) -> Iterator[Listener]:
    """A listener that moves a bar; where the output is no terminal, it prints a line every half a minute."""
    last = time.monotonic()
    with bars(console, TimeRemainingColumn(), quiet=quiet) as progress:
        task = progress.add_task(name, total=count)

        def hear(done: int, clause: str) -> None:
            nonlocal last
            progress.update(task, completed=done, description=f"{name}: {clause}")
            if not quiet and not console.is_terminal and time.monotonic() - last >= EVERY_S:
                last = time.monotonic()
                console.print(words(f"{name}: {done} of {count} clauses tried; {clause} begins"), soft_wrap=True)

        yield hear


def print_clauses(
    console: Console, name: str, outcomes: Sequence[ClauseOutcome], verbosity: Verbosity, chosen: bool = False
) -> None:
    """What is broken, with the sentence of the contract; what to offer for clauses that were not tried, in a line each;
    the headline last. With VERBOSE every clause."""
    for outcome in outcomes:
        if verbosity is Verbosity.VERBOSE or (verbosity is Verbosity.NORMAL and outcome.status == "broken"):
            text = f"{outcome.clause}: {outcome.status}" + (f": {outcome.message}" if outcome.message else "")
            console.print(marked(*MARKS[outcome.status], text), soft_wrap=True)
            if outcome.status == "broken":
                console.print(words(f"  the contract says: {outcome.sentence}"), soft_wrap=True)
    for offer, clauses in to_offer(list(outcomes)).items() if verbosity is not Verbosity.QUIET else ():
        many = f"{len(clauses)} clauses are" if len(clauses) > 1 else "1 clause is"
        console.print(marked("⊘", "yellow", f"{many} tried if you {offer}: {', '.join(clauses)}"), soft_wrap=True)
    verdict = verdict_on(list(outcomes), chosen)
    colour = "red" if not verdict.kept else "green" if verdict.whole else "yellow"
    console.print(words(f"{name}: {verdict.text}", f"bold {colour}"), soft_wrap=True)
