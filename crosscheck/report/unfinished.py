"""The outputs in a folder while a session runs, or after it was killed: they say that it is unfinished.

Readers, `crosscheck compare` and jobs of continuous integration must not find the
verdicts of an earlier session.
"""

from __future__ import annotations

from pathlib import Path

from crosscheck.judging.outcome import SessionOutcome
from crosscheck.judging.results import Session
from crosscheck.records.machine import environment
from crosscheck.report.ci import VERDICTS, write_summary
from crosscheck.report.junit import write_junit
from crosscheck.report.peaks import FILE as ENVELOPES
from crosscheck.report.site import write_unfinished
from crosscheck.sealed.badge import write_badges
from crosscheck.sealed.document import results_of
from crosscheck.sealed.seal import write_results
from flexmb.output.whole import clear_parts, take_away
from flexmb.output.writing import folder

UNFINISHED = SessionOutcome(verdicts={}, absences=[], unfinished=True)


def mark_unfinished(records: Path, out: Path) -> None:
    """Let all outputs in `out` say that the session which writes the file `records` is unfinished.

    `verdicts.json` is removed, since an empty list of verdicts would look like success, and `envelope.csv`. No other
    process may write into the folder.
    """
    clear_parts(folder(out))
    take_away(out / VERDICTS)
    take_away(out / ENVELOPES)
    write_results(results_of(Session((environment(),), ()), UNFINISHED, records), out)
    write_junit(UNFINISHED, out / "junit.xml")
    write_summary(UNFINISHED, out / "summary.md")
    write_badges(UNFINISHED, out)
    write_unfinished(UNFINISHED, out)
