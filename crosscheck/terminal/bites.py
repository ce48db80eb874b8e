"""Mutation scores on the terminal: a line for each case, then every fault that was missed."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console

from crosscheck.biting.score import ENOUGH, CaseBite, Mutant, mean
from crosscheck.terminal.text import words
from flexmb.output.listing import Listing, figures, names


def print_bites(console: Console, bites: Sequence[CaseBite], verbose: bool = False) -> int:
    """Print the scores; the exit code: 1 if the mean score is too low or something was not judged."""
    console.print(_table(bites))
    for each in bites:
        for mutant in each.missed:
            console.print(words(f"missed: {each.case}: {_named(mutant)}: {mutant.reason}", "yellow"), soft_wrap=True)
        for mutant in each.not_judged:
            console.print(words(f"not judged: {each.case}: {_named(mutant)}: {mutant.reason}", "red"), soft_wrap=True)
        if verbose:
            _details(console, each)
    score = mean(each.score for each in bites)
    judged = not any(each.not_judged or each.score is None for each in bites)
    good = judged and score is not None and score >= ENOUGH
    console.print(words(f"Mean mutation score {_figure(score)}; {ENOUGH:g} is asked for.", "green" if good else "red"))
    console.print(words(f"By the stored references alone {_figure(mean(each.score_by_reference for each in bites))}."))
    return 0 if good else 1


def _table(bites: Sequence[CaseBite]) -> Listing:
    table = Listing(*names("case"), *figures("noticed", "score", "at goals", "reference"))
    for each in bites:
        counted = each.counted
        noticed = sum(mutant.outcome == "noticed" for mutant in counted)
        scores = map(_figure, (each.score, each.score_at_goals, each.score_by_reference))
        table.add(each.case, f"{noticed}/{len(counted)}", *scores)
    return table


def _figure(score: float | None) -> str:
    return "–" if score is None else f"{score:.3f}"


def _details(console: Console, each: CaseBite) -> None:
    console.print(words(f"  {each.case}: variant {each.variant}, run by {each.engine}"), soft_wrap=True)
    for name, score in each.channels.items():
        console.print(words(f"  {each.case}: {name}: {score.noticed} of {score.mutants}"), soft_wrap=True)
    for mutant in each.mutants:
        referred = f"; by the reference {mutant.by_reference}" if mutant.by_reference else ""
        text = f"  {each.case}: {_named(mutant)}: {mutant.outcome}{referred}: {mutant.reason}"
        console.print(words(text), soft_wrap=True)
    if each.no_reference:
        console.print(words(f"  {each.case}: by reference: nothing: {each.no_reference}"), soft_wrap=True)
    for passed in each.passed_over:
        where = f" of {passed.target}" if passed.target else ""
        console.print(words(f"  {each.case}: {passed.mutation}{where}: passed over: {passed.reason}"), soft_wrap=True)


def _named(mutant: Mutant) -> str:
    return f"{mutant.mutation} of {mutant.target}" if mutant.target else mutant.mutation
