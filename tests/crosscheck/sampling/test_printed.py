"""Spreads of channels where the inputs of a scene move by their last digits."""

import json
import math
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from crosscheck import cli
from crosscheck.library.case_error import CaseError
from crosscheck.library.find import load_case
from crosscheck.sampling import printed
from crosscheck.sampling.printed import RUNS, VariantSpreads, moved_text, printed_numbers, spreads
from tests.repo.project import ROOT

CASE = ROOT / "cases" / "pendulums" / "compound"


def test_a_number_is_known_to_half_of_its_last_printed_digit() -> None:
    text = "a = 1.25\nb = 3e-3\nc = [0.0, -2.50]\nd = 7\n[[e]]\nf = 1_000.5\ng = inf\nh = { i = 1.5e2 }\n"
    found = {number.name: number.half_digit for number in printed_numbers(text)}
    assert found == pytest.approx({"a": 0.005, "b": 5e-4, "c.1": 0.005, "e.0.f": 0.05, "e.0.h.i": 5.0})


def test_numbers_are_moved_where_they_stand_and_nowhere_else() -> None:
    text = "a = 1.25\nc = [0.5, 2.5]\n[[e]]\nf = 1.5\n"
    changed = moved_text(text, {("c", 1): 3.0, ("e", 0, "f"): 2.0})
    moved = {number.name: number.value for number in printed_numbers(changed)}
    assert moved == {"a": 1.25, "c.0": 0.5, "c.1": 3.0, "e.0.f": 2.0}
    nudged = math.nextafter(1.25, 2.0)
    assert [number.value for number in printed_numbers(moved_text(text, {("a",): nudged}))][0] == nudged


@pytest.fixture(scope="module")
def found() -> VariantSpreads:
    case = load_case(CASE)
    return spreads(case, next(variant for variant in case.run.variants if "native" in variant.engines))


def test_spreads_are_those_of_the_digits_that_are_printed(found: VariantSpreads) -> None:
    """Two ulp of some ten inputs are rounding; digits are of the order of the digits; both are not nothing."""
    assert found.moved > 5
    assert not found.failed
    each = max(found.channels.values(), key=lambda spread: spread.digits)
    assert 0.0 < each.ulp < 1e-11
    assert 1e-3 < each.digits < 10.0
    assert each.goal is not None
    assert each.U is not None


def test_one_more_printed_digit_is_a_tenth_of_the_spread(found: VariantSpreads, tmp_path: Path) -> None:
    """The negative control: the same numbers, printed with a zero more, spread ten times less."""
    folder = tmp_path / "pendulums" / "compound"
    shutil.copytree(CASE, folder)
    scene = folder / "scene.toml"
    text = scene.read_text(encoding="utf-8")
    scene.write_text(re.sub(r"(?<![\w.])(\d+\.\d+)(?![\d.eE])", r"\g<1>0", text), encoding="utf-8")
    case = load_case(folder)
    finer = spreads(case, next(variant for variant in case.run.variants if "native" in variant.engines))
    before = max(each.digits for each in found.channels.values())
    after = max(each.digits for each in finer.channels.values())
    assert 0.02 < after / before < 0.5


def test_runs_are_as_many_as_said(monkeypatch: pytest.MonkeyPatch) -> None:
    runs = []

    def counted(case: object, variant: object, scene: object) -> dict[str, np.ndarray]:
        runs.append(scene)
        return {"marker:tip.position": np.zeros((3, 3))}

    monkeypatch.setattr(printed, "_channels", counted)
    case = load_case(CASE)
    spreads(case, case.run.variants[0])
    assert len(runs) == RUNS


def test_a_scene_of_too_many_numbers_is_refused_before_it_is_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(printed, "MOST", 3)
    monkeypatch.setattr(printed, "_channels", None)
    case = load_case(CASE)
    with pytest.raises(CaseError, match="numbers, each of which is tried alone, and 3 are the most"):
        spreads(case, case.run.variants[0])


def test_no_result_at_all_is_no_spread_of_zero(monkeypatch: pytest.MonkeyPatch) -> None:
    runs = []

    def only_the_first(case: object, variant: object, scene: object) -> dict[str, np.ndarray]:
        runs.append(scene)
        if len(runs) > 1:
            raise ValueError("it stopped at t = 1 s")
        return {"marker:tip.position": np.zeros((3, 3))}

    monkeypatch.setattr(printed, "_channels", only_the_first)
    case = load_case(CASE)
    with pytest.raises(CaseError, match="no scene with moved inputs gave a result: it stopped at t = 1 s"):
        spreads(case, case.run.variants[0])


def test_signs_that_are_refused_together_are_drawn_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """A plate's inertias have nothing to spare: with few draws some of its scenes are refused, and are named."""
    monkeypatch.setattr(printed, "_channels", lambda *_: {"marker:tip.position": np.zeros((3, 3))})
    monkeypatch.setattr(printed, "RERUNS", 60)
    case = load_case(CASE)
    assert not spreads(case, case.run.variants[0]).failed
    monkeypatch.setattr(printed, "DRAWS", 1)
    assert any("triangle inequality" in text for text in spreads(case, case.run.variants[0]).failed)


def test_the_command_says_its_runs_before_and_names_what_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    runs = []

    def failing(case: object, variant: object, scene: object) -> dict[str, np.ndarray]:
        runs.append(scene)
        if len(runs) == RUNS:
            raise ValueError("it stopped at t = 1 s")
        return {"marker:tip.position": np.zeros((3, 3))}

    monkeypatch.setattr(printed, "_channels", failing)
    result = CliRunner().invoke(cli.app, ["sensitivity", str(CASE), "--json"])
    assert result.exit_code == 1
    told = json.loads(result.stdout[result.stdout.index("{") :])
    (of_variant,) = next(iter(told.values()))["variants"].values()
    assert of_variant["failed"] == ["it stopped at t = 1 s"]
    assert f"{RUNS} runs of native" in result.output
