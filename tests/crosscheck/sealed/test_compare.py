"""What became worse, better, new or gone between two sessions; what results.json holds: a change is noticed."""

import hashlib
import json
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import msgspec
import pytest

from crosscheck.judging.outcome import SessionOutcome, conclude
from crosscheck.judging.results import Session, collect
from crosscheck.library.find import load_case
from crosscheck.records.archive import read
from crosscheck.records.session import last_session
from crosscheck.sealed.badge import badge_json, badge_svg
from crosscheck.sealed.compare import Differences, compare_results
from crosscheck.sealed.document import (
    FORMAT,
    VERSION,
    Origin,
    SealedCase,
    SealedResults,
    SealedRun,
    SealedVerdict,
    results_of,
)  # fmt: skip
from crosscheck.sealed.seal import ResultsError, read_results, sealed_text
from tests.crosscheck.sessions import copy_case, sweep_here

PLACE = "load:pivot.force | mine (rigid) | native (rigid)"
SOUND = SealedVerdict(status="agree", E=1e-9, U=2e-9, goal=1e-6)
REPLACE = msgspec.structs.replace


def made(verdict: SealedVerdict | None = SOUND, run: SealedRun | None = None, **changes: Any) -> SealedResults:
    """A session with one verdict and one run."""
    case = SealedCase(
        files={"run.toml": "a"}, scenes={"rigid": "b"}, verdicts={"all": {} if verdict is None else {PLACE: verdict}},
        runs={"rigid | mine | main": run or SealedRun(status="finished", effort="rk4 h=0.1", wall_s=1.0)},
    )  # fmt: skip
    found = SealedResults(
        format=FORMAT, version=VERSION, exit_code=0, headline="", made=Origin(), records="", cases={"a/b": case}
    )
    return REPLACE(found, **changes)


def directions(differences: Differences) -> list[str]:
    return [change.direction for change in differences.changes]


def test_nothing_changed() -> None:
    found = compare_results(made(), made())
    assert (found.changes, found.times, found.notes, found.same) == ((), (), (), 1)
    assert not found.regressed


@pytest.mark.parametrize(
    "now",
    [
        REPLACE(SOUND, status="differ", ok=False, E=1e-3, reason="far apart"),
        REPLACE(SOUND, status="unresolved", ok=False, U=1e-3),
        REPLACE(SOUND, status="crashed", ok=False, E=None, U=None),
        REPLACE(SOUND, status="differ", expected="differ"),  # what is expected was weakened
        REPLACE(SOUND, U=2.1e-8),
        REPLACE(SOUND, E=2.1e-8),
        REPLACE(SOUND, E=None, U=None),
        REPLACE(SOUND, ok=False),  # beyond the bounds of what is expected
    ],
)
def test_worse_one_way_is_better_the_other(now: SealedVerdict) -> None:
    forth, back = compare_results(made(), made(now)), compare_results(made(now), made())
    assert (directions(forth), forth.regressed, forth.same) == (["worse"], True, 0)
    assert (back.regressed, "worse" in directions(back)) == (False, False)
    assert forth.changes[0].what == PLACE and forth.changes[0].how


@pytest.mark.parametrize(
    "now", [REPLACE(SOUND, U=1.9e-8), REPLACE(SOUND, E=1.9e-8), REPLACE(SOUND, E=0.0, U=0.0, goal=1e-3)]
)
def test_figures_within_the_factor_are_the_same_or_better(now: SealedVerdict) -> None:
    assert not compare_results(made(), made(now)).regressed


def test_rounding_may_grow() -> None:
    exact = REPLACE(SOUND, E=0.0, U=1e-16)
    assert compare_results(made(exact), made(REPLACE(exact, E=1e-13, U=1e-13))).changes == ()


def test_a_control_that_is_missed_is_worse() -> None:
    noticed = SealedVerdict(status="differ", kind="control", expected="differ", E=1e-2, U=1e-9)
    assert directions(compare_results(made(noticed), made(REPLACE(noticed, E=1e-4)))) == []
    missed = REPLACE(noticed, status="agree", ok=False)
    assert directions(compare_results(made(noticed), made(missed))) == ["worse"]


