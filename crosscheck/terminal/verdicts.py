"""The outcome of a session, and the differences of two, on the terminal."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

from rich.console import Console
from rich.text import Text

from crosscheck.judging.figures import GROWTH
from crosscheck.judging.finer_efforts import BEYOND
from crosscheck.judging.outcome import NO_REFERENCE, SessionOutcome
from crosscheck.judging.unjudged import grouped
from crosscheck.judging.verdict import STATUSES, Verdict
from crosscheck.sealed.compare import Differences, Direction, ResultChange
from crosscheck.terminal.text import Verbosity, marked, words
from flexmb.output.listing import Listing, figures, names

LINES = 7  # of problems, without --verbose
DIRECTIONS: dict[Direction, tuple[str, str]] = {
    "worse": ("✕", "red"), "gone": ("–", "red"), "better": ("✓", "green"), "new": ("+", "cyan"),
}  # fmt: skip
CHANGES = 8  # of two sessions, without --verbose
FEW_LINES = 3  # of times and of notes


def print_outcome(console: Console, outcome: SessionOutcome, verbosity: Verbosity = Verbosity.NORMAL) -> int:
    """Show the verdicts; the exit code: 0 if all is as expected, else 1.

    About ten lines: counts, the gravest problems, the headline. QUIET is the headline alone,
    VERBOSE all of it, with a table of all comparisons.
    """
    if verbosity is Verbosity.VERBOSE and outcome.all:
        console.print(_verdict_table(outcome.all))
        console.print(_work_table(outcome))
    if verbosity is not Verbosity.QUIET:
        if outcome.all:
            console.print(words(_inventory(outcome)), soft_wrap=True)
        for name, state in outcome.contracts.items():
            mark = ("✓", "green") if state.good else ("!", "yellow")
            console.print(marked(*mark, state.words(name)), soft_wrap=True)
        lines = list(_not_in_order(outcome))
        shown = lines if verbosity is Verbosity.VERBOSE else lines[:LINES]
        for line in shown:
            console.print(line, soft_wrap=True)
        for absence in outcome.inapplicable if verbosity is Verbosity.VERBOSE else ():
            text = f"{absence.case}, {absence.where}, {absence.engine} not applicable: {absence.reason}"
            console.print(marked("○", "dim", text), soft_wrap=True)
        for each in outcome.flagged if verbosity is Verbosity.VERBOSE else ():
            console.print(marked("○", "dim", str(each)), soft_wrap=True)
        for group in grouped(outcome.unjudged) if verbosity is Verbosity.VERBOSE else ():
            console.print(marked("○", "dim", str(group)), soft_wrap=True)
        if len(shown) < len(lines):
            console.print(words(f"... and {len(lines) - len(shown)} lines more: --verbose shows all", "dim"))
    colour = "green" if outcome.ok else "red"
    console.print(words(outcome.headline, f"bold {colour}"), soft_wrap=True)
    if outcome.worse and verbosity is not Verbosity.QUIET:
        console.print(words(_why_worse(outcome)), soft_wrap=True)
    return 0 if outcome.ok else 1


def _inventory(outcome: SessionOutcome) -> str:
    """The number of cases, and the number of channels by status."""
    count = len(outcome.verdicts)
    parts = [f"{number} {status}" for status in STATUSES if (number := outcome.counts()[status])]
    noticed, controls = outcome.controls()
    if controls:
        parts.append(f"{noticed} of {controls} deliberate faults noticed")
    for engine, cases in outcome.never_applicable.items():
        parts.append(f"{engine} not applicable in {len(cases)}")
    for engine, channels in outcome.not_offered.items():
        parts.append(f"{channels} not offered by {engine}")
    if outcome.unjudged:
        parts.append(f"{len(outcome.unjudged)} offered and judged by nothing")
    if outcome.undetermined:
        parts.append(f"{outcome.undetermined} not determined by the motion")
    if outcome.partly_determined:
        parts.append(f"{outcome.partly_determined} determined in some components")
    return f"{count} case{'s' if count > 1 else ''}: {', '.join(parts)}"


def _not_in_order(outcome: SessionOutcome) -> Iterator[Text]:
    """A line for each problem, the gravest first."""
    for group in _groups(outcome.unexpected).values():
        worst = max(group, key=lambda verdict: verdict.E or 0.0)
        channels = worst.channel if len(group) == 1 else f"{len(group)} channels, worst {worst.channel}"
        where = f"{worst.case}, {worst.comparison}, {worst.pair}, {channels}"
        yield marked("✕", "red", f"{where}: {worst.status}, expected {worst.expected}: {_reason(worst, group)}")
    for line in outcome.broken:
        yield marked("✕", "red", line)
    for loss in outcome.lost:
        yield marked("–", "yellow", f"{loss.case}, {loss.variant}, {loss.engine} {loss.status}: {loss.reason}")
    for engine in outcome.uncompared:
        yield marked("✕", "red", f"{engine} was asked for and compared in nothing{_first_reason(outcome, engine)}")
    for control in outcome.lost_controls:
        yield marked("✕", "red", str(control))
    for text in outcome.idle_claims:
        yield marked("✕", "red", text)
    for case in outcome.idle:
        yield marked("–", "yellow", f"{case}: nothing was compared")
    sign, colour = ("✕", "red") if outcome.strict else ("!", "yellow")
    for case in outcome.unreferenced:
        yield marked(sign, colour, f"{case} {NO_REFERENCE.format(case)}")
    for left in grouped(outcome.unaccounted):
        yield marked(sign, colour, str(left))
    yield from _by_claims(outcome)
    for verdict in outcome.worse:
        yield marked("!", "yellow", f"{_place(verdict)} {verdict.grown}")
    for verdict in outcome.outgrown:
        yield marked("!", "yellow", f"{_place(verdict)}: {verdict.grown}")
    for change in outcome.work_changes:
        mark = (sign, colour) if change.dearer else ("!", "yellow")
        yield marked(*mark, str(change))
    if outcome.stale:
        yield marked("!", "yellow", _stale(outcome.stale))
    for verdict in outcome.unrecorded if outcome.strict else ():
        yield marked("!", "yellow", f"{_place(verdict)} has no accepted figures")


def _stale(verdicts: Sequence[Verdict]) -> str:
    """All stale figures, by what has changed since, and one command that accepts them anew."""
    figures = "1 accepted figure" if len(verdicts) == 1 else f"{len(verdicts)} accepted figures"
    cases = list(dict.fromkeys(verdict.case for verdict in verdicts))
    of = f" of {len(cases)} cases" if len(cases) > 1 else ""
    reasons = Counter(verdict.stale for verdict in verdicts)
    why = "; ".join(f"{reason}: {count}" if len(reasons) > 1 else reason for reason, count in reasons.most_common())
    are = "is" if len(verdicts) == 1 else "are"
    return f"{figures}{of} {are} stale ({why}) and held against nothing; accept anew: {_accept(cases)}"


def _why_worse(outcome: SessionOutcome) -> str:
    """What may have made figures worse, and what to do about it."""
    cases = list(dict.fromkeys(verdict.case for verdict in outcome.worse))
    here = f" ({outcome.made_with})" if outcome.made_with else ""
    return (
        f"Worse: E or U is more than {GROWTH:g} times what was accepted for the same scenes, efforts and engines. "
        f"What differs is our code, the libraries or the processor{here}. If you changed nothing, tell us; "
        f"if it is meant: {_accept(cases)}"
    )


def _accept(cases: Sequence[str]) -> str:
    return f"crosscheck run {shlex.join(cases)} --accept"


def _reason(verdict: Verdict, group: Iterable[Verdict]) -> str:
    """Why a verdict is not as expected; and what to do for the one of its group that needs most, if that is known."""
    if verdict.own_failure and verdict.status == "agree":
        return f"you expect it to fail ({verdict.own_failure}): take that out if it is mended"
    advised = [verdict for verdict in group if verdict.advice]
    most = max(advised, key=lambda verdict: (verdict.U or 0.0) / verdict.goal, default=None)
    if most is not None and most.advice.startswith(BEYOND):  # one goal for all of them
        most = max(
            (verdict for verdict in advised if verdict.advice.startswith(BEYOND)), key=lambda verdict: verdict.U or 0.0
        )
    return verdict.reason if most is None else f"{verdict.reason}; {most.advice}"


def _by_claims(outcome: SessionOutcome) -> Iterator[Text]:
    """A line for each reason by which verdicts are as expected only by claims of the user: never green in silence."""
    loosened = Counter((verdict.goal_reason, verdict.goal) for verdict in outcome.loosened)
    for (reason, goal), count in loosened.items():
        verdicts = "1 verdict" if count == 1 else f"{count} verdicts"
        yield marked("!", "yellow", f"{verdicts} by the goal {goal:.2g}, looser than the case's: {reason}")
    failures = Counter(
        (failure.own_failure, failure.status, failure.expected_reason) for failure in outcome.own_failures
    )
    for (place, status, reason), count in failures.items():
        yield marked("!", "yellow", f"{count} {status}, as you expect: {reason} ({place})")


def _first_reason(outcome: SessionOutcome, engine: str) -> str:
    """Why an engine has nothing to compare, if it gave a reason."""
    mine = [absence for absence in outcome.inapplicable if absence.engine == engine]
    reasons = [
        f": {absence.case}: {absence.reason}"
        for absence in sorted(mine, key=lambda absence: not absence.lies_with_engine)
    ]
    return reasons[0] if reasons else ""


def _place(verdict: Verdict) -> str:
    return f"{verdict.case}, {verdict.comparison}, {verdict.pair}, {verdict.channel}"


def _verdict_table(verdicts: Sequence[Verdict]) -> Listing:
    """Counts of statuses by case and comparison; as expected in green, others in red."""
    occurring = [status for status in STATUSES if any(verdict.status == status for verdict in verdicts)]
    table = Listing(*names("case", "comparison"), *figures("as expected", *occurring))
    groups: dict[tuple[str, str], list[Verdict]] = {}
    for verdict in verdicts:
        name = "negative controls" if verdict.kind == "control" else verdict.comparison
        groups.setdefault((verdict.case, name), []).append(verdict)
    for (case, name), group in groups.items():
        good = sum(verdict.ok for verdict in group)
        colour = "green" if good == len(group) else "red"
        cells = [_count(group, status) for status in occurring]
        table.add(case, name, words(f"{good} of {len(group)}", colour), *cells)
    return table


def _work_table(outcome: SessionOutcome) -> Listing:
    """What the finest runs took; what an engine does not count is said, with its name."""
    times, counts = figures("solve", "processor"), figures("evaluations", "steps", "operations")
    table = Listing(*names("case", "variant", "engine", "effort"), *times, *counts)
    for (case, variant, engine), work in outcome.main_work.items():
        made = (work.evaluations, work.steps, work.operations)
        told = [f"{count:.4g}" if count >= 1e6 else str(count) if count else f"not by {engine}" for count in made]
        cpu = f"{work.cpu_s:.3g} s" if work.cpu_s else "not recorded"
        table.add(case, variant, engine, work.effort, f"{work.wall_s:.3g} s", cpu, *told)
    return table


def _count(group: list[Verdict], status: str) -> Text:
    verdicts = [verdict for verdict in group if verdict.status == status]
    return words(str(len(verdicts) or ""), "green" if all(verdict.ok for verdict in verdicts) else "red")


def _groups(verdicts: Iterable[Verdict]) -> dict[tuple[str, ...], list[Verdict]]:
    """Verdicts grouped by comparison, pair and status."""
    groups: dict[tuple[str, ...], list[Verdict]] = {}
    for verdict in verdicts:
        groups.setdefault((verdict.case, verdict.comparison, verdict.pair, verdict.status), []).append(verdict)
    return groups


def print_differences(console: Console, differences: Differences, verbosity: Verbosity) -> None:
    """The changes, the gravest first; notes and times after them; the headline last."""
    if verbosity is not Verbosity.QUIET:
        everything = verbosity is Verbosity.VERBOSE
        changes = [marked(*DIRECTIONS[change.direction], _told(change)) for change in differences.changes]
        times = [
            words(f"time: {time.case}, {time.what}: {time.before_s:.3g} s -> {time.now_s:.3g} s")
            for time in differences.times
        ]
        notes = [words(f"note: {note}", "dim") for note in differences.notes]
        kinds = (changes, CHANGES, "changes"), (times, FEW_LINES, "times"), (notes, FEW_LINES, "notes")
        for lines, limit, what in kinds:
            shown = lines if everything else lines[:limit]
            for line in shown:
                console.print(line, soft_wrap=True)
            if len(shown) < len(lines):
                console.print(words(f"... and {len(lines) - len(shown)} {what} more: --verbose shows all", "dim"))
    colour = "red" if differences.regressed else "green"
    console.print(words(differences.headline, f"bold {colour}"), soft_wrap=True)


def _told(change: ResultChange) -> str:
    where = ", ".join(part for part in (change.case, change.comparison, change.what) if part)
    return f"{change.direction}: {where}: {change.how}"
