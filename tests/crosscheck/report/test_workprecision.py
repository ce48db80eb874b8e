"""The work-precision chart: one reference for all, errors that fall, a front that nothing beats, failures kept."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace

from crosscheck.judging.results import collect
from crosscheck.library.find import load_case
from crosscheck.records.archive import read
from crosscheck.records.kinds import Record, RunRecord
from crosscheck.report.workprecision import WorkPrecision, work_precision
from tests.crosscheck.sessions import copy_case, sweep_here

RUN_FILE = """
[[variant]]
name = "rigid"
engines = ["fine", "stepper", "biased", "diverger"]

[[chart]]
observable = "marker:tip.position"
variants = ["rigid"]
reference = "rigid"
"""


@pytest.fixture(scope="module")
def records(tmp_path_factory: pytest.TempPathFactory) -> list[Record]:
    folder: Path = tmp_path_factory.mktemp("chart")
    case = load_case(copy_case(folder, RUN_FILE))
    sweep_here([case], (), folder / "records.jsonl")
    return read(folder / "records.jsonl")


@pytest.fixture(scope="module")
def chart(records: list[Record]) -> WorkPrecision:
    return drawn(records)


def drawn(records: list[Record]) -> WorkPrecision:
    (results,) = collect(records).cases
    found = work_precision(results, results.case.run.charts[0])
    assert found is not None
    return found


def errors(chart: WorkPrecision, engine: str) -> list[float | None]:
    """Errors by effort, coarse to fine: wall time grows with the stepper's effort, and the order is kept for others."""
    return [point.error for point in chart.points if point.engine == engine]


def test_errors_fall_with_effort_down_to_the_reference(chart: WorkPrecision) -> None:
    falling = errors(chart, "stepper")
    assert falling == sorted(falling, reverse=True)
    assert falling[0] > 1e3 * chart.reference_uncertainty
    assert min(errors(chart, "fine")) >= 0.0


def test_a_biased_engine_has_a_floor(chart: WorkPrecision) -> None:
    assert min(errors(chart, "biased")) > 1e-4


def test_an_approximation_is_no_reference_however_certain_it_is(records: list[Record], chart: WorkPrecision) -> None:
    certain = chart.reference.partition(" on ")[0]

    def approximate(record: Record) -> Record:
        if isinstance(record, RunRecord) and record.engine == certain:
            return replace(record, support="to first order only")
        return record

    assert not drawn([approximate(record) for record in records]).reference.startswith(certain)


def test_below_the_doubt_of_the_reference_nothing_is_more_accurate(chart: WorkPrecision) -> None:
    below = [point for point in chart.points if point.best and point.error <= chart.reference_uncertainty]
    assert len(below) <= 1


def test_failed_runs_are_kept_without_an_error(chart: WorkPrecision) -> None:
    failed = [point for point in chart.points if point.engine == "diverger"]
    assert len(failed) == 4
    assert all(point.error is None and "1e-12" in point.message and not point.best for point in failed)


def test_nothing_beats_the_front(chart: WorkPrecision) -> None:
    front = [point for point in chart.points if point.best]
    assert front
    for point in front:
        rivals = [other for other in chart.points if other.error is not None and other.wall_s < point.wall_s]
        assert all(other.error > point.error for other in rivals)
