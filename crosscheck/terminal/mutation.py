"""Mutation scores and invariances on the terminal: a line for each case, then what was missed, or what differs."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console
from rich.text import Text

from crosscheck.mutation.invariance_runs import InvarianceVerdict
from crosscheck.mutation.invariances import INVARIANCES
from crosscheck.mutation.score import ENOUGH, Mutant, MutationScore, mean
from crosscheck.terminal.text import words
from flexmb.output.listing import Listing, figures, names

MARKS = {"agree": "✓", "not applicable": "–"}
STYLES = {"agree": "green", "not applicable": "dim"}


def print_mutation_scores(console: Console, scores: Sequence[MutationScore], verbose: bool = False) -> int:
    """Print the scores; the exit code: 1 if the mean score is too low or something was not judged."""
    console.print(_table(scores))
    for of_case in scores:
        for mutant in of_case.missed:
            console.print(words(f"missed: {of_case.case}: {_named(mutant)}: {mutant.reason}", "yellow"), soft_wrap=True)
        for mutant in of_case.not_judged:
            console.print(
                words(f"not judged: {of_case.case}: {_named(mutant)}: {mutant.reason}", "red"), soft_wrap=True
            )
        if verbose:
            _details(console, of_case)
    score = mean(score.score for score in scores)
    judged = not any(score.not_judged or score.score is None for score in scores)
    good = judged and score is not None and score >= ENOUGH
    console.print(words(f"Mean mutation score {_figure(score)}; {ENOUGH:g} is asked for.", "green" if good else "red"))
    console.print(
        words(f"By the stored references alone {_figure(mean(score.score_by_reference for score in scores))}.")
    )
    return 0 if good else 1


def _table(scores: Sequence[MutationScore]) -> Listing:
    table = Listing(*names("case"), *figures("noticed", "score", "at goals", "reference"))
    for score in scores:
        counted = score.counted
        noticed = sum(mutant.outcome == "noticed" for mutant in counted)
        shares = map(_figure, (score.score, score.score_at_goals, score.score_by_reference))
        table.add(score.case, f"{noticed}/{len(counted)}", *shares)
    return table


def _figure(score: float | None) -> str:
    return "–" if score is None else f"{score:.3f}"


def _details(console: Console, each: MutationScore) -> None:
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


def print_invariances(console: Console, verdicts: Sequence[InvarianceVerdict], verbose: bool = False) -> int:
    """Print the verdicts; the exit code: 1 where one is neither *agree* nor *not applicable*."""
    table = Listing(*names("case", *(invariance.name for invariance in INVARIANCES)))
    for case in dict.fromkeys(verdict.case for verdict in verdicts):
        row = {verdict.invariance: verdict.status for verdict in verdicts if verdict.case == case}
        table.add(case, *(_cell(row[invariance.name]) for invariance in INVARIANCES))
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