def test_what_is_not_judged_any_more_is_gone() -> None:
    assert directions(compare_results(made(), made(None))) == ["gone"]
    assert compare_results(made(), made(None)).regressed
    assert directions(compare_results(made(None), made())) == ["new"]
    assert not compare_results(made(None), made()).regressed


def test_a_case_that_is_not_there_any_more_is_gone() -> None:
    assert directions(compare_results(made(), made(cases={}))) == ["gone"]
    assert directions(compare_results(made(cases={}), made())) == ["new"]


def test_a_run_that_finishes_no_more_is_worse() -> None:
    for status in ("diverged", "crashed", "refused"):
        assert directions(compare_results(made(), made(run=SealedRun(status=status)))) == ["worse"]


def test_a_session_that_is_green_no_more_is_worse() -> None:
    """Though no verdict shows it: a lost run, a broken record, figures that a strict session misses."""
    assert directions(compare_results(made(), made(exit_code=1, headline="1 run gave no result"))) == ["worse"]


def test_times_are_told_and_judge_nothing() -> None:
    slow = SealedRun(status="finished", effort="rk4 h=0.1", wall_s=4.0)
    found = compare_results(made(), made(run=slow))
    assert (found.regressed, [time.ratio for time in found.times]) == (False, [4.0])
    assert compare_results(made(), made(run=REPLACE(slow, effort="rk4 h=0.05"))).times == ()
    assert compare_results(made(), made(run=REPLACE(slow, wall_s=1.2))).times == ()


def test_what_explains_a_change_is_noted() -> None:
    other = made()
    case = REPLACE(other.cases["a/b"], files={"run.toml": "changed", "reference.csv": "new"})
    other = REPLACE(other, cases={"a/b": case}, made=Origin(python="3.14", packages={"numpy": "3"}), strict=True)
    before = made(made=Origin(python="3.13", packages={"numpy": "2"}))
    notes = "\n".join(compare_results(before, other).notes)
    for words in ("other files than before: reference.csv, run.toml", "python: 3.13, now 3.14", "numpy was 2, now 3",
                  "other strict"):  # fmt: skip
        assert words in notes


UNSURE = REPLACE(SOUND, status="unresolved", ok=False, U=1e-3)


@pytest.mark.parametrize(
    ("then", "now", "worse"),
    [
        (None, UNSURE, True),  # new, and not as expected
        (None, SOUND, False),
        (UNSURE, UNSURE, False),
        (UNSURE, REPLACE(UNSURE, U=None), True),  # a U that is infinite is left out of the file
        (REPLACE(UNSURE, U=None), UNSURE, False),
        (REPLACE(UNSURE, U=None), REPLACE(UNSURE, U=None), False),
        (UNSURE, REPLACE(UNSURE, E=None, U=None), True),
        (UNSURE, REPLACE(UNSURE, status="crashed", E=None, U=None), True),
        (REPLACE(UNSURE, status="crashed"), UNSURE, False),
        (SOUND, REPLACE(SOUND, worse="U is 1e-3"), True),  # within a factor of the baseline, beyond the accepted figure
        (REPLACE(SOUND, worse="U is 1e-3"), REPLACE(SOUND, worse="U is 1e-3"), False),
        (SOUND, REPLACE(SOUND, stale="other efforts"), False),  # a note: nothing can be held against it
        (SOUND, REPLACE(SOUND, expected="differ", ok=False), True),  # an expected failure that agrees
        (REPLACE(UNSURE, status="differ"), REPLACE(UNSURE, status="differ", expected="differ", ok=True), False),
    ],
)
def test_worse_is_total_whatever_the_session_was(then: Any, now: Any, worse: bool) -> None:
    """Sessions that were red already: their exit code says nothing."""
    before, after = (made(each, exit_code=1) for each in (then, now))
    assert compare_results(before, after).regressed is worse


