"""Which records of a file count: a result does if it was made, or confirmed, after its case was last asked for.

A file can hold many sessions. What an earlier one recorded and a later one did not confirm is out of date, or the
later one was stopped before it came to it; either way it is not a result of what was asked for last.
"""

from __future__ import annotations

from collections.abc import Sequence

from crosscheck.records.kinds import BrokenLine, CaseRecord, Confirmed, Environment, Record, RunRecord


def standing(records: Sequence[Record]) -> list[Record]:
    """The records that count, of all cases that were ever asked for.

    Sessions of versions that did not confirm what they let stand are taken as they are.
    """
    asked: dict[str, int] = {}  # where each case was last asked for, if what stands is confirmed there
    confirmed: set[tuple[str, ...]] = set()
    begin, confirms = 0, False
    for place, record in enumerate(records):
        if isinstance(record, Environment):
            begin, confirms = place, record.confirms
        elif isinstance(record, CaseRecord) and asked.get(record.case, -1) < begin:  # a later one asks for nothing new
            asked[record.case] = place if confirms else 0
            confirmed = {each for each in confirmed if each[0] != record.case}
        elif isinstance(record, Confirmed):
            confirmed.add(_work(record))
    return [
        record
        for place, record in enumerate(records)
        if not isinstance(record, RunRecord) or place >= asked.get(record.case, 0) or _work(record) in confirmed
    ]


def last_session(records: Sequence[Record]) -> list[Record]:
    """The records that count for what was asked for last."""
    begin = max((place for place, record in enumerate(records) if isinstance(record, Environment)), default=0)
    cases = {record.case for record in records[begin:] if isinstance(record, CaseRecord)}
    found = standing(records)
    latest = next((record for record in reversed(found) if isinstance(record, Environment)), None)
    return [record for record in found if record is latest or _belongs(record, cases)]


def _belongs(record: Record, cases: set[str]) -> bool:
    """Whether a record is of one of the cases; what a broken line was nobody knows."""
    if isinstance(record, BrokenLine):
        return True
    return not isinstance(record, Environment) and record.case in cases


def _work(record: RunRecord | Confirmed) -> tuple[str, ...]:
    return (record.case, record.variant, record.role, record.engine, record.scene, record.made_by)
