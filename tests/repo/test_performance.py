"""docs/performance.md is what the generator makes of the kept measurements, and nothing that failed looks met."""

import os
import re
from dataclasses import replace
from math import inf, nan

import numpy as np
import pytest
from msgspec import structs

from crosscheck.report.workprecision import Point, WorkPrecision
from tests.benchmarks.must_hold import history
from tests.benchmarks.must_hold.catalogue import all_rows
from tests.benchmarks.must_hold.charts import dominated
from tests.benchmarks.must_hold.kept import Kept, Results, Special, read, write
from tests.benchmarks.must_hold.measure import measured_row
from tests.benchmarks.must_hold.page import PAGE, figures, page, special, verdict
from tests.benchmarks.must_hold.reasons import REASONS
from tests.benchmarks.must_hold.row import Call, Measured, RivalsDiffer, Row, how_many_times
from tests.benchmarks.must_hold.scaling import FOLDER, PICTURES

HALF = Row("half", "group", "a rival", 2.0, lambda: Measured(1.0, 0.9, 1.1, "1 s against 1 s"))
POINT = Point("native", "full", "rtol=1", "dop853", wall_s=1.0, compile_s=0.0, evaluations=1, error=1e-3, message="")


def test_the_page_is_what_the_generator_makes() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(read()), "run `python -m tests.benchmarks --from-kept --write`"


def test_every_kept_row_exists_and_the_page_has_all_rows() -> None:
    """One that was never measured says so."""
    assert set(read().rows) <= set(all_rows())
    text = PAGE.read_text(encoding="utf-8")
    for name in all_rows():
        (line,) = (line for line in text.splitlines() if line.endswith(f"| `{name}` |"))
        assert name in read().rows or "**not measured**" in line


def test_every_missed_row_has_its_reason() -> None:
    reasons = [name for reason in REASONS for name in reason.rows]
    assert sorted(set(reasons)) == sorted(reasons)
    assert set(reasons) <= set(all_rows())
    assert "no profile says why" not in page(read())


def test_a_reason_is_shown_only_where_a_row_is_missed() -> None:
    name = "fit_six"  # is met, and has no reason
    kept = read().rows[name]
    missed = structs.replace(kept, measured=structs.replace(kept.measured, value=100.0))
    assert f"Missed, `{name}`: no profile says why" in page(structs.replace(read(), rows={name: missed}))
    met = structs.replace(kept, measured=structs.replace(kept.measured, value=0.1))
    assert "Missed, " not in page(structs.replace(read(), rows={name: met}))


def test_every_picture_is_kept_and_drawn() -> None:
    assert set(read().scaling) == set(PICTURES)
    assert all((FOLDER / f"{name}.svg").exists() for name in PICTURES)


def test_the_history_ends_with_what_is_kept_and_is_drawn() -> None:
    """A measurement that was kept and not appended would be lost with the next one."""
    points = history.read_history()
    last = {point.row: (point.date, point.commit, point.value) for point in points}
    kept = {row.name: (row.date, row.commit, row.measured.value) for row in read().rows.values() if row.measured}
    assert {name: last.get(name) for name in kept} == kept, "run `python -m tests.benchmarks --from-kept --write`"
    assert history.PAGE.read_text(encoding="utf-8") == history.history_page(points)
    shown = re.findall(r"pictures/history/(.*?\.svg)", history.history_page(points))
    assert sorted(shown) == sorted(file.name for file in history.FOLDER.iterdir())


def test_a_measurement_is_appended_once(tmp_path) -> None:
    file = tmp_path / "history.jsonl"
    first = history.append(read(), file)
    assert first and history.append(read(), file) == first == history.read_history(file)
    name, kept = next((name, kept) for name, kept in read().rows.items() if kept.measured is not None)
    again = structs.replace(kept, commit="1234567")
    assert [point.commit for point in history.append(Results({name: again}), file)][len(first) :] == ["1234567"]


@pytest.mark.parametrize(("sense", "value", "margin"), [("at least", 3.0, 1.5), ("at most", 0.5, 4.0)])
def test_a_higher_margin_is_better(sense, value: float, margin: float) -> None:
    point = history.Point("2026-01-01", "1234567", HALF.name, value, value, value, "a machine")
    assert history.margin(replace(HALF, sense=sense), point) == margin


def test_another_figure_is_another_page() -> None:
    results = read()
    name, kept = next((name, kept) for name, kept in results.rows.items() if kept.measured is not None)
    other = structs.replace(kept, measured=structs.replace(kept.measured, value=123.0))
    assert page(structs.replace(results, rows=results.rows | {name: other})) != page(results)


