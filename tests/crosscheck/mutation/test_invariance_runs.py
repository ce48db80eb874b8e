"""Invariances of whole runs: an engine that has only one World in it is found out, and what says nothing says why."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import msgspec
import pytest
from rich.console import Console

from crosscheck.library.find import load_case, shipped_folder
from crosscheck.mutation.invariance_runs import VERDICTS, InvarianceVerdict, run_invariances
from crosscheck.terminal.mutation import print_invariances
from tests.crosscheck.sessions import CASE, PROVIDER, run_here


def invariances(out: Path, engine: str) -> Sequence[InvarianceVerdict]:
    """Those of the small case, run in this process."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("crosscheck.mutation.invariance_runs.run_planned", run_here)
        return run_invariances([load_case(CASE)], out, engine=engine, provider=PROVIDER)


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("invariances")


@pytest.fixture(scope="module")
def verdicts(out: Path) -> dict[str, InvarianceVerdict]:
    """Of a pendulum in a few lines, which knows neither where its hinge stands nor which way its World is turned."""
    found = invariances(out, "fine")
    return {each.invariance: each for each in found}


def test_units_and_the_mirror_change_nothing(verdicts: dict[str, InvarianceVerdict]) -> None:
    for name in ("rescaled", "mirrored"):
        assert verdicts[name].status == "agree"
        assert verdicts[name].channels >= 10


@pytest.mark.parametrize("name", ["moved", "turned"])
def test_an_engine_with_one_world_is_found_out(name: str, verdicts: dict[str, InvarianceVerdict]) -> None:
    assert verdicts[name].status == "differ"
    assert "marker:tip.position" in verdicts[name].differing
    assert not verdicts[name].ok


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("boosted", "stands on the ground by pivot"),
        ("clock", "nothing depends"),
        ("later", "engine fine begins all runs at t = 0"),
        ("reordered", "one of each"),
    ],
)
def test_what_says_nothing_says_why(name: str, reason: str, verdicts: dict[str, InvarianceVerdict]) -> None:
    assert verdicts[name].status == "not applicable" and verdicts[name].ok
    assert reason in verdicts[name].reason


def test_they_are_printed_and_kept(out: Path, verdicts: dict[str, InvarianceVerdict]) -> None:
    console = Console(record=True, width=120)
    assert print_invariances(console, list(verdicts.values())) == 1
    text = console.export_text()
    assert "pendulum/single" in text and "moved: differ" in text
    stored = json.loads((out / VERDICTS).read_text(encoding="utf-8"))
    assert {each["invariance"]: each["status"] for each in stored["verdicts"]} == {
        name: each.status for name, each in verdicts.items()
    }


def test_an_absent_engine_is_no_agreement(tmp_path: Path) -> None:
    found = invariances(tmp_path, "missing")
    assert {each.status for each in found} == {"did not run", "not applicable"}
    assert print_invariances(Console(quiet=True), found) == 1


def of_a_pendulum_at_rest(out: Path, linear: bool) -> tuple[InvarianceVerdict, ...]:
    """Verdicts on MuJoCo about a hanging pendulum, which does not move."""
    case = load_case(shipped_folder() / "linearised" / "hanging_pendulum")
    if not linear:
        variants = tuple(msgspec.structs.replace(each, linear=msgspec.UNSET) for each in case.run.variants)
        case = replace(case, run=msgspec.structs.replace(case.run, variants=variants))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("crosscheck.mutation.invariance_runs.run_planned", run_here)
        return run_invariances([case], out, engine="mujoco")


def test_what_rests_says_nothing(tmp_path: Path) -> None:
    found = of_a_pendulum_at_rest(tmp_path, linear=False)
    assert all(each.status == "not applicable" and each.ok for each in found)
    assert {each.invariance for each in found if each.reason == "nothing moves"} >= {"turned", "rescaled", "reordered"}


def test_what_rests_is_compared_by_its_linearised_motion(tmp_path: Path) -> None:
    found = {each.invariance: each for each in of_a_pendulum_at_rest(tmp_path, linear=True)}
    compared = [found[name] for name in ("turned", "moved", "rescaled", "reordered", "mirrored")]
    assert {each.status for each in compared} == {"agree"}
    assert {each.channels for each in compared} == {4}  # three derivatives, and the frequencies
    assert all(each.channel.startswith(("derivatives.", "frequencies")) for each in compared)
    assert found["boosted"].status == "not applicable"
