"""The tables of the report: verdicts arranged by comparison, kind of channel and pair of engines."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from crosscheck.judging.verdict import GRAVITY, Verdict
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
    """One cell: a status with its look ("good", "expected", "bad"), a short text, and the reasons behind it."""

    status: str
    look: str
    text: str
    numbers: str
    reasons: tuple[str, ...]

    @property
    def symbol(self) -> str:
        """A sign that does not rely on colour."""
        return SYMBOLS.get(self.status, "")


EMPTY = VerdictCell("", "empty", "", "", ())


@dataclass(frozen=True)
class Row:
    """A row of cells, one a column of its table, with rows beneath it that it summarises."""

    label: str
    cells: tuple[VerdictCell, ...]
    rows: tuple[Row, ...] = ()


@dataclass(frozen=True)
class VerdictTable:
    """A table of verdicts."""

    title: str
    note: str
    columns: tuple[str, ...]
    rows: tuple[Row, ...]


def overview(verdicts: dict[str, list[Verdict]]) -> VerdictTable:
    """Cases and their comparisons against pairs of engines, controls and conservation."""
    everything = [verdict for group in verdicts.values() for verdict in group]
    columns = list(dict.fromkeys(_column(verdict) for verdict in everything))
    columns.sort(key=lambda column: column in ("Conservation", "Negative controls"))
    rows = []
    for case, group in verdicts.items():
        comparisons = [verdict for verdict in group if verdict.kind == "comparison"]
        names = dict.fromkeys(verdict.comparison for verdict in comparisons)
        below = tuple(
            Row(name, _cells(columns, [each for each in comparisons if each.comparison == name], _column))
            for name in names
        )
        rows.append(Row(case, _cells(columns, group, _column), below))
    return VerdictTable("Verdicts", "", tuple(columns), tuple(rows))


def comparison_tables(verdicts: Iterable[Verdict]) -> list[VerdictTable]:
    """A table for each comparison: kinds of channels, with their channels beneath, against pairs."""
    groups: dict[str, list[Verdict]] = {}
    for verdict in verdicts:
        if verdict.kind == "comparison":
            groups.setdefault(verdict.comparison, []).append(verdict)
    return [_comparison_table(name, group) for name, group in groups.items()]


def conservation_table(verdicts: list[Verdict]) -> VerdictTable | None:
    """Conserved quantities against engines."""
    if not verdicts:
        return None
    columns = tuple(dict.fromkeys(verdict.engine_a for verdict in verdicts))
    groups: dict[str, list[Verdict]] = {}
    for verdict in verdicts:
        groups.setdefault(f"{verdict.comparison.capitalize()}, {verdict.variant_a}", []).append(verdict)
    rows = tuple(Row(name, _cells(columns, group, lambda each: each.engine_a)) for name, group in groups.items())
    return VerdictTable("Conservation", "Drift over the run, relative to the largest magnitude reached.", columns, rows)


def control_table(verdicts: list[Verdict]) -> VerdictTable | None:
    """Negative controls; beneath them the channels that must notice them."""
    if not verdicts:
        return None
    groups: dict[str, list[Verdict]] = {}
    for verdict in verdicts:
        groups.setdefault(f"{verdict.comparison} ({verdict.engine_a}, against {verdict.engine_b})", []).append(verdict)
    rows = []
    for name, group in groups.items():
        below = tuple(Row(verdict.channel, (_cell([verdict]),)) for verdict in group)
        rows.append(Row(name, (_cell(group),), below if len(below) > 1 else ()))
    note = "Deliberate faults of the scene. A comparison that does not notice them proves nothing."
    return VerdictTable("Negative controls", note, ("The fault is",), tuple(rows))


def _comparison_table(name: str, group: list[Verdict]) -> VerdictTable:
    columns = list(dict.fromkeys(verdict.pair for verdict in group))
    kinds = dict.fromkeys(_kind(verdict.channel) for verdict in group)
    rows = []
    for kind in kinds:
        inside = [verdict for verdict in group if _kind(verdict.channel) == kind]
        channels = dict.fromkeys(verdict.channel for verdict in inside)
        below = tuple(
            Row(channel, _cells(columns, [each for each in inside if each.channel == channel], _pair))
            for channel in channels
        )
        rows.append(below[0] if len(below) == 1 else Row(kind, _cells(columns, inside, _pair), below))
    expected = group[0].expected
    note = "" if expected == "agree" else f"Expected here: {expected}, because {group[0].expected_reason}"
    return VerdictTable(name, note, tuple(columns), tuple(rows))


def _cells(columns: Iterable[str], group: list[Verdict], column: Callable[[Verdict], str]) -> tuple[VerdictCell, ...]:
    return tuple(_cell([verdict for verdict in group if column(verdict) == name]) for name in columns)


def _cell(group: list[Verdict]) -> VerdictCell:
    """Summary of some verdicts by the gravest unexpected one, or else by the gravest."""
    if not group:
        return EMPTY
    bad = [verdict for verdict in group if not verdict.ok]
    worst = min(bad or group, key=lambda verdict: (GRAVITY.index(verdict.status), -(verdict.E or 0.0)))
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
    grown = [verdict for verdict in group if verdict.ok and verdict.worse]
    if grown:
        text += ", worse than recorded" if len(grown) == len(group) else f", {len(grown)} worse than recorded"
    shown = bad or grown or [verdict for verdict in group if verdict.status == worst.status]
    reasons = tuple(f"{verdict.channel}, {verdict.pair}: {_reason(verdict)}" for verdict in shown[:12])
    return VerdictCell(worst.status, look, text, _numbers(worst), reasons)


def _reason(verdict: Verdict) -> str:
    """The reason of a verdict, and the accepted figures."""
    if verdict.worse:
        return f"{verdict.reason}; worse than recorded: {verdict.worse}"
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


def _pair(verdict: Verdict) -> str:
    return verdict.pair


def _column(verdict: Verdict) -> str:
    if verdict.kind == "conservation":
        return "Conservation"
    if verdict.kind == "control":
        return "Negative controls"
    return f"{verdict.engine_a} – {verdict.engine_b}"
