"""Efforts besides those of an engine or a case, which engines a chaotic case gives more; how long a session takes."""

from pathlib import Path

import msgspec
import pytest

from crosscheck.engines.contract import Effort
from crosscheck.library.case import Variant
from crosscheck.library.case_error import CaseError
from crosscheck.library.find import load_case, resolve
from crosscheck.library.recipe import EffortLadder
from crosscheck.library.with_claims import with_claims
from crosscheck.records.archive import read
from crosscheck.records.kinds import RunRecord
from crosscheck.running.expected import BESIDES_S, OTHER_CODES, Remaining, expected_seconds
from crosscheck.running.job import extended, with_efforts
from crosscheck.running.rung import repeats_of
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


RECORD = RunRecord(
    case="case", variant="rigid", role="main", engine="native", version="1", scene="", status="finished",
    effort="coarse", compile_s=2.0, wall_s=1.0,
)  # fmt: skip


def test_a_job_takes_its_compilation_and_the_latest_run_of_every_effort() -> None:
    older = msgspec.structs.replace(RECORD, wall_s=50.0)
    short = msgspec.structs.replace(RECORD, effort="fine", wall_s=0.01)
    found = expected_seconds([older, "no run", RECORD, short])
    seconds = 2.0 + 1.0 + repeats_of(0.01) * 0.01 + BESIDES_S
    assert found == {("case", "rigid", "main", "native"): pytest.approx(seconds)}


def left_after(ended: list[tuple[str, float]], open_jobs: list[tuple[str, float | None]], at_s: float) -> float | None:
    """The estimate once jobs of an engine have taken so many seconds, two at a time, while others are open."""
    left = Remaining()
    jobs = [*((engine, None) for engine, _ in ended), *open_jobs]
    left.expect((number, engine, seconds) for number, (engine, seconds) in enumerate(jobs))
    for number, (_, took) in enumerate(ended):
        left.started(number, at_s - took)
        left.ended(number, at_s)
    return left.seconds(at_s)


def test_the_clock_corrects_what_was_expected() -> None:
    """One at a time, each twice as long as the last time: of the other 60 s are 120 s to come."""
    left = Remaining()
    left.expect([(0, "native", 30.0), (1, "native", 45.0), (2, "native", 15.0)])
    assert left.seconds(1.0) is None
    left.started(0, 0.0)
    left.ended(0, 60.0)
    assert left.seconds(60.0) == pytest.approx(120.0, rel=0.15)  # "as long as the last time" counts with a tenth
    left.started(1, 60.0)
    left.ended(1, 150.0)
    left.started(2, 150.0)
    left.ended(2, 180.0)
    assert left.seconds(180.0) == 0.0


def test_a_job_that_nobody_knows_takes_as_long_as_its_like() -> None:
    """The first of an engine also loads it."""
    ended = [("native", 9.0), ("native", 2.0), ("exudyn", 15.0), ("exudyn", 10.0)]
    assert left_after(ended, [("exudyn", None)] * 2 + [("native", None)] * 5, 18.0) == pytest.approx(30.0 * 18.0 / 36.0)


def test_of_an_engine_that_has_not_run_yet_only_is_known_whose_it_is() -> None:
    ended = [("native", 2.0), ("native", 2.0)]
    assert left_after(ended, [("native-frisch", None)], 4.0) == pytest.approx(2.0)
    assert left_after(ended, [("mujoco", None)], 4.0) == pytest.approx(2.0 * OTHER_CODES)


def test_no_estimate_before_a_part_of_the_work_is_done() -> None:
    """The first job of a session takes what starting takes; 39 minutes were told once for a run of five."""
    assert left_after([("native", 2.0)], [("native", None)] * 100, 2.0) is None
    assert left_after([("native", 2.0)] * 12, [("native", None)] * 100, 12.0) == pytest.approx(100.0)
    assert Remaining().seconds(10.0) is None


def test_what_a_running_job_has_done_already_is_not_to_come() -> None:
    left = Remaining()
    left.expect([(0, "native", 10.0), (1, "native", 10.0)])
    left.started(0, 0.0)
    left.ended(0, 10.0)
    left.started(1, 10.0)
    assert left.seconds(16.0) == pytest.approx(4.0)
    assert left.seconds(30.0) == 0.0
