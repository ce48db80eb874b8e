"""Labels: levels follow from files, and neither words nor changed files raise one."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import pytest
from typer.testing import CliRunner

from crosscheck import cli
from crosscheck.label.document import FILE, LabelFile, SubjectLabel, label
from crosscheck.label.evidence import BUDGETS, RESULTS, SPREADS, Exhibits, evidence, of_case, of_measured_set
from crosscheck.label.factors import CRITERIA, FACTORS, HIGHEST, Factor
from crosscheck.label.ladder import RULES, looked
from crosscheck.library.find import load_case, shipped_cases
from crosscheck.records.session import last_session
from crosscheck.report import write_all
from crosscheck.report.measured import write_measured
from crosscheck.sealed.seal import add_stamped, read_finished, stamped, write_results
from crosscheck.validation.budget import budget
from crosscheck.validation.measured_set import read_set
from tests.crosscheck.sessions import copy_case, edit, referenced, run_case, versus
from tests.crosscheck.validation.test_budget import LINE, SLOPE, made
from tests.repo.credibility import PAGE, page

NAME = "pendulum/single"
WITH_FAULT = """
[[control]]
name = "gravity upwards"
mutation = "gravity_sign"
a = { variant = "rigid", engine = "fine" }
b = { variant = "rigid", engine = "stepper" }
goals = { "marker:tip.position" = 1e-6 }

[[open]]
channels = ["marker", "load", "energy", "momentum", "work"]
reason = "one channel is enough here"

[reference]
variant = "rigid"
samples = 11

[[reference.route]]
engine = "fine"

[[reference.route]]
engine = "stepper"
"""


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a case that was run by two codes, its reference, and the outputs of the session in `out`."""
    folder = tmp_path_factory.mktemp("ran")
    case = referenced(folder, versus("fine", "stepper") + WITH_FAULT)
    run_case(case, folder / "out" / "records.jsonl")
    write_all(folder / "out" / "records.jsonl", folder / "out", chosen=last_session)
    return folder


@pytest.fixture
def again(ran: Path, tmp_path: Path) -> Path:
    """A copy, for changing."""
    return Path(shutil.copytree(ran, tmp_path / "again"))


def labelled(folder: Path) -> SubjectLabel:
    subject = of_case(load_case(folder / NAME))
    return label(subject, evidence(subject, folder / "out"))


def state(of: SubjectLabel, factor: Factor, file: str) -> tuple[str, str]:
    (piece,) = [piece for piece in of.factors[factor].evidence if piece.file == file]
    return piece.state, piece.why


def level(of: SubjectLabel, factor: Factor) -> int:
    return of.factors[factor].level


def test_every_factor_has_a_criterion_for_every_level_and_a_rung_for_all_but_none(ran: Path) -> None:
    subject = of_case(load_case(ran / NAME))
    found = evidence(subject, ran / "out")
    assert set(RULES) == set(CRITERIA) == set(FACTORS)
    for factor in FACTORS:
        assert len(CRITERIA[factor]) == HIGHEST + 1
        rungs = looked(factor, subject, found).rungs
        assert [rung.level for rung in rungs] == [1, 2, 3, 4]
        assert all(rung.remedy for rung in rungs)


def test_a_session_is_labelled_by_its_own_verdicts(ran: Path) -> None:
    """The file, the summary, the page of the case and the command say the same."""
    content = json.loads((ran / "out" / FILE).read_text())
    content.pop("sha256")
    written = msgspec.convert(content, LabelFile).subjects[NAME]
    assert written == labelled(ran)
    assert dict(zip(FACTORS, written.levels, strict=True)) == {
        "data_pedigree": 1, "verification": 4, "validation": 0, "input_pedigree": 1,
        "uncertainty": 1, "robustness": 1, "history": 2, "management": 2,
    }  # fmt: skip
    summary = (ran / "out" / "summary.md").read_text(encoding="utf-8")
    assert "| pendulum/single | 1 | 4 | 0 | 1 | 1 | 1 | 2 | 2 |" in summary
    (page,) = [page for page in (ran / "out" / "report").rglob("*.html") if page.name != "index.html"]
    text = page.read_text(encoding="utf-8")
    assert "1 · 4 · 0 · 1 · 1 · 1 · 2 · 2" in text
    (link,) = set(re.findall(r'href="([^"]*results\.json)"', text))
    assert (page.parent / link).resolve() == (ran / "out" / RESULTS).resolve()


def test_the_command_labels_a_session_and_a_case(again: Path) -> None:
    case, out = again / NAME, again / "out"
    words = [str(case), "--evidence", str(out), "--json", "--out", str(again / "mine.json")]
    result = CliRunner().invoke(cli.app, ["label", *words])
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert found["subjects"][NAME]["factors"]["verification"]["level"] == 4
    assert json.loads((again / "mine.json").read_text()) == found
    refused = CliRunner().invoke(cli.app, ["label", str(out)])  # the case is nowhere that the session could know
    assert refused.exit_code == 2
    nothing = CliRunner().invoke(cli.app, ["label", str(case), "--evidence", str(again / "nowhere")])
    assert nothing.exit_code == 0
    assert "crosscheck run" in nothing.output


