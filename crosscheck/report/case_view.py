"""Texts and tables of a case's page; its charts are in `charts.py`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from crosscheck.judging.applicable import Inapplicable
from crosscheck.judging.margins import FlaggedGoal
from crosscheck.judging.outcome import NO_REFERENCE, Absence, LostControl, SessionOutcome
from crosscheck.judging.results import CaseResults
from crosscheck.judging.unjudged import UnjudgedChannels, grouped
from crosscheck.judging.work import work_of
from crosscheck.label.document import FactorRow, SubjectLabel
from crosscheck.label.factors import TITLES
from crosscheck.library.case import Provenance
from crosscheck.report.html import CasePlace
from crosscheck.report.mutations import CaseScore
from crosscheck.report.peaks import PeakRow, largest_loads
from crosscheck.report.speed import SpeedTable, speed_tables
from crosscheck.report.views import (
    Block,
    VerdictCell,
    comparison_blocks,
    conservation_block,
    control_block,
    summary_cell,
)


@dataclass(frozen=True)
class CaseView:
    place: CasePlace
    name: str
    title: str
    summary: str
    provenance: Provenance | None
    variants: list[dict[str, Any]]
    ok: bool
    whole: VerdictCell
    comparisons: list[Block]
    conservation: Block | None
    controls: Block | None
    absences: list[Absence]
    inapplicable: list[Inapplicable]
    unjudged: list[UnjudgedChannels]
    lost_controls: list[LostControl]
    unreferenced: str
    work_changes: list[str]
    flagged: list[FlaggedGoal]
    speeds: list[SpeedTable]
    timings: list[dict[str, Any]]
    peaks: list[PeakRow]
    mutation: CaseScore | None
    label: SubjectLabel
    factors: list[tuple[str, FactorRow]]


def case_view(
    case: CaseResults, outcome: SessionOutcome, place: CasePlace, mutation: CaseScore | None, label: SubjectLabel
) -> CaseView:
    """Everything on a case's page but the charts."""
    record = case.case
    verdicts = outcome.verdicts[record.case]
    lost = any(absence.case == record.case for absence in outcome.lost)
    lost_controls = [control for control in outcome.lost_controls if control.case == record.case]
    return CaseView(
        place=place,
        name=record.case,
        title=record.run.title,
        summary=_first_paragraph(record.readme),
        provenance=record.provenance,
        variants=[_variant_view(case, variant) for variant in record.run.variants],
        ok=record.case not in outcome.idle and all(verdict.ok for verdict in verdicts) and not (lost or lost_controls),
        whole=summary_cell(verdicts),
        comparisons=comparison_blocks(outcome, verdicts),
        conservation=conservation_block(outcome, verdicts),
        controls=control_block(outcome, verdicts),
        lost_controls=lost_controls,
        absences=[absence for absence in outcome.absences if absence.case == record.case],
        inapplicable=[absence for absence in outcome.inapplicable if absence.case == record.case],
        unjudged=grouped(channel for channel in outcome.unjudged if channel.case == record.case),
        unreferenced=f"It {NO_REFERENCE.format(record.case)}" if record.case in outcome.unreferenced else "",
        work_changes=[str(change) for change in outcome.work_changes if change.case == record.case],
        flagged=[each for each in outcome.flagged if each.case == record.case],
        speeds=speed_tables(case),
        timings=_timings(case),
        peaks=largest_loads(case),
        mutation=mutation,
        label=label,
        factors=[(TITLES[factor], row) for factor, row in label.factors.items()],
    )


def _variant_view(case: CaseResults, variant: Any) -> dict[str, Any]:
    info = case.case.variants[variant.name]
    return {
        "name": variant.name,
        "level": info.level,
        "engines": ", ".join(variant.engines),
        "how": transformation(variant),
        "duration": variant.duration_s or case.case.run.duration_s,
        "note": info.error or variant.note,
    }


def transformation(variant: Any) -> str:
    return {
        "none": "",
        "rigidify": "flexible bodies made rigid",
        "modal_points": "beams as points and modes",
        "segments": f"{variant.segments} rigid segments per beam",
        "substructures": f"{variant.pieces} flexible pieces per beam",
    }[variant.transform]


def _timings(case: CaseResults) -> list[dict[str, Any]]:
    return [
        {
            "engine": engine,
            "variant": variant,
            "work": work_of(result.finest),
            "compile_s": result.finest.compile_s,
            "support": result.finest.support,
        }
        for (variant, engine, role), result in case.results.items()
        if role == "main" and result.runs
    ]


def _first_paragraph(readme: str) -> str:
    """The README's first paragraph of plain text."""
    paragraphs = [part.strip() for part in readme.split("\n\n")]
    text = [part for part in paragraphs if part and not part.startswith(("#", "!", "|", "`", "-", "<"))]
    return " ".join(text[0].split()) if text else ""