@pytest.mark.parametrize(
    ("then", "now", "worse"),
    [
        ("finished", "crashed", True),
        ("failed", "crashed", True),
        ("crashed", "failed", False),
        ("refused", "did not run", True),
        ("did not run", "did not run", False),
        ("did not finish", "finished", False),
    ],
)
def test_runs_are_worse_by_how_they_end(then: Any, now: Any, worse: bool) -> None:
    before, after = (made(UNSURE, SealedRun(status=each), exit_code=1) for each in (then, now))
    assert compare_results(before, after).regressed is worse


def test_new_runs_cases_engines_and_broken_lines_are_no_excuse() -> None:
    old = made(UNSURE, exit_code=1)
    case = old.cases["a/b"]
    crashed = REPLACE(case, runs=case.runs | {"rigid | other | main": SealedRun(status="crashed")})
    refused = REPLACE(case, runs=case.runs | {"rigid | other | main": SealedRun(status="refused")})
    assert compare_results(old, REPLACE(old, cases={"a/b": crashed})).regressed
    assert not compare_results(old, REPLACE(old, cases={"a/b": refused})).regressed
    assert compare_results(old, REPLACE(old, cases={"a/b": case, "a/c": case})).regressed, "a new case that is red"
    sound = made().cases["a/b"]
    assert not compare_results(old, REPLACE(old, cases={"a/b": case, "a/c": sound})).regressed
    assert compare_results(old, REPLACE(old, engines=("idle",))).regressed
    assert not compare_results(REPLACE(old, engines=("idle",)), REPLACE(old, engines=("idle",))).regressed
    assert compare_results(old, REPLACE(old, broken=1)).regressed
    stale = made(REPLACE(SOUND, stale="other efforts"))
    assert any("stale" in note for note in compare_results(made(), stale).notes)


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> tuple[Session, SessionOutcome, Path]:
    """The small case, run."""
    folder = tmp_path_factory.mktemp("session")
    records = folder / "records.jsonl"
    sweep_here([load_case(copy_case(folder))], (), records)
    found = collect(last_session(read(records)))
    return found, conclude(found), records


@pytest.fixture(scope="module")
def results(session: tuple[Session, SessionOutcome, Path]) -> SealedResults:
    return results_of(*session)


def written(results: SealedResults, folder: Path) -> Path:
    file = folder / "results.json"
    file.write_text(sealed_text(results), encoding="ascii")
    return file


def test_it_says_what_the_session_says(
    results: SealedResults, session: tuple[Session, SessionOutcome, Path], tmp_path: Path
) -> None:
    _, outcome, records = session
    found = read_results(written(results, tmp_path))
    assert found == results
    assert (found.exit_code, found.headline) == (0, outcome.headline)
    assert found.records == hashlib.sha256(records.read_bytes()).hexdigest()
    case = found.cases["pendulum/single"]
    assert sum(len(table) for table in case.verdicts.values()) == len(outcome.all)
    assert {"run.toml", "scene.toml", "provenance.toml"} == set(case.files)
    assert case.runs["rigid | fine | main"].status == "finished"
    assert case.runs["rigid | fine | main"].effort == "dop853 rtol=1e-12"
    assert found.made.engines == {"fine": "1.0", "stepper": "1.0"}
    figures = case.verdicts["rigid, all engines"]["marker:tip.position | fine (rigid) | stepper (rigid)"]
    assert figures.ok and figures.E is not None and figures.U is not None and figures.E <= figures.U


def test_every_changed_byte_is_noticed(tmp_path: Path) -> None:
    file = written(made(), tmp_path)
    text = file.read_bytes()
    assert len(text) > 400
    for place in range(len(text)):
        file.write_bytes(text[:place] + bytes([text[place] ^ 1]) + text[place + 1 :])
        with pytest.raises(ResultsError):
            read_results(file)