def without_results(folder: Path) -> None:
    (folder / "out" / RESULTS).unlink()


def with_another_scene(folder: Path) -> None:
    scene = folder / NAME / "scene.toml"
    scene.write_text(scene.read_text(encoding="utf-8") + "\n# heavier\n", encoding="utf-8")


def with_a_wrong_digest(folder: Path) -> None:
    file = folder / "out" / RESULTS
    digest = read_finished(file).cases[NAME].files["scene.toml"]
    edit(file, digest, digest[::-1])


def with_a_better_figure(folder: Path) -> None:
    edit(folder / "out" / RESULTS, '"goal":1e-06', '"goal":1e-09')


@pytest.mark.parametrize(
    ("change", "now", "why"),
    [
        (without_results, "absent", ""),
        (with_another_scene, "stale", "scene.toml changed since"),
        (with_a_wrong_digest, "broken", "seal"),
        (with_a_better_figure, "broken", "seal"),
    ],
)
def test_evidence_that_is_gone_or_about_something_else_counts_as_none(
    change: Callable[[Path], None], now: str, why: str, again: Path
) -> None:
    change(again)
    after = labelled(again)
    found, reason = state(after, "verification", RESULTS)
    assert (found, why in reason) == (now, True), reason
    assert level(after, "verification") == 2  # what the stored reference shows
    assert level(after, "robustness") == 0
    assert after.factors["robustness"].raised_by.startswith("crosscheck run FOLDER")


def test_other_code_makes_evidence_stale(ran: Path) -> None:
    subject = replace(of_case(load_case(ran / NAME)), code="0123456789abcdef")
    after = label(subject, evidence(subject, ran / "out"))
    assert state(after, "verification", RESULTS) == ("stale", "the code of flexmb and crosscheck changed since")
    assert level(after, "management") == 1


def test_a_stored_reference_of_another_scene_or_provenance_counts_as_none(again: Path) -> None:
    without_results(again)
    assert level(labelled(again), "verification") == 2
    edit(again / NAME / "provenance.toml", "sources = [", 'notes = "newer"\nsources = [')
    stale = labelled(again)
    assert state(stale, "verification", "reference.toml") == ("stale", "provenance.toml changed since")
    assert level(stale, "verification") == level(stale, "history") == 0
    edit(again / NAME / "scene.toml", "mass_kg = ", "mass_kg = 1")
    assert "was changed after the reference was made" in state(labelled(again), "verification", "reference.toml")[1]


def test_a_level_cannot_be_claimed(again: Path) -> None:
    """Neither in the label itself, nor in a session without the runs, nor in words; a key for it is refused."""
    before = labelled(again).levels
    text = (again / "out" / FILE).read_text().replace('"level": 1', '"level": 4').replace('"level": 0', '"level": 4')
    (again / "out" / FILE).write_text(text)
    assert labelled(again).levels == before
    run = again / NAME / "run.toml"
    words = 'intended_use = "level 4"\nlimits = ["small"]\nwaivers = ["none"]\n'
    edit(run, "samples = 21", f"samples = 21\n{words}")
    after = labelled(again)
    assert (after.intended_use, after.limits, after.waivers) == ("level 4", ("small",), ("none",))
    assert all(now <= then for now, then in zip(after.levels, before, strict=True))
    edit(run, words, "verification = 4\n")
    refused = CliRunner().invoke(cli.app, ["label", str(again / NAME)])
    assert refused.exit_code == 2
    assert "verification" in refused.output


def test_every_case_of_the_library_states_its_use_and_its_limits() -> None:
    """In words of its own: no two cases have the same use."""
    cases = shipped_cases()
    assert all(case.run.limits and not case.run.intended_use.endswith(".") for case in cases)
    assert len({case.run.intended_use for case in cases} - {""}) == len(cases)


def resealed(folder: Path, change: Callable[[str, Any], Any]) -> None:
    """Change the verdicts of the session, and seal it anew as a program might that has found this."""
    results = read_finished(folder / "out" / RESULTS)
    case = results.cases[NAME]
    verdicts = {
        comparison: {key: change(verdict.kind, verdict) for key, verdict in table.items()}
        for comparison, table in case.verdicts.items()
    }
    cases = {NAME: msgspec.structs.replace(case, verdicts=verdicts)}
    write_results(msgspec.structs.replace(results, cases=cases), folder / "out")


def test_a_fault_that_nobody_noticed_is_no_verification(again: Path) -> None:
    def missed(kind: str, verdict: Any) -> Any:
        return msgspec.structs.replace(verdict, status="agree", ok=False) if kind == "control" else verdict

    resealed(again, missed)
    after = labelled(again)
    assert level(after, "verification") == 2
    assert level(after, "robustness") == 0


