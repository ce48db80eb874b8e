"""The index: cases against engines, what is not as expected first."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from crosscheck.judging.outcome import SessionOutcome
from crosscheck.judging.results import CaseResults, Session
from crosscheck.judging.verdict import Verdict
from crosscheck.report.html import CasePlace
from crosscheck.report.views import INAPPLICABLE, VerdictCell, anchor, summary_cell


@dataclass(frozen=True)
class CaseRow:
    """One case of the matrix; `look` is that of its gravest verdict, `words` are for the search."""

    name: str
    title: str
    link: str
    look: str
    status: str
    verdicts: int
    words: str
    cells: tuple[VerdictCell, ...]


@dataclass(frozen=True)
class Matrix:
    """Cases against engines, then conservation and negative controls."""

    columns: tuple[str, ...]
    rows: tuple[CaseRow, ...]


@dataclass(frozen=True)
class Unexpected:
    """A verdict that is not as expected, with a link to it."""

    case: str
    link: str
    what: str
    status: str
    expected: str
    reason: str


def matrix(session: Session, outcome: SessionOutcome, places: Mapping[str, CasePlace]) -> Matrix:
    """The verdicts of every case by engine; unexpected ones first, cases without verdicts last."""
    everything = [verdict for verdict in outcome.all if verdict.kind == "comparison"]
    engines = list(dict.fromkeys(engine for verdict in everything for _, engine in verdict.sides))
    engines += [engine for engine in outcome.never_applicable if engine not in engines]
    rows = [_row(case, outcome, engines, places[case.case.case].link()) for case in session.cases]
    rows.sort(key=lambda row: (row.look != "bad", not row.verdicts))
    return Matrix((*engines, "Conservation", "Negative controls"), tuple(rows))


def findings(outcome: SessionOutcome, places: Mapping[str, CasePlace]) -> list[Unexpected]:
    """Every verdict that is not as expected, with a link to it."""
    return [
        Unexpected(
            case=case,
            link=places[case].link(anchor(number)),
            what=f"{verdict.comparison}, {verdict.channel}, {verdict.pair}",
            status=verdict.status,
            expected=verdict.expected,
            reason=verdict.reason,
        )
        for case, verdicts in outcome.verdicts.items()
        for number, verdict in enumerate(verdicts)
        if not verdict.ok
    ]


def _row(case: CaseResults, outcome: SessionOutcome, engines: list[str], link: str) -> CaseRow:
    name, run = case.case.case, case.case.run
    verdicts = outcome.verdicts[name]
    lost = any(absence.case == name for absence in outcome.lost)
    whole = summary_cell(verdicts)
    lost = lost or any(control.case == name for control in outcome.lost_controls)
    look = "bad" if lost or name in outcome.idle else whole.look
    cells = [_engine_cell(name, engine, outcome) for engine in engines]
    cells += [
        summary_cell([verdict for verdict in verdicts if verdict.kind == kind]) for kind in ("conservation", "control")
    ]
    return CaseRow(
        name=name,
        title=run.title,
        link=link,
        look=look,
        status="worse" if any(verdict.ok and verdict.worse for verdict in verdicts) and look != "bad" else look,
        verdicts=len(verdicts),
        words=" ".join((name, run.title, *run.tags)).lower(),
        cells=tuple(cells),
    )


def _engine_cell(name: str, engine: str, outcome: SessionOutcome) -> VerdictCell:
    """The summary of an engine's verdicts in a case."""
    if name in outcome.never_applicable.get(engine, ()):
        return INAPPLICABLE
    found = outcome.verdicts[name]
    return summary_cell([verdict for verdict in found if verdict.kind == "comparison" and _takes_part(verdict, engine)])


def _takes_part(verdict: Verdict, engine: str) -> bool:
    return any(side == engine for _, side in verdict.sides)
