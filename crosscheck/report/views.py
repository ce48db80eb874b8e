"""Verdicts on a page: cells that summarise some, tables of cells, and blocks that contain all lines."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from crosscheck.judging.outcome import SessionOutcome
from crosscheck.judging.verdict import SEVERITY, WORSE, Verdict
from crosscheck.library.channels import part_of

SYMBOLS: dict[str, str] = {
    "agree": "✓",
    "differ": "≠",
    "unresolved": "?",
    "refused": "⊘",
    "diverged": "↗",
    "failed": "✕",
    "did not finish": "⧖",
    "crashed": "☠",
    "did not run": "–",
}


@dataclass(frozen=True)
class VerdictCell:
    """One cell: a status with its look ("good", "expected", "bad"), a short text, and the worst numbers behind it."""

    status: str
    look: str
    text: str
    numbers: str

    @property
    def symbol(self) -> str:
        """A sign that can be read without colour."""
        return SYMBOLS.get(self.status, "")


EMPTY = VerdictCell("", "empty", "", "")
INAPPLICABLE = VerdictCell("not applicable", "empty", "not applicable", "")


@dataclass(frozen=True)
class Row:
    """A row of cells, one for each column of its table."""

    label: str
    cells: tuple[VerdictCell, ...]


@dataclass(frozen=True)
class VerdictTable:
    columns: tuple[str, ...]
    rows: tuple[Row, ...]


@dataclass(frozen=True)
class VerdictLine:
    """One verdict in words; `anchor` is its place on the page."""

    anchor: str
    channel: str
    pair: str
    cell: VerdictCell
    E: str
    U: str
    goal: str
    work: str
    reason: str


@dataclass(frozen=True)
class Block:
    """Verdicts that belong together: their summary, a table by kind and pair, and every one of them."""

    title: str
    note: str
    cell: VerdictCell
    figures: str
    table: VerdictTable
    lines: tuple[VerdictLine, ...]

    @property
    def open(self) -> bool:
        """Whether it is shown open, as something in it is not as expected."""
        return self.cell.look == "bad"


Numbered = tuple[int, Verdict]  # a verdict with its number among those of its case


def anchor(number: int) -> str:
    return f"verdict-{number}"


def comparison_blocks(outcome: SessionOutcome, verdicts: Iterable[Verdict]) -> list[Block]:
    """A block for each comparison: kinds of channels against pairs of engines."""
    groups: dict[str, list[Numbered]] = {}
    for number, verdict in enumerate(verdicts):
        if verdict.kind == "comparison":
            groups.setdefault(verdict.comparison, []).append((number, verdict))
    return [_comparison(outcome, name, group) for name, group in groups.items()]


def conservation_block(outcome: SessionOutcome, verdicts: Iterable[Verdict]) -> Block | None:
    """Conserved quantities against engines."""
    group = [(number, verdict) for number, verdict in enumerate(verdicts) if verdict.kind == "conservation"]
    if not group:
        return None
    note = "Drift over the run, relative to the largest magnitude reached."
    table = _table(
        group,
        lambda verdict: f"{verdict.comparison.capitalize()}, {verdict.variant_a}",
        lambda verdict: verdict.engine_a,
    )
    return _block(outcome, "Conservation", note, group, table)


def control_block(outcome: SessionOutcome, verdicts: Iterable[Verdict]) -> Block | None:
    """Negative controls: which faults were noticed by which engines."""
    group = [(number, verdict) for number, verdict in enumerate(verdicts) if verdict.kind == "control"]
    if not group:
        return None
    note = "Deliberate faults of the scene. A comparison that does not notice them proves nothing."
    table = _table(
        group, lambda verdict: verdict.comparison, lambda verdict: f"{verdict.engine_a}, against {verdict.engine_b}"
    )
    return _block(outcome, "Negative controls", note, group, table)


def _comparison(outcome: SessionOutcome, name: str, group: list[Numbered]) -> Block:
    first = group[0][1]
    note = "" if first.expected == "agree" else f"Expected here: {first.expected}, because {first.expected_reason}"
    return _block(
        outcome, name, note, group, _table(group, lambda verdict: _kind(verdict.channel), lambda verdict: verdict.pair)
    )


def _block(outcome: SessionOutcome, title: str, note: str, group: list[Numbered], table: VerdictTable) -> Block:
    verdicts = [verdict for _, verdict in group]
    order = sorted(group, key=lambda item: item[1].ok)  # what is not as expected first
    lines = tuple(_line(outcome, number, verdict) for number, verdict in order)
    return Block(title, note, summary_cell(verdicts), _worst(verdicts), table, lines)


def _line(outcome: SessionOutcome, number: int, verdict: Verdict) -> VerdictLine:
    what = verdict.comparison if verdict.kind != "comparison" else ""
    return VerdictLine(
        anchor=anchor(number),
        channel=f"{what}: {verdict.channel}" if what and what != verdict.channel else verdict.channel,
        pair=verdict.engine_a if verdict.kind == "conservation" else verdict.pair,
        cell=summary_cell([verdict]),
        E=_number(verdict.E),
        U=_number(verdict.U),
        goal=_goal(verdict),
        work=_work(outcome, verdict),
        reason=_reason(verdict),
    )


def _worst(verdicts: list[Verdict]) -> str:
    """The verdict with the largest E for its goal, in numbers."""
    judged = [verdict for verdict in verdicts if verdict.E is not None and verdict.goal > 0.0 and verdict.E >= 0.0]
    if not judged:
        return ""
    worst = max(judged, key=lambda verdict: (verdict.E or 0.0) / verdict.goal)
    doubt = "" if worst.kind == "conservation" else f", U {_number(worst.U) or 'unknown'}"
    bound = "limit" if worst.kind == "conservation" else "goal"
    return f"worst {worst.channel}: E {_number(worst.E)}{doubt}, {bound} {_number(worst.goal)}"


def _goal(verdict: Verdict) -> str:
    """The goal, with that of the case where an engine claims a looser one."""
    looser = f" (of the case: {_number(verdict.case_goal)})" if verdict.loosened else ""
    return _number(verdict.goal) + looser


def _work(outcome: SessionOutcome, verdict: Verdict) -> str:
    """What the runs behind a verdict took, each side on its own."""
    sides = zip((verdict.engine_a, verdict.engine_b), outcome.work_of(verdict), strict=True)
    return "; ".join(f"{engine}: {work.words(engine)}" for engine, work in sides if work is not None)


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.1e}"


def _table(group: list[Numbered], row: Callable[[Verdict], str], column: Callable[[Verdict], str]) -> VerdictTable:
    verdicts = [verdict for _, verdict in group]
    columns = tuple(dict.fromkeys(map(column, verdicts)))
    rows = []
    for name in dict.fromkeys(map(row, verdicts)):
        inside = [verdict for verdict in verdicts if row(verdict) == name]
        cells = [[verdict for verdict in inside if column(verdict) == heading] for heading in columns]
        rows.append(Row(name, tuple(map(summary_cell, cells))))
    return VerdictTable(columns, tuple(rows))


def summary_cell(group: list[Verdict]) -> VerdictCell:
    """Summary of some verdicts by the gravest unexpected one, or else by the gravest."""
    if not group:
        return EMPTY
    bad = [verdict for verdict in group if not verdict.ok]
    worst = min(bad or group, key=lambda verdict: (SEVERITY.index(verdict.status), -(verdict.E or 0.0)))
    good = worst.status == "agree" or worst.kind == "control"
    look = "bad" if bad else "good" if good else "expected"
    text: str = worst.status
    if worst.kind == "control" and worst.status in ("differ", "agree"):
        text = "noticed" if worst.ok else "missed"
    if worst.kind == "conservation" and worst.status in ("differ", "agree"):
        text = "conserved" if worst.status == "agree" else "drifts"
    if len(group) > 1:
        alike = len(bad) or sum(verdict.status == worst.status for verdict in group)
        text += f" {alike}" if alike == len(group) else f" {alike} of {len(group)}"
    if worst.expected != "agree" and worst.kind != "control":
        text += " (expected)" if worst.ok else f" (expected {worst.expected})"
    loosened = sum(verdict.ok and verdict.loosened for verdict in group)
    if loosened:
        text += ", looser goal" if loosened == len(group) else f", {loosened} by looser goals"
    grown = [verdict for verdict in group if verdict.ok and verdict.worse]
    if grown:
        what = "beyond stale figures" if all(verdict.stale for verdict in grown) else WORSE
        text += f", {what}" if len(grown) == len(group) else f", {len(grown)} {what}"
    return VerdictCell(worst.status, look, text, _numbers(worst))


def _reason(verdict: Verdict) -> str:
    """The reason of a verdict, what the user claims and expects, what to do, and the accepted figures."""
    parts = [verdict.reason]
    if verdict.case_goal is not None:
        parts.append(f"goal claimed for {verdict.goal_reason}")
    if verdict.own_failure:
        parts.append(f"you expect {verdict.expected}: {verdict.expected_reason} ({verdict.own_failure})")
    if not verdict.ok and verdict.advice:
        parts.append(verdict.advice)
    if len(parts) > 1:
        return "; ".join((*parts, verdict.grown) if verdict.worse else parts)
    if verdict.worse:
        return f"{verdict.reason}; {verdict.grown}"
    if verdict.accepted is None:
        return verdict.reason
    doubt = f", U {verdict.accepted.U:.1e}" if verdict.accepted.U else ""
    return f"{verdict.reason} (accepted: E {verdict.accepted.E:.1e}{doubt})"


def _numbers(verdict: Verdict) -> str:
    if verdict.E is None:
        return ""
    if verdict.kind == "conservation":
        return f"drift {verdict.E:.1e} of ≤ {verdict.goal:.0e}"
    doubt = "unknown" if verdict.U is None else f"{verdict.U:.1e}"
    return f"E {verdict.E:.1e}\nU {doubt}"


def _kind(channel: str) -> str:
    part = part_of(channel)
    return channel if part is None else part.title