def test_an_agreement_that_failed_is_no_verification_of_level_3_and_one_that_grew_none_of_4(again: Path) -> None:
    def worse(kind: str, verdict: Any) -> Any:
        return msgspec.structs.replace(verdict, worse="E has grown") if kind == "comparison" else verdict

    resealed(again, worse)
    assert level(labelled(again), "verification") == 3
    assert "worse than recorded" in labelled(again).factors["verification"].raised_by

    def failed(kind: str, verdict: Any) -> Any:
        return msgspec.structs.replace(verdict, status="differ", ok=False) if kind == "comparison" else verdict

    resealed(again, failed)
    after = labelled(again)
    assert level(after, "verification") == 2
    assert level(after, "history") == 1


def test_one_code_does_not_verify_itself(tmp_path: Path) -> None:
    """Two engines of one name count as one code, however well they agree."""
    case = copy_case(tmp_path, versus("fine", "stepper"))
    run_case(case, tmp_path / "out" / "records.jsonl")
    write_all(tmp_path / "out" / "records.jsonl", tmp_path / "out", chosen=last_session)
    assert level(labelled(tmp_path), "verification") == 2
    text = (tmp_path / "out" / RESULTS).read_text().replace("stepper (rigid)", "fine-stepper (rigid)")
    (tmp_path / "out" / RESULTS).write_text(text)
    assert level(labelled(tmp_path), "verification") == 0  # its seal is broken
    content = json.loads(text)
    content.pop("sha256")
    from crosscheck.sealed.document import SealedResults

    write_results(msgspec.convert(content, SealedResults), tmp_path / "out")
    assert level(labelled(tmp_path), "verification") == 1


SPREAD = {"variants": {"rigid": {"moved": 3, "held": [], "failed": [], "channels": {"energy.total": {"digits": 0.1}}}}}


def test_spreads_count_while_they_are_as_they_were_written(again: Path) -> None:
    file = again / "out" / SPREADS
    add_stamped({"other/case": {}}, file)
    add_stamped({NAME: stamped(SPREAD, again / NAME)}, file)
    known = labelled(again)
    assert level(known, "robustness") == level(known, "uncertainty") == 2
    assert "by at most 1.0e-01" in known.factors["robustness"].because
    assert "other/case" in json.loads(file.read_text())
    edit(file, "0.1", "0.01")
    changed = labelled(again)
    assert state(changed, "robustness", SPREADS)[0] == "broken"
    assert level(changed, "robustness") == level(changed, "uncertainty") == 1
    failed = {"variants": {"rigid": {**SPREAD["variants"]["rigid"], "failed": ["it fell over"]}}}
    add_stamped({NAME: stamped(failed, again / NAME)}, file)
    assert level(labelled(again), "robustness") == 1
    for text in ("[]", "{", '{"pendulum/single": 4}', '{"pendulum/single": {"robustness": 4}}'):
        file.write_text(text)
        assert level(labelled(again), "robustness") == 1


def test_a_measured_set_is_labelled_by_its_budget(tmp_path: Path) -> None:
    folder = made(tmp_path / "set" if (tmp_path / "set").mkdir() is None else tmp_path, model=LINE + SLOPE)

    def now() -> tuple[SubjectLabel, Exhibits]:
        subject = of_measured_set("set", "a set", folder)
        found = evidence(subject, tmp_path / "out")
        return label(subject, found), found

    assert not any(now()[0].levels)
    assert "crosscheck validate set" in now()[0].factors["validation"].raised_by
    write_measured([budget(read_set(folder))], "one set", tmp_path / "out")
    of, found = now()
    assert found.budgets.piece.state == "fresh"
    assert (level(of, "validation"), level(of, "uncertainty"), level(of, "verification")) == (3, 3, 1)
    write_measured([budget(read_set(folder), samples=5)], "one set", tmp_path / "out")
    assert level(now()[0], "uncertainty") == 4
    file = tmp_path / "out" / BUDGETS
    text = file.read_text()
    file.write_text(text.replace('"samples": 5', '"samples": 500'))
    assert now()[1].budgets.piece.state == "broken"
    file.write_text(text)
    assert now()[1].budgets.piece.state == "fresh"
    (folder / "points.csv").write_text((folder / "points.csv").read_text() + "\n")
    of, found = now()
    assert found.budgets.piece == msgspec.structs.replace(found.budgets.piece, state="stale")
    assert not any(of.levels)


def test_a_model_error_is_known_and_not_validated(tmp_path: Path) -> None:
    folder = made(tmp_path, off=3.0)
    write_measured([budget(read_set(folder))], "one set", tmp_path / "out")
    subject = of_measured_set(folder.name, "a set", folder)
    assert level(label(subject, evidence(subject, tmp_path / "out")), "validation") == 2


def test_the_page_of_the_library_is_what_its_files_show() -> None:
    """Every shipped reference is of the scene and the provenance beside it."""
    assert PAGE.read_text(encoding="utf-8") == page()
