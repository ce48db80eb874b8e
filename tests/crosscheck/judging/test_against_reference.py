"""An engine against the stored reference: what is judged, with which goals, and what must not pass."""

from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from crosscheck.judging.against_reference import NAME, ReferenceSignals, hold, shared_times
from crosscheck.judging.outcome import SessionOutcome, conclude
from crosscheck.judging.results import CaseResults, collect
from crosscheck.library.find import load_case
from crosscheck.library.reference import KNOWLEDGE, VALUES
from crosscheck.library.selection import goals_for_reference
from crosscheck.records.archive import read
from crosscheck.records.kinds import ReferenceGoals
from crosscheck.records.packing import pack, unpack
from crosscheck.records.session import last_session
from tests.crosscheck.sessions import copy_of, edit, referenced, sweep_here

CASE = """
[[variant]]
name = "rigid"
engines = ["fine", "stepper", "sloppy"]
also = ["biased", "refuser"]

[[comparison]]
name = "fine ones"
variant = "rigid"
engines = ["fine", "stepper"]
goals = { marker = 1e-6, "load" = 1e-6, energy = 1e-6 }

[[comparison]]
name = "a biased one"
a = { variant = "rigid", engine = "fine" }
b = { variant = "rigid", engine = "biased" }
goals = { "marker:tip.position" = 1e-6 }
expect = "differ"
band = { "marker:tip.position" = [1e-5, 1e-3] }
reason = "its gravity is 0.1 % too large"

[reference]
variant = "rigid"
samples = 11

[[reference.route]]
engine = "fine"

[[reference.route]]
engine = "stepper"
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A case with its reference."""
    return referenced(tmp_path_factory.mktemp("referenced"), CASE)


def judged(folder: Path, records: Path, asked: tuple[str, ...] = (), *, alone: bool = False) -> SessionOutcome:
    sweep_here([replace(load_case(folder), alone=alone)], asked, records)
    return conclude(collect(last_session(read(records))))


def against(outcome: SessionOutcome) -> dict[tuple[str, str], str]:
    return {(each.engine_a, each.channel): each.status for each in outcome.all if each.comparison == NAME}


def test_engines_that_agree_with_each_other_are_held_and_those_that_differ_are_not(
    folder: Path, tmp_path: Path
) -> None:
    outcome = judged(folder, tmp_path / "records.jsonl")
    found = against(outcome)
    assert {engine for engine, _ in found} == {"fine", "stepper"}
    assert set(found.values()) == {"agree"}
    assert ("fine", "load:pivot.force") in found
    assert ("fine", "momentum.linear") not in found  # for it there is no goal
    assert all(each.ok for each in outcome.all if each.comparison == NAME)


@pytest.mark.parametrize(("change", "engines"), [
    ("", {"fine", "stepper"}),
    ('goals = { "marker:tip.position" = 1e-3 }\n', {"fine", "stepper", "sloppy", "refuser"}),
    ('engines = ["sloppy"]\ngoals = { "marker:tip.position" = 1e-3 }\n', {"sloppy"}),
    ('engines = ["stepper", "biased"]\n', {"stepper", "biased"}),
])  # fmt: skip
def test_the_recipe_says_who_is_held(change: str, engines: set[str], folder: Path, tmp_path: Path) -> None:
    """With goals those too that no comparison names; one that is expected to differ only where it is named."""
    other = copy_of(folder, tmp_path / "case")
    edit(other / "run.toml", "samples = 11\n", f"samples = 11\n{change}")
    run = load_case(other).run
    assert set(goals_for_reference(run, ("fine", "stepper", "sloppy", "biased", "refuser"))) == engines


def test_an_engine_alone_needs_no_partner(folder: Path, tmp_path: Path) -> None:
    outcome = judged(folder, tmp_path / "records.jsonl", ("fine",), alone=True)
    assert {(each.engine_a, each.engine_b) for each in outcome.all} == {("fine", "reference")}
    assert outcome.ok
    with_partners = judged(folder, tmp_path / "more.jsonl", ("fine",))
    assert {"stepper", "reference"} <= {each.engine_b for each in with_partners.all}


@pytest.mark.parametrize(("engine", "status"), [("biased", "differ"), ("second", "agree")])
def test_an_engine_that_the_case_does_not_know_is_held(folder: Path, tmp_path: Path, engine: str, status: str) -> None:
    other = copy_of(folder, tmp_path / "case")
    text = (other / "run.toml").read_text(encoding="utf-8")
    head, _, rest = text.partition("\n[[comparison]]\nname = \"a biased one\"")
    (other / "run.toml").write_text(
        head.replace('also = ["biased", "refuser"]\n', "") + rest[rest.index("\n[reference]") :], encoding="utf-8"
    )
    outcome = judged(other, tmp_path / "records.jsonl", (engine,), alone=True)
    found = against(outcome)
    assert found[engine, "marker:tip.position"] == status
    assert outcome.ok == (status == "agree")


def test_an_engine_that_refuses_is_not_green(folder: Path, tmp_path: Path) -> None:
    other = copy_of(folder, tmp_path / "case")
    edit(other / "run.toml", "samples = 11", 'samples = 11\nengines = ["refuser"]')
    outcome = judged(other, tmp_path / "records.jsonl", ("refuser",), alone=True)
    assert set(against(outcome).values()) == {"refused"}
    assert not outcome.ok


