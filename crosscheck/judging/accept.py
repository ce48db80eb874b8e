"""Accepting: the figures that cases have reached become those that later runs are held against."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import msgspec

from crosscheck.engines.registry import BUILT_IN
from crosscheck.judging.figures import figures
from crosscheck.judging.outcome import conclude
from crosscheck.judging.results import collect
from crosscheck.library.accepted import FILE, dumps, merged
from crosscheck.library.find import Case
from crosscheck.records.archive import Archive, read
from crosscheck.records.kinds import CaseRecord
from crosscheck.records.session import last_session
from flexmb.output.whole import write_whole


class NotAccepted(ValueError):
    """Something is not as expected: its figures are nothing to hold others against."""


def accept_figures(cases: Iterable[Case], records: Path, partial: bool) -> list[tuple[Path, int]]:
    """Write `accepted.toml` of each case from the records; returns the files and how many figures each holds.

    `partial`: only some engines were asked for, so the figures of others are kept. The records are told too, so that
    they are judged by what they reached. Raises NotAccepted, and writes nothing, unless all is as expected.
    """
    cases = tuple(cases)
    found = last_session(read(records))
    outcome = conclude(collect(found))
    if not outcome.ok:
        raise NotAccepted(f"Nothing is accepted. {outcome.headline}: put that right first.")
    if outcome.idle:
        raise NotAccepted(f"Nothing is accepted: nothing was compared in {', '.join(outcome.idle)}. Leave that out.")
    latest = {record.case: record for record in found if isinstance(record, CaseRecord)}
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