@pytest.mark.parametrize("change", [
    lambda data: b"\xef\xbb\xbf" + data, lambda data: data.replace(b"\n", b"\r\n"), lambda data: data + b"\n",
    lambda data: data.rstrip(b"\n"), lambda data: data.decode().encode("utf-16"),
    lambda data: data.replace(b'"made"', b'"\\u006dade"'),
])  # fmt: skip
def test_bytes_that_change_no_word_are_noticed_too(tmp_path: Path, change) -> None:
    """What editors and file transfers do: a byte order mark, other line ends, another encoding."""
    file = written(made(), tmp_path)
    before = file.read_bytes()
    file.write_bytes(change(before))
    assert file.read_bytes() != before
    with pytest.raises(ResultsError, match="results.json"):
        read_results(file)


@pytest.mark.parametrize("number", ["1e999", "-1e999", "9" * 5000, "1e9999999999", "0." + "9" * 10_000 + "e5000"])
def test_numbers_that_overflow_are_refused(tmp_path: Path, number: str) -> None:
    file = written(made(), tmp_path)
    file.write_bytes(file.read_bytes().replace(b'"version":1', f'"version":1,"more":{number}'.encode()))
    with pytest.raises(ResultsError, match=r"results\.json cannot be read"):
        read_results(file)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text[:-20], "cannot be read"),
        (lambda text: "", "cannot be read"),
        (lambda text: "[" * 100_000, "cannot be read"),
        (lambda text: text.replace('"E":', '"E":NaN,"e":'), "NaN is no number"),
        (lambda text: json.dumps(json.loads(text), indent=1), "was changed after it was written"),
        (lambda text: text.replace('"ok":false', ""), None),
        (lambda text: '{"format": "something"}', "no results.json of crosscheck"),
        (lambda text: text.replace('"version":1', '"version":2'), "of version 2"),
        (lambda text: text.replace('"sha256":"', '"sha256":"0'), "was changed after it was written"),
    ],
)
def test_other_files_are_refused(results: SealedResults, tmp_path: Path, change, message: str | None) -> None:
    file = written(results, tmp_path)
    file.write_text(change(file.read_text(encoding="ascii")), encoding="ascii")
    if message is None:
        assert read_results(file) == results
    else:
        with pytest.raises(ResultsError, match=message):
            read_results(file)


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(ResultsError, match=r"results\.json cannot be read"):
        read_results(tmp_path / "results.json")


def test_figures_that_are_no_numbers_are_left_out(
    session: tuple[Session, SessionOutcome, Path], tmp_path: Path
) -> None:
    found, outcome, records = session
    endless = [msgspec.structs.replace(verdict, U=float("inf"), E=float("nan")) for verdict in outcome.all]
    broken = SessionOutcome({"pendulum/single": endless}, [])
    read_back = read_results(written(results_of(found, broken, records), tmp_path))
    table = read_back.cases["pendulum/single"].verdicts["rigid, all engines"]
    assert all(each.E is None and each.U is None for each in table.values())


def test_the_badge_tells_the_outcome(session: tuple[Session, SessionOutcome, Path]) -> None:
    _, outcome, _ = session
    assert json.loads(badge_json(outcome)) == {
        "schemaVersion": 1, "label": "crosscheck", "message": "15 verdicts as expected", "color": "brightgreen"
    }  # fmt: skip
    red = SessionOutcome({"a": [msgspec.structs.replace(outcome.all[0], status="crashed")]}, [])
    assert json.loads(badge_json(red))["message"] == "0 of 1 as expected"
    assert json.loads(badge_json(red))["color"] == "red"
    assert json.loads(badge_json(SessionOutcome({}, [])))["message"] == "nothing compared"
    lost = SessionOutcome(outcome.verdicts, [], broken=("a line",))
    assert json.loads(badge_json(lost))["message"] == "incomplete"


def test_the_badge_is_a_picture(session: tuple[Session, SessionOutcome, Path]) -> None:
    picture = ElementTree.fromstring(badge_svg(session[1]))
    texts = [each.text for each in picture.iter("{http://www.w3.org/2000/svg}text")]
    assert texts == ["crosscheck", "15 verdicts as expected"]
