"""The outputs of a session, made from its records alone:

verdicts.json, report/, summary.md, junit.xml, results.json, label.json, the badge and, of sessions with envelopes,
envelope.csv.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from crosscheck.judging.outcome import SessionOutcome, conclude
from crosscheck.judging.results import Session, collect
from crosscheck.label.document import FILE as LABEL
from crosscheck.label.document import session_labels, write_label
from crosscheck.records.archive import read
from crosscheck.records.kinds import Record
from crosscheck.records.machine import environment
from crosscheck.records.session import standing
from crosscheck.report.ci import VERDICTS, write_summary, write_verdicts
from crosscheck.report.junit import write_junit
from crosscheck.report.maps import read_maps
from crosscheck.report.mutations import read_scores
from crosscheck.report.peaks import FILE as ENVELOPES
from crosscheck.report.peaks import write_envelope
from crosscheck.report.site import Material, write_single, write_site, write_unfinished
from crosscheck.sealed.badge import write_badges
from crosscheck.sealed.document import results_of
from crosscheck.sealed.seal import write_results
from flexmb.output.files import clear_parts, folder, take_away

__all__ = ["Choice", "SessionOutcome", "mark_unfinished", "write_all"]

Choice = Callable[[Sequence[Record]], Sequence[Record]]


def write_all(
    records: Path, out: Path, strict: bool = False, chosen: Choice = standing, single_file: bool = False
) -> tuple[SessionOutcome, Path]:
    """Judge the `chosen` records of a file and write all outputs into `out`; returns outcome and report's path.

    `strict`: figures that are worse than recorded, or not recorded, are not as expected. `single_file`: the report is
    one file, `report.html`, instead of a folder of pages.
    """
    mark_unfinished(records, out)  # a killed process must leave no outputs of an earlier session
    session = collect(chosen(read(records)))
    outcome = conclude(session, strict)
    write_verdicts(outcome, out / VERDICTS)
    results = results_of(session, outcome, records)
    labels = session_labels(session, results, out)
    write_summary(outcome, out / "summary.md", labels)
    write_junit(outcome, out / "junit.xml", session)
    write_results(results, out)
    write_label(labels, out / LABEL)
    write_badges(outcome, out)
    write_envelope(session, out)
    material = Material(session, outcome, read_scores(out), read_maps(out), labels)
    page = write_single(material, out) if single_file else write_site(material, out)
    return outcome, page


UNFINISHED = SessionOutcome(verdicts={}, absences=[], unfinished=True)


def mark_unfinished(records: Path, out: Path) -> None:
    """Let all outputs in `out` say that the session which writes the file `records` is unfinished.

    `verdicts.json` is removed, since an empty list of verdicts would look like success, and so are `envelope.csv` and
    `label.json`. No other
    process may write into the folder.
    """
    clear_parts(folder(out))
    take_away(out / VERDICTS)
    take_away(out / ENVELOPES)
    take_away(out / LABEL)
    write_results(results_of(Session((environment(),), ()), UNFINISHED, records), out)
    write_junit(UNFINISHED, out / "junit.xml")
    write_summary(UNFINISHED, out / "summary.md")
    write_badges(UNFINISHED, out)
    write_unfinished(UNFINISHED, out)
