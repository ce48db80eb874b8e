"""Work against precision: one reference for all, errors that fall, a front that nothing beats, failures kept; and the
session's chart of speed, and its store of series, which come back digit for digit.
"""

import re
from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from msgspec.structs import replace

from crosscheck.judging import chart_reference
from crosscheck.judging.outcome import SessionOutcome
from crosscheck.judging.results import collect
from crosscheck.library.find import load_case
from crosscheck.records.archive import read
from crosscheck.records.kinds import CaseRecord, Record, RecordedReference, ReferenceGoals, RunRecord
from crosscheck.records.packing import pack, unpack
from crosscheck.report.speed import REACHED, fastest, standing, unit_of_time
from crosscheck.report.workprecision import Point, WorkPrecision, work_precision
from flexmb.view.store import Store
from tests.crosscheck.report.reading import series_of
from tests.crosscheck.report.sessions import MANY, session
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
        (record for record in records if isinstance(record, RunRecord) and record.engine == "fine"),
        key=lambda run: run.rung,
    )
    stored = RecordedReference(
        variant="rigid", asked={"fine": ReferenceGoals(goals={"marker": 1e-6})}, times=pack(unpack(fine.times)[::2]),
        channels={TIP: pack(unpack(fine.channels[TIP])[::2] + shift)}, uncertainties={TIP: uncertainty},
        routes=("exact.py, a closed form", "fine, rk4 h=0.1, rk4 h=0.05"),
    )  # fmt: skip
    stored = replace(stored, **changes)
    return [replace(record, reference=stored) if isinstance(record, CaseRecord) else record for record in records]


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
    monkeypatch.setattr(chart_reference, "RESOLVED", float("inf"))
    assert drawn(records).reference.startswith("fine on")
    monkeypatch.setattr(chart_reference, "OWN_CODE", ("fine",))
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


def point(engine: str, wall_s: float, error: float | None) -> Point:
    return Point(engine, "rigid", "rtol=1", "dop853", wall_s, 0.0, 1, error, "")


def chart_speed(*points: Point) -> WorkPrecision:
    return WorkPrecision("chart", "marker:tip.position", "the stored reference", 1e-12, 1.0, points)


def test_the_unit_of_time_is_the_fastest_run_that_is_accurate_enough() -> None:
    rough, good, fine = point("a", 0.1, 1e-3), point("b", 2.0, 1e-6), point("a", 5.0, 1e-9)
    assert unit_of_time(chart_speed(rough, good, fine)) == 2.0
    assert unit_of_time(chart_speed(rough)) == 0.1, "where none is, the most accurate one"
    assert unit_of_time(chart_speed(point("a", 3.0, None), point("a", 0.0, 1e-9))) is None
    assert unit_of_time(chart_speed()) is None


def test_an_engine_stands_by_its_fastest_run_in_every_chart() -> None:
    one = chart_speed(point("a", 1.0, 1e-7), point("a", 0.5, 1e-8), point("b", 2.0, 1e-7), point("c", 0.1, 1e-2))
    other = chart_speed(point("a", 3.0, 1e-7), point("b", 1.0, 1e-7), point("b", 9.0, None))
    assert fastest(one, REACHED) == {"a": 0.5, "b": 2.0}
    found = standing([one, other], "a", REACHED)
    assert (found.ratio, found.reached, found.first) == (2.0, 2, 1)
    assert standing([one, other], "b", REACHED).ratio == 2.5
    never = standing([one, other], "c", REACHED)
    assert (never.ratio, never.reached, never.first) == (None, 0, 0)


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> tuple[SessionOutcome, Path]:
    return session(tmp_path_factory.mktemp("speed"), MANY)


def test_the_index_has_every_run_with_an_error_and_a_way_to_its_chart(written: tuple[SessionOutcome, Path]) -> None:
    text = written[1].read_text(encoding="utf-8")
    assert text.index("Speed against accuracy</h2>") < text.index("Cases and engines</h2>")
    (data,) = re.findall(r'<script type="application/json" id="speed-data">(.*?)</script>', text, flags=re.DOTALL)
    found = msgspec.json.decode(data)
    (drawn,) = found["charts"]
    assert drawn["link"] == "pendulum/single.html#case-0-speed" and drawn["unit_s"] > 0.0
    assert {each["engine"] for each in drawn["points"]} == {"fine", "stepper"}, "what diverged has no error"
    assert all(each["error"] >= drawn["doubt"] > 0.0 for each in drawn["points"])
    assert set(found["engines"]) == {"fine", "stepper", "diverger"} and found["engines"][-1] == "diverger"
    assert "not reached" in text.partition("Charts by case")[2]


def test_a_session_without_a_chart_has_no_such_section(tmp_path: Path) -> None:
    _, index = session(tmp_path, re.sub(r"\[\[chart\]\]\n(.+\n)+", "", MANY))
    assert "Speed against accuracy</h2>" not in index.read_text(encoding="utf-8")


TABLES = arrays(np.float32, array_shapes(min_dims=2, max_dims=2, max_side=12), elements=st.floats(width=32))


@given(st.lists(TABLES, min_size=1, max_size=5))
def test_every_series_comes_back(tables: list[np.ndarray]) -> None:
    store = Store()
    numbers = [store.samples(table.astype(float)) for table in tables]
    found = series_of(store.packed())
    for number, table in zip(numbers, tables, strict=True):
        np.testing.assert_array_equal(found[number], table)


def test_the_same_is_stored_once() -> None:
    store = Store()
    values = np.linspace(0.0, 1.0, 50)[:, None]
    first = store.samples(values)
    before = len(store.packed()["data"])
    assert store.samples(values.copy()) == store.times(values[:, 0].copy()) == first
    assert len(store.packed()["data"]) == before
    assert store.samples(values.reshape(25, 2)) != first


def test_smooth_signals_take_less_than_their_numbers() -> None:
    store = Store()
    t = np.linspace(0.0, 10.0, 201)
    store.samples(np.stack([np.sin(t + phase) for phase in range(12)], axis=1))
    assert len(store.packed()["data"]) < 0.8 * 4 * 201 * 12 * 4 / 3


def test_no_series_no_data() -> None:
    assert Store().packed() == {"shapes": [], "data": ""}
