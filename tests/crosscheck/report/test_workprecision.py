"""The work-precision chart: one reference for all, errors that fall, a front that nothing beats, failures kept."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from crosscheck.judging.results import collect
from crosscheck.library.find import load_case
from crosscheck.records.archive import read
from crosscheck.records.kinds import CaseRecord, Record, RunRecord
from crosscheck.records.packing import pack, unpack
from crosscheck.records.recorded_reference import RecordedReference, ReferenceGoals
from crosscheck.report import workprecision
from crosscheck.report.workprecision import WorkPrecision, work_precision
from tests.crosscheck.sessions import copy_case, sweep_here

TIP = "marker:tip.position"
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


def with_stored(records: list[Record], uncertainty: float, shift: float = 0.0, **changes: object) -> list[Record]:
    """The records with a stored reference: every second sample of the finest run of "fine", all shifted alike."""
    fine = max(
        (each for each in records if isinstance(each, RunRecord) and each.engine == "fine"), key=lambda run: run.rung
    )
    stored = RecordedReference(
        variant="rigid", asked={"fine": ReferenceGoals(goals={"marker": 1e-6})}, times=pack(unpack(fine.times)[::2]),
        channels={TIP: pack(unpack(fine.channels[TIP])[::2] + shift)}, uncertainties={TIP: uncertainty},
        routes=("exact.py, a closed form", "fine, rk4 h=0.1, rk4 h=0.05"),
    )  # fmt: skip
    stored = replace(stored, **changes)
    return [replace(each, reference=stored) if isinstance(each, CaseRecord) else each for each in records]


def test_a_certain_stored_reference_judges_all_runs_the_most_certain_too(records: list[Record]) -> None:
    """A run that was the reference has no error that it could be shown with; the stored reference finds it."""
    found = drawn(with_stored(records, 1e-12, shift=1e-4))
    assert found.reference == "the stored reference (closed form, fine)"
    assert found.reference_uncertainty == pytest.approx(1e-12 / found.scale)
    shift = float(np.sqrt(3.0)) * 1e-4 / found.scale
    assert min(errors(found, "fine")) == pytest.approx(shift, rel=0.2)


@pytest.mark.parametrize(
    "changes", [{"uncertainties": {TIP: 1e-2}}, {"uncertainties": {}}, {"uncertainties": {TIP: float("nan")}},
                {"fault": "it was edited", "times": None, "channels": {}}, {"variant": "another"}, {"channels": {}}],
)  # fmt: skip
def test_a_stored_reference_that_says_less_than_the_runs_is_not_taken(
    records: list[Record], chart: WorkPrecision, changes: dict[str, object]
) -> None:
    assert drawn(with_stored(records, 1e-12, **changes)) == chart


def test_runs_at_other_times_than_the_reference_have_no_error(records: list[Record]) -> None:
    shifted = pack(np.linspace(0.01, 0.02, 3))
    found = drawn(with_stored(records, 1e-12, times=shifted, channels={TIP: pack(np.ones((3, 3)).cumsum(axis=0))}))
    assert all(point.error is None for point in found.points)
    assert any("times of the reference" in point.message for point in found.points)


def test_of_equally_certain_results_another_code_is_the_reference(
    records: list[Record], chart: WorkPrecision, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workprecision, "RESOLVED", float("inf"))
    assert drawn(records).reference.startswith("fine on")
    monkeypatch.setattr(workprecision, "OWN_CODE", ("fine",))
    assert drawn(records).reference.startswith("stepper on")


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