def test_a_reference_of_another_scene_is_not_used(folder: Path, tmp_path: Path) -> None:
    other = copy_of(folder, tmp_path / "case")
    edit(other / "scene.toml", "9.81", "9.80")
    outcome = judged(other, tmp_path / "records.jsonl")
    assert set(against(outcome).values()) == {"did not run"}
    assert not outcome.ok
    assert any("was changed after" in each.reason for each in outcome.all)


@pytest.mark.parametrize("name", [VALUES, KNOWLEDGE])
def test_half_a_reference_is_not_used(folder: Path, tmp_path: Path, name: str) -> None:
    other = copy_of(folder, tmp_path / "case")
    (other / name).unlink()
    assert set(against(judged(other, tmp_path / "records.jsonl", ("fine",), alone=True)).values()) == {"did not run"}


def test_records_are_judged_where_the_case_is_not(folder: Path, tmp_path: Path) -> None:
    other = copy_of(folder, tmp_path / "case")
    before = against(judged(other, tmp_path / "records.jsonl"))
    for file in other.iterdir():
        file.unlink()
    again = conclude(collect(last_session(read(tmp_path / "records.jsonl"))))
    assert against(again) == before


@pytest.fixture(scope="module")
def results(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> CaseResults:
    records = tmp_path_factory.mktemp("results") / "records.jsonl"
    judged(folder, records)
    (case,) = collect(read(records)).cases
    return case


def wrong(case: CaseResults, change: object) -> set[str]:
    """Statuses of channels against a reference that was changed."""
    recorded = case.case.reference
    assert recorded is not None
    times = unpack(recorded.times)
    channels = {name: unpack(packed) for name, packed in recorded.channels.items()}
    signals = change(ReferenceSignals(times, channels, recorded.uncertainties))
    found = list(hold(case.get("rigid", "fine"), signals, ReferenceGoals(goals={"marker:tip.position": 1e-6})))
    assert found
    return {finding.status for _, _, finding in found}


POSITION = "marker:tip.position"


def with_rows(change: object) -> object:
    def changed(signals: ReferenceSignals) -> ReferenceSignals:
        return replace(signals, channels={**signals.channels, POSITION: change(signals.channels[POSITION])})

    return changed


@pytest.mark.parametrize(("change", "status"), [
    (lambda it: it, "agree"),
    (with_rows(lambda rows: rows * [1.0, -1.0, 1.0]), "differ"),
    (with_rows(lambda rows: rows + 1e-5), "differ"),
    (with_rows(lambda rows: rows * np.nan), "failed"),
    (with_rows(lambda rows: rows + np.inf), "failed"),
    (with_rows(lambda rows: rows[1:]), "failed"),
    (with_rows(lambda rows: rows[:, :2]), "failed"),
    (lambda it: replace(it, uncertainties={**it.uncertainties, POSITION: np.nan}), "unresolved"),
    (lambda it: replace(it, uncertainties={**it.uncertainties, POSITION: np.inf}), "unresolved"),
    (lambda it: replace(it, uncertainties={**it.uncertainties, POSITION: -1.0}), "unresolved"),
    (lambda it: replace(it, uncertainties={**it.uncertainties, POSITION: 1.0}), "unresolved"),
    (lambda it: replace(it, uncertainties={}), "unresolved"),
    (lambda it: replace(it, channels={}), "did not run"),
    (lambda it: replace(it, times=it.times + 0.05), "did not run"),
    (lambda it: replace(it, times=it.times * 2.0), "did not run"),
    (lambda it: replace(it, times=it.times[:0]), "did not run"),
])  # fmt: skip
def test_no_reference_is_bad_enough_to_pass(results: CaseResults, change: object, status: str) -> None:
    assert wrong(results, change) == {status}


def test_a_damaged_array_is_a_broken_line_not_a_reference(results: CaseResults, tmp_path: Path) -> None:
    recorded = results.case.reference
    assert recorded is not None
    bad = msgspec.structs.replace(recorded, times=msgspec.structs.replace(pack(np.zeros(3)), shape=(4,)))
    line = msgspec.json.encode(msgspec.structs.replace(results.case, reference=bad))
    (tmp_path / "records.jsonl").write_bytes(line + b"\n")
    (found,) = read(tmp_path / "records.jsonl")
    assert "not a record" in str(found)


def test_times_that_both_have() -> None:
    given = np.linspace(0.0, 10.0, 251)
    np.testing.assert_array_equal(shared_times(given[::2] * (1.0 + 1e-12), given), np.arange(0, 251, 2))
    np.testing.assert_array_equal(shared_times(given, given), np.arange(251))
    assert shared_times(given[:3] + 1e-3, given) is None
    assert shared_times(np.array([11.0]), given) is None
    far = np.array([0.0, 0.1, 0.2, 0.5, 0.7, 1e308])  # a time beyond all measure makes no others equal
    assert shared_times(np.linspace(0.0, 1.0, 6), far) is None
    assert shared_times(np.array([0.0]), given[:1]) == 0
    assert shared_times(given, given[:1]) is None
