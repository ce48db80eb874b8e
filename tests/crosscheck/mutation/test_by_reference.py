"""Faults before the stored reference: caught as those of a foreign code are, and only where the true run agrees."""

from __future__ import annotations

from pathlib import Path

import pytest

from crosscheck.library.find import load_case
from crosscheck.library.reference import KNOWLEDGE, VALUES
from crosscheck.mutation.campaign import run_campaign
from crosscheck.mutation.score import MutationScore
from crosscheck.mutation.subject import subject
from crosscheck.references.regenerate import regenerate
from tests.crosscheck.sessions import PROVIDER, copy_case, run_here

CASE = """
[[variant]]
name = "rigid"
engines = ["fine", "stepper"]
also = ["biased"]

[[comparison]]
name = "both"
variant = "rigid"
goals = { marker = 1e-6, "load" = 1e-6 }

[reference]
variant = "rigid"
samples = 11
channels = ["marker", "energy"]
goals = { marker = 1e-6, energy = 1e-6 }
engines = ["fine", "stepper", "biased"]

[[reference.route]]
engine = "fine"

[[reference.route]]
engine = "stepper"
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    found = copy_case(tmp_path_factory.mktemp("referenced"), CASE)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("crosscheck.references.routes.run_planned", run_here)
        regenerate(load_case(found), provider=PROVIDER)
    return found


def campaign(folder: Path, out: Path, engine: str) -> MutationScore:
    out.mkdir()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("crosscheck.mutation.campaign.run_planned", run_here)
        (score,) = run_campaign([load_case(folder)], out, engine=engine, provider=PROVIDER)
    return score


@pytest.fixture(scope="module")
def seeing(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> MutationScore:
    return campaign(folder, tmp_path_factory.mktemp("campaign") / "out", "fine")


def test_what_the_reference_asks_for_is_judged_beside_what_comparisons_do(folder: Path) -> None:
    assert set(subject(load_case(folder), "fine").goals) == {"marker", "load", "energy"}


def test_the_reference_catches_faults_of_the_scene_and_of_an_answer(seeing: MutationScore) -> None:
    noticed = {each.mutation for each in seeing.mutants if each.by_reference == "noticed"}
    assert {"com_sign", "gravity_sign", "gravity_dropped", "node_position"} <= noticed
    assert {"orientation_transposed", "velocity_axes", "late", "energy_gravity"} <= noticed
    assert seeing.score_by_reference is not None and seeing.score_by_reference >= 0.95
    assert all(set(each.reference) <= {*each.channels} for each in seeing.mutants)


def test_of_what_the_reference_does_not_hold_it_says_nothing(seeing: MutationScore) -> None:
    (reaction,) = [each for each in seeing.mutants if each.mutation == "load_reaction"]
    assert (reaction.outcome, reaction.by_reference) == ("noticed", None)


def test_an_engine_that_is_not_at_the_reference_itself_is_not_credited_with_differing(
    folder: Path, tmp_path: Path
) -> None:
    score = campaign(folder, tmp_path / "out", "biased")
    judged = {name for each in score.mutants for name in each.reference}
    assert "marker:tip.position" not in judged


@pytest.mark.parametrize(("file", "reason"), [(VALUES, "cannot be used"), ("", "no stored reference")])
def test_without_a_reference_that_can_be_used_the_reason_is_told(
    file: str, reason: str, folder: Path, tmp_path: Path
) -> None:
    (tmp_path / "case").mkdir()
    other = copy_case(tmp_path / "case", CASE)
    for name in (VALUES, KNOWLEDGE) if file else ():
        (other / name).write_bytes((folder / name).read_bytes())
    if file:
        (other / file).write_text("spoilt", encoding="utf-8")
    score = campaign(other, tmp_path / "out", "fine")
    assert score.score_by_reference is None and reason in score.no_reference
    assert score.score is not None
