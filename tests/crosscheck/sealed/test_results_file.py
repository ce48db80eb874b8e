"""results.json: what it holds, and that a changed byte is noticed."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from xml.etree import ElementTree

import msgspec
import pytest

from crosscheck.judging.outcome import SessionOutcome, conclude
from crosscheck.judging.results import Session, collect
from crosscheck.library.find import load_case
from crosscheck.records.archive import read
from crosscheck.records.session import last_session
from crosscheck.sealed.badge import badge_json, badge_svg
from crosscheck.sealed.document import SealedResults, results_of
from crosscheck.sealed.seal import ResultsError, read_results, sealed_text
from tests.crosscheck.sealed.test_compare import made
from tests.crosscheck.sessions import copy_case, sweep_here


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
    assert json.loads(badge_json(lost)) ["message"] == "incomplete"


def test_the_badge_is_a_picture(session: tuple[Session, SessionOutcome, Path]) -> None:
    picture = ElementTree.fromstring(badge_svg(session[1]))
    texts = [each.text for each in picture.iter("{http://www.w3.org/2000/svg}text")]
    assert texts == ["crosscheck", "15 verdicts as expected"]
