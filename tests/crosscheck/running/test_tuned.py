"""Ladders of charts: targets are met within a factor of ten, at most, or not; budgets hold; sessions keep runs."""

from math import inf
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from crosscheck.judging.results import CaseResults, collect
from crosscheck.library.case_error import CaseError
from crosscheck.library.efforts import TARGETS, is_met
from crosscheck.library.find import load_case
from crosscheck.records.archive import read
from crosscheck.records.kinds import ChartRecord, Confirmed
from crosscheck.records.session import last_session
from crosscheck.report.speed import meets, speed_tables
from crosscheck.report.workprecision import work_precision
from crosscheck.running.tuned import ProcessorBudget, TriedEffort, tune
from crosscheck.timing.charted import chart_jobs
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


class Method:
    """A method with error C value^p, whose runs take `second` s at value 1 and fail beyond a value."""

    def __init__(self, order: float, factor: float = 1.0, second: float = 0.0, unstable: float = inf) -> None:
        self.order, self.factor, self.second, self.unstable = order, factor, second, unstable
        self.tried = [self.run(1e-3), self.run(5e-4)]
        self.count = 0

    def run(self, value: float) -> TriedEffort:
        error = inf if value > self.unstable else self.factor * value**self.order
        return TriedEffort(value, error, max(self.second / value, 1e-9))

    def solve(self, value: float) -> float:
        self.count += 1
        self.tried.append(self.run(value))
        return self.tried[-1].cpu_s

    def tune(self, targets: tuple[float, ...] = TARGETS, coarsest: float = 1e3, left_s: float = 1.0) -> str:
        return tune(self.solve, self.tried, "step", coarsest, targets, ProcessorBudget(left_s))

    def unmet(self, targets: tuple[float, ...] = TARGETS) -> list[float]:
        return [target for target in targets if not any(is_met(each.error, target) for each in self.tried)]


@given(order=st.floats(1.0, 8.0), digits=st.floats(-3.0, 6.0))
def test_every_target_is_met_by_a_method_of_any_order(order: float, digits: float) -> None:
    method = Method(order, 10.0**digits)
    assert method.tune() == "" or method.unmet() == []
    assert method.unmet() == []
    assert method.count <= 4 * len(TARGETS)


def test_without_tuning_the_targets_are_not_met() -> None:
    """The negative control: the efforts that are judged are too accurate, or too few."""
    assert len(Method(4.0).unmet()) == len(TARGETS)


def test_the_coarsest_effort_may_be_more_accurate_than_the_target() -> None:
    method = Method(4.0)
    assert method.tune(coarsest=0.12) == "0.01: the coarsest effort is more accurate"
    assert method.unmet() == [0.1, 0.01]
    assert max(method.tried).value == 0.12


def test_beyond_its_limit_of_stability_a_method_has_no_effort() -> None:
    method = Method(4.0, unstable=0.01)
    assert "there is no effort between" in method.tune()
    assert max(each.value for each in method.tried if each.error < inf) > 0.008


def test_an_error_that_no_effort_reduces_is_sought_no_further() -> None:
    method = Method(0.0, 2e-3)
    assert method.tune() == "1e-09: finer efforts err no less"
    assert method.count < 10


def test_a_budget_is_kept() -> None:
    method = Method(1.0, second=1e-3)
    assert "the next run would take" in method.tune(left_s=5.0)
    spent = sum(each.cpu_s for each in method.tried[2:])
    assert spent < 5.0
    assert method.unmet()[0] < 1e-3, "coarse targets come first"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder: Path = tmp_path_factory.mktemp("charted")
    copy_case(folder, RUN_FILE)
    charted(folder)
    return folder


def charted(folder: Path) -> None:
    sweep_here([load_case(folder / "pendulum" / "single")], (), folder / "records.jsonl", follow=chart_jobs)


def results(folder: Path) -> CaseResults:
    (case,) = collect(last_session(read(folder / "records.jsonl"))).cases
    return case


def met(case: CaseResults, engine: str) -> list[float]:
    chart = work_precision(case, case.case.run.charts[0])
    assert chart is not None
    own = [point for point in chart.points if point.engine == engine]
    return [target for target in TARGETS if any(meets(chart, point, target) for point in own)]


def test_charts_of_a_session_have_runs_from_coarse_to_fine(folder: Path) -> None:
    case = results(folder)
    assert len(met(case, "stepper")) >= 6 and met(case, "fine")
    untuned = CaseResults(case.case, case.results)
    assert len(met(untuned, "stepper")) < len(met(case, "stepper"))
    assert ("rigid", "diverger") not in case.charted, "what did not finish has no charts"


def test_an_engine_that_errs_by_a_bias_stops_there(folder: Path) -> None:
    assert min(met(results(folder), "biased")) >= 1e-5
    assert "finer efforts err no less" in results(folder).charted["rigid", "biased"].message


def test_the_page_says_what_an_error_costs(folder: Path) -> None:
    (table,) = speed_tables(results(folder))
    rows = {row.engine: row.cells for row in table.rows}
    assert table.targets[0] == 0.1
    assert all(cell.solve_s is not None for cell in rows["fine"])
    assert any(cell.most for cell in rows["fine"]), "its loosest tolerance is more accurate than 1e-1"
    assert rows["biased"][-1].solve_s is None
    assert not any(cell.most for cell, target in zip(rows["stepper"], table.targets, strict=True)
                   if target in met(results(folder), "stepper"))  # fmt: skip


def test_judged_results_are_those_of_a_session_without_charts(folder: Path, tmp_path: Path) -> None:
    sweep_here([load_case(copy_case(tmp_path, RUN_FILE))], (), tmp_path / "records.jsonl")
    plain = results(tmp_path)
    assert plain.charted == {}
    assert {key: len(result.runs) for key, result in plain.results.items()} == {
        key: len(result.runs) for key, result in results(folder).results.items()
    }


def test_charts_are_confirmed_and_not_run_again(folder: Path) -> None:
    before = results(folder).charted
    charted(folder)
    records = read(folder / "records.jsonl")
    assert sum(isinstance(record, ChartRecord) for record in records) == len(before)
    assert sum(isinstance(record, Confirmed) and record.role == "chart" for record in records) == len(before)
    assert results(folder).charted == before
    np.testing.assert_equal(len(met(results(folder), "stepper")) >= 6, True)


def test_a_chart_of_some_engines_shows_and_tunes_no_others(tmp_path: Path) -> None:
    copy_case(tmp_path, RUN_FILE + 'engines = ["stepper"]\n')
    charted(tmp_path)
    case = results(tmp_path)
    chart = work_precision(case, case.case.run.charts[0])
    assert chart is not None and {point.engine for point in chart.points} == {"stepper"}
    assert list(case.charted) == [("rigid", "stepper")]
    with pytest.raises(CaseError, match="runs none of the chart's variants"):
        load_case(copy_case(tmp_path / "wrong", RUN_FILE + 'engines = ["refuser"]\n'))
