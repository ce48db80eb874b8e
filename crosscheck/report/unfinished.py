"""What stands in a folder while a session runs: that it is unfinished. A session that is killed leaves just that.

Whoever looks at the folder then, a reader, `crosscheck compare`, a job of continuous integration, must not find the
verdicts of the session before.
"""

from __future__ import annotations

from pathlib import Path

from crosscheck.judging.outcome import SessionOutcome
from crosscheck.judging.results import Session
from crosscheck.records.machine import environment
from crosscheck.report.ci import VERDICTS, write_junit, write_summary
from crosscheck.report.site import write_unfinished
from crosscheck.sealed.badge import write_badges
from crosscheck.sealed.document import results_of
from crosscheck.sealed.seal import write_results
from flexmb.output.whole import clear_parts, take_away
from flexmb.output.writing import folder

UNFINISHED = SessionOutcome(verdicts={}, absences=[], unfinished=True)


def mark_unfinished(records: Path, out: Path) -> None:
    """Have all outputs in `out` say that the session which fills the file `records` is unfinished.

    `verdicts.json`, a list of verdicts, is taken away: an empty one would have nothing against it. Nobody else may
    write into the folder.
    """
    clear_parts(folder(out))
    take_away(out / VERDICTS)
    write_results(results_of(Session((environment(),), ()), UNFINISHED, records), out)
    write_junit(UNFINISHED, out / "junit.xml")
    write_summary(UNFINISHED, out / "summary.md")
    write_badges(UNFINISHED, out)
    write_unfinished(UNFINISHED, out)
