"""Efforts besides those of an engine or a case, and which engines a chaotic case gives more."""

from __future__ import annotations

from pathlib import Path

import pytest

from crosscheck.engines.contract import Effort
from crosscheck.library.case import Variant
from crosscheck.library.case_error import CaseError
from crosscheck.library.find import load_case, resolve
from crosscheck.library.recipe import EffortLadder
from crosscheck.library.with_claims import with_claims
from crosscheck.records.archive import read
from crosscheck.records.kinds import RunRecord
from crosscheck.running.ladder import extended, with_efforts
from tests.crosscheck.fake_engines import COARSE, STEPS
from tests.crosscheck.sessions import copy_case, sweep_here

RUN_FILE = """
finer = 2

[[variant]]
name = "rigid"
engines = ["fine", "stepper"]
efforts = [{ engine = "fine", kind = "tolerance", method = "dop853", values = [1e-6, 1e-8, 1e-10] }]

[[comparison]]
name = "all"
variant = "rigid"
goals = { "marker:tip.position" = 1e-6 }
"""


def values(records: Path, engine: str) -> list[float]:
    runs = (each for each in read(records) if isinstance(each, RunRecord) and each.role == "main")
    return [run.effort_value for run in runs if run.engine == engine]


def test_engines_that_join_a_chaotic_case_get_finer_efforts(tmp_path: Path) -> None:
    case, records = load_case(copy_case(tmp_path, RUN_FILE)), tmp_path / "records.jsonl"
    sweep_here([case], ("fine", "stepper", "sloppy"), records)
    own = [effort.value for effort in COARSE]
    assert values(records, "sloppy") == [*own, own[-1] / 2, own[-1] / 4]
    assert values(records, "stepper") == [effort.value for effort in STEPS], "the case names it"
    assert values(records, "fine") == [1e-6, 1e-8, 1e-10]


def test_extra_efforts_join_the_engines_own_and_those_of_the_case(tmp_path: Path) -> None:
    case, records = load_case(copy_case(tmp_path, RUN_FILE)), tmp_path / "records.jsonl"
    (case,) = with_claims([case], efforts=["fine=1e-9,1e-11", "stepper=1e-3"])
    sweep_here([case], (), records)
    assert values(records, "fine") == [1e-6, 1e-8, 1e-9, 1e-10, 1e-11]
    assert values(records, "stepper") == [*(effort.value for effort in STEPS), 1e-3]


def test_only_the_method_of_the_finest_effort_gets_more() -> None:
    other = Effort("tolerance", 1e-6, "old")
    found = extended((other, *STEPS), (1e-3,), 1)
    assert found[0] == other and [each.value for each in found[-2:]][0] == 1e-3
    assert found[-1].value == pytest.approx(1e-3 * 1e-3 / STEPS[-1].value) and found[-1].method == "rk4"
    assert extended(STEPS, (), 0) == STEPS


def test_a_ladder_that_the_case_does_not_prescribe_is_not_made() -> None:
    ladder = EffortLadder(engine="a", kind="step", method="m", values=(0.1, 0.05))
    variant = Variant(name="v", engines=("a", "b"), efforts=(ladder,))
    assert with_efforts(variant, "b", (0.01,)) == with_efforts(variant, "a", ()) == variant
    assert with_efforts(variant, "a", (0.01,)).efforts[0].values == (0.1, 0.05, 0.01)


@pytest.mark.parametrize("number", [-1, 9])
def test_a_number_of_finer_efforts_that_makes_no_sense_is_refused(tmp_path: Path, number: int) -> None:
    with pytest.raises(CaseError, match=rf"\$\.finer: {number} makes no sense"):
        load_case(copy_case(tmp_path, RUN_FILE.replace("finer = 2", f"finer = {number}")))


def test_the_chaotic_cases_of_the_library_ask_for_finer_efforts() -> None:
    assert all(case.run.finer for case in resolve(("chaotic",)))
