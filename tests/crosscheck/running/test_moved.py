"""Runs with moved inputs: what is moved, what comes into U, and that a planted error is not taken for rounding."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from crosscheck.engines.contract import Effort, Run
from crosscheck.engines.native import NativeEngine
from crosscheck.judging.outcome import conclude
from crosscheck.judging.results import collect
from crosscheck.judging.verdict import Finding, Signal, compare
from crosscheck.library.find import load_case
from crosscheck.records.archive import read
from crosscheck.records.kinds import RunRecord
from crosscheck.running import moved
from crosscheck.running.job import Job
from crosscheck.running.moved import ULP, moved_scene
from crosscheck.running.rung import determined
from flexmb.run.rounding import ulp_of_arithmetic
from flexmb.scene.build import SceneBuilder
from flexmb.scene.schema import Scene
from tests.crosscheck.sessions import copy_case, sweep_here, versus

ASKS = versus("fine", "stepper").replace(
    'engines = ["fine", "stepper"]\n', 'engines = ["fine", "stepper"]\nrounding = true\n', 1
)


def chain(ratio: float, angle: float = 0.3) -> Scene:
    """Two rods in a plane, the inner one lighter by a factor, at an angle (rad) above the horizontal."""
    builder = SceneBuilder("chain", gravity=(0.0, -9.81, 0.0))
    for name, mass in (("inner", 1.1 / ratio), ("outer", 1.3)):
        inertia = tuple(mass * each for each in (0.0101, 0.0903, 0.0907))
        builder.rigid_body(name, mass=mass, com=(0.51, 0.0, 0.0), inertia=inertia, nodes={"end": (1.03, 0.0, 0.0)})
    builder.revolute("shoulder", "ground", "inner", angle=angle).revolute(
        "elbow", "inner", "outer", parent_node="end", angle=0.7
    )
    return builder.marker("tip", "outer", node="end").scene()


def numbers(node: object) -> list[float]:
    if isinstance(node, dict):
        return [each for value in node.values() for each in numbers(value)]
    if isinstance(node, list | tuple):
        return [each for value in node for each in numbers(value)]
    return [node] if isinstance(node, float) else []


def test_all_numbers_but_whole_ones_move_by_two_ulp() -> None:
    scene = chain(7.0)
    now, then = (numbers(msgspec.to_builtins(each)) for each in (moved_scene(scene, np.random.default_rng(0)), scene))
    assert len(now) == len(then)
    steps = [(a - b) / math.ulp(b) for a, b in zip(now, then, strict=True) if not b.is_integer()]
    assert set(steps) <= {-float(ULP), float(ULP), -0.5 * ULP} and len(steps) > 12 and {-2.0, 2.0} <= set(steps)
    assert all(a == b for a, b in zip(now, then, strict=True) if b.is_integer())


def test_signs_that_are_refused_are_drawn_again_and_never_for_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    tried = []

    def refuse(scene: Scene) -> None:
        tried.append(scene)
        if len(tried) < 4:
            raise ValueError("no")

    monkeypatch.setattr(moved, "check_scene", refuse)
    assert moved_scene(chain(2.0), np.random.default_rng(0)) == tried[3]
    tried.clear()
    monkeypatch.setattr(moved, "DRAWS", 3)
    with pytest.raises(ValueError, match="no scene with numbers moved by 2 ulp is accepted: no"):
        moved_scene(chain(2.0), np.random.default_rng(0))


def test_a_chaotic_chain_makes_more_of_rounding() -> None:
    """What 2 units in the last place of the inputs do grows as a double pendulum turns over."""
    scene, effort, far = chain(1.3, 2.0), Effort("tolerance", 1e-12, "dop853"), {}
    for t_end in (1.0, 15.0):
        asked = Job("c", "v", "main", "native", scene, "id", np.linspace(0.0, t_end, 31), "", "", rounding=True)
        nominal = determined(NativeEngine().compile(scene).simulate(Run(asked.times), effort))
        far[t_end] = moved.rounding(NativeEngine(), asked, scene, effort, nominal)
        assert far[t_end].keys() == nominal.keys()
    assert far[15.0]["marker:tip.position"] > 100.0 * far[1.0]["marker:tip.position"] > 0.0


def test_derivatives_are_moved_too_and_a_channel_that_is_lost_is_told() -> None:
    scene, effort = chain(1.3), Effort("tolerance", 1e-10, "dop853")
    asked = Job("c", "v", "main", "native", scene, "id", np.linspace(0.0, 0.1, 3), "", "", linear=("derivatives",))
    run = NativeEngine().compile(scene).simulate(Run(asked.times, asked.linear), effort)
    assert moved.rounding(NativeEngine(), asked, scene, effort, determined(run))["derivatives.by_speed"] > 0.0
    with pytest.raises(ArithmeticError, match="moved by 2 ulp does not offer drive:none"):
        moved.rounding(NativeEngine(), asked, scene, effort, {"drive:none": np.zeros((3, 1))})


def records_of(folder: Path, run_file: str) -> list[RunRecord]:
    case = load_case(copy_case(folder, run_file))
    sweep_here([case], (), folder / "records.jsonl")
    return [each for each in read(folder / "records.jsonl") if isinstance(each, RunRecord)]


def test_u_has_it_and_an_error_of_ten_times_that_differs(tmp_path: Path) -> None:
    found = records_of(tmp_path / "with", ASKS)
    plain = records_of(tmp_path / "without", versus("fine", "stepper"))
    assert not any(each.rounding for each in plain)
    assert {each.rung == each.rungs - 1 for each in found if each.rounding} == {True}
    assert all(each.rounding == {} for each in found if each.rung < each.rungs - 1)
    channel = "marker:tip.position"
    (with_it,), (without,) = (collect(read(tmp_path / name / "records.jsonl")).cases for name in ("with", "without"))
    for (key, one), (_, other) in zip(sorted(with_it.results.items()), sorted(without.results.items()), strict=True):
        extra = one.finest.rounding[channel] * ulp_of_arithmetic(1)
        assert extra > 0.0, key
        assert one.uncertainty(channel).value == pytest.approx(other.uncertainty(channel).value + extra, rel=1e-12)
        assert "by rounding, as runs with moved inputs show" in one.uncertainty(channel).how
        signal = one.signal(channel, False)
        planted = {part: verdict(signal, part * one.uncertainty(channel).value) for part in (1.0, 10.0, 30.0)}
        assert [planted[part].status for part in (1.0, 10.0)] == ["agree", "differ"]


def verdict(signal: Signal, error: float) -> Finding:
    other = replace(signal, values=signal.values + np.array([error, 0.0, 0.0]))
    return compare("marker:tip.position", signal, other, 1.0)


def test_moved_inputs_without_a_result_are_a_failed_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Never a U that is too small in silence."""

    def nothing(scene: Scene, drawn: np.random.Generator) -> Scene:
        raise ValueError("no scene with numbers moved")

    monkeypatch.setattr(moved, "moved_scene", nothing)
    found = records_of(tmp_path, ASKS)
    finest = [each for each in found if each.rung == each.rungs - 1]
    assert finest and all(each.status == "failed" and "no scene with numbers moved" in each.message for each in finest)
    assert conclude(collect(read(tmp_path / "records.jsonl"))).counts().get("agree", 0) == 0


def test_a_second_session_takes_records_with_it_and_not_those_without(tmp_path: Path) -> None:
    case = copy_case(tmp_path, versus("fine", "stepper"))
    sweep_here([load_case(case)], (), tmp_path / "records.jsonl")
    first = len([each for each in read(tmp_path / "records.jsonl") if isinstance(each, RunRecord)])
    text = (case / "run.toml").read_text(encoding="utf-8")
    (case / "run.toml").write_text(
        text.replace("[[comparison]]", "rounding = true\n\n[[comparison]]", 1), encoding="utf-8"
    )
    sweep_here([load_case(case)], (), tmp_path / "records.jsonl")
    now = [each for each in read(tmp_path / "records.jsonl") if isinstance(each, RunRecord)]
    assert len(now) == 2 * first and any(each.rounding for each in now[first:])
    sweep_here([load_case(case)], (), tmp_path / "records.jsonl")
    assert len([each for each in read(tmp_path / "records.jsonl") if isinstance(each, RunRecord)]) == 2 * first