def test_what_is_written_is_read(tmp_path) -> None:
    write(read(), tmp_path / "results.json")
    assert read(tmp_path / "results.json") == read()
    assert read(tmp_path / "none.json") == Results()


@pytest.mark.parametrize(("value", "met"), [(2.0, True), (1.99, False), (nan, False), (inf, False), (-inf, False)])
def test_only_a_number_that_reaches_the_goal_meets_it(value: float, met: bool) -> None:
    assert HALF.is_met(value) == met
    assert replace(HALF, sense="at most").is_met(value) == (np.isfinite(value) and value <= 2.0)


def test_verdicts() -> None:
    kept = measured_row(HALF)
    assert verdict(HALF, kept) == "missed"
    assert verdict(replace(HALF, goal=1.0), kept) == "met"
    assert verdict(HALF, None) == "not measured"


def test_a_row_that_raises_says_why_and_is_not_met() -> None:
    def crash() -> Measured:
        raise ZeroDivisionError("no rival")

    kept = measured_row(replace(HALF, measure=crash))
    assert kept.failure == "ZeroDivisionError: no rival"
    assert verdict(HALF, kept) == "failed"
    assert isinstance(kept, Kept)


@pytest.mark.parametrize("found", [[1.0, 2.1], [nan, 2.0], [1.0, 2.0, 3.0], [], [[1.0, 2.0], [1.0, inf]]])
def test_rivals_that_differ_are_not_timed(found: list) -> None:
    right = Call(lambda: None, 1, lambda: np.array([1.0, 2.0]))
    wrong = Call(lambda: None, 1, lambda: np.array(found))
    for pair in ((right, wrong), (wrong, right)):
        with pytest.raises(RivalsDiffer):
            how_many_times(*pair)


def test_samples_count() -> None:
    """Ten samples in one call: per sample a tenth of the time."""
    busy = Call(lambda: sum(range(2000)), 1, lambda: np.ones(1))
    assert 5.0 < how_many_times(busy._replace(samples=10), busy).value < 20.0


@pytest.mark.parametrize(
    ("other", "count"),
    [
        ({"wall_s": 0.5}, 1),
        ({"error": 5e-4}, 1),
        ({}, 0),  # as good in both
        ({"wall_s": 0.5, "error": 2e-3}, 0),
        ({"wall_s": 0.5, "error": None}, 0),
        ({"wall_s": 0.5, "variant": "rigid"}, 0),
        ({"wall_s": 0.5, "engine": "native-frisch"}, 0),
        ({"wall_s": 2.0, "error": 1e-9}, 0),
    ],
)
def test_a_point_that_a_peer_dominates_is_found(other: dict, count: int) -> None:
    peer = replace(POINT, **({"engine": "exudyn"} | other))
    chart = WorkPrecision("chart", "tip", "native", 1e-12, 1.0, (POINT, peer))
    assert len([*dominated(chart)]) == count


def test_errors_below_the_doubt_of_the_reference_are_alike_and_a_failed_run_is_worse_than_any() -> None:
    better = replace(POINT, engine="exudyn", error=1e-9)
    assert not [*dominated(WorkPrecision("chart", "tip", "native", 1e-2, 1.0, (POINT, better)))]
    failed = replace(POINT, error=None)
    assert [*dominated(WorkPrecision("chart", "tip", "native", 1e-12, 1.0, (failed, better)))]


def test_rows_are_measured_by_the_default_and_beside_it_by_special_kernels(monkeypatch) -> None:
    """Whatever the process was told, which stays as it was; seconds are those of compiling for the special ones."""
    monkeypatch.setenv("FLEXMB_KERNELS", "general")
    told, asked = [], replace(HALF, measure=lambda: _told(told))
    assert measured_row(asked).kernels == "auto" and told == [None]
    kept = measured_row(asked, special=True)
    assert told == [None, None, "special"] and os.environ["FLEXMB_KERNELS"] == "general"
    assert kept.special is not None and kept.special.compiled_s == 0.0
    kept = structs.replace(kept, special=Special(structs.replace(HALF.measure(), value=3.0), 7.2))
    assert special(HALF, kept) == "3, 7 s" and "(special)" not in figures(HALF, kept)[0]
    assert "(special)" in figures(HALF, structs.replace(kept, kernels="special"))[0]


def _told(found: list[str | None]) -> Measured:
    found.append(os.environ.get("FLEXMB_KERNELS"))
    return Measured(3.0, 3.0, 3.0, "")
