"""Everything a session leaves behind: verdicts.json, report.html, summary.md, junit.xml, from its records alone."""

from pathlib import Path

from crosscheck.records import read
from crosscheck.report.html import write_report
from crosscheck.report.outcome import Outcome, conclude, write_verdicts
from crosscheck.report.summary import write_junit, write_summary
from crosscheck.results import collect
from flexmb.writing import folder, writing

__all__ = ["Outcome", "write_all"]


def write_all(records: Path, out: Path) -> tuple[Outcome, Path]:
    """Judge a file of records and write all outputs into `out`; returns the outcome and the report's path."""
    session = collect(read(records))
    outcome = conclude(session)
    folder(out)
    with writing(out):
        write_verdicts(outcome, out / "verdicts.json")
        write_summary(outcome, out / "summary.md")
        write_junit(outcome, out / "junit.xml")
        write_report(session, outcome, out / "report.html")
    return outcome, out / "report.html"
