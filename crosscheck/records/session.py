"""Which records of a file are current: results that were made or confirmed after their case was last asked for.

A file can contain many sessions. A result that a later session did not confirm is out of date, or the later session was
stopped before it; in both cases it is not a result of the last request.
"""

from __future__ import annotations

from collections.abc import Sequence

from crosscheck.records.kinds import BrokenLine, CaseRecord, ChartRecord, Confirmed, Environment, Record, RunRecord


def standing(records: Sequence[Record]) -> list[Record]:
    """The current records of all cases that were ever asked for.

    Results of older versions, whose sessions confirmed nothing, count as current.
    """
    asked: dict[str, int] = {}  # the record of each case's last request, 0 if its session confirms nothing
    confirmed: set[tuple[str, ...]] = set()
    begin, confirms = 0, False
    for place, record in enumerate(records):
        if isinstance(record, Environment):
            begin, confirms = place, record.confirms
        elif isinstance(record, CaseRecord) and asked.get(record.case, -1) < begin:  # the first of this session
            asked[record.case] = place if confirms else 0
            confirmed = {key for key in confirmed if key[0] != record.case}
        elif isinstance(record, Confirmed):
            confirmed.add(_work(record))
    return [
        record
        for place, record in enumerate(records)
        if not isinstance(record, RunRecord | ChartRecord)
        or place >= asked.get(record.case, 0)
        or _work(record) in confirmed
    ]


def last_session(records: Sequence[Record]) -> list[Record]:
    """The current records of the last session's cases."""
    begin = max((place for place, record in enumerate(records) if isinstance(record, Environment)), default=0)
    cases = {record.case for record in records[begin:] if isinstance(record, CaseRecord)}
    records_now = standing(records)
    latest = next((record for record in reversed(records_now) if isinstance(record, Environment)), None)
    return [record for record in records_now if record is latest or _belongs(record, cases)]


def _belongs(record: Record, cases: set[str]) -> bool:
    """Whether a record belongs to one of the cases; a broken line may."""
    if isinstance(record, BrokenLine):
        return True
    return not isinstance(record, Environment) and record.case in cases


def _work(record: RunRecord | ChartRecord | Confirmed) -> tuple[str, ...]:
    return (record.case, record.variant, record.role, record.engine, record.scene, record.made_by)
