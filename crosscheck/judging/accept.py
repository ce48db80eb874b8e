"""Accepting: the figures that cases have reached become those with which later runs are compared."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import msgspec

from crosscheck.engines.registry import BUILT_IN
from crosscheck.judging.figures import figures, recordable
from crosscheck.judging.outcome import conclude
from crosscheck.judging.results import collect
from crosscheck.library.accepted import FILE, dumps, merged
from crosscheck.library.find import Case
from crosscheck.records.archive import Archive, read
from crosscheck.records.kinds import CaseRecord
from crosscheck.records.session import last_session
from flexmb.output.files import write_whole


class NotAccepted(ValueError):
    """Something is not as expected, so its figures are not accepted."""


def accept_figures(cases: Iterable[Case], records: Path, partial: bool) -> list[tuple[Path, int]]:
    """Write `accepted.toml` of each case from the records; returns the files and the numbers of their figures.

    `partial`: only some engines were asked for, so the figures of others are kept. The accepted figures are also
    appended to the records. Raises NotAccepted and writes nothing unless all is as expected.
    """
    cases = tuple(cases)
    session = last_session(read(records))
    outcome = conclude(collect(session))
    if not outcome.ok:
        raise NotAccepted(f"Nothing is accepted. {outcome.headline}: correct that first.")
    if outcome.idle:
        raise NotAccepted(f"Nothing is accepted: nothing was compared in {', '.join(outcome.idle)}. Leave that out.")
    own = [verdict for verdict in (*outcome.loosened, *outcome.own_failures) if recordable(verdict, BUILT_IN)]
    if own:
        raise NotAccepted(f"Nothing is accepted: {own[0].case} was judged by goals or expectations that are your own.")
    latest = {record.case: record for record in session if isinstance(record, CaseRecord)}
    written = []
    archive = Archive(records)
    try:
        for case in cases:
            now = figures(outcome.verdicts[case.name], BUILT_IN)
            accepted = merged(case.accepted, now) if partial else now
            file = case.folder / FILE
            write_whole(file, dumps(accepted))
            archive.write(msgspec.structs.replace(latest[case.name], accepted=accepted))
            written.append((file, sum(len(table) for table in accepted.values())))
    finally:
        archive.close()
    return written
