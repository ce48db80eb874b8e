"""The contract's check is total: whatever stands in any part of an answer, it is right or it is refused in words."""

import math
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

from crosscheck.engines.answers import (
    BrokenContract,
    checked_ladder,
    checked_run,
    checked_support,
    checked_version,
)  # fmt: skip
from crosscheck.engines.contract import Effort, MarkerPath, Run, Support, Trajectory
from crosscheck.library.find import load_case
from flexmb.run.channels import channels_of
from tests.crosscheck.fake_engines import TOLERANCES, Pendulum
from tests.crosscheck.sessions import CASE

TIMES = np.linspace(0.0, 1.0, 11)
LOADED = load_case(CASE)
SCENE = LOADED.scene(LOADED.run.variants[0])
SOLVED = Pendulum(SCENE).simulate(Run(TIMES), TOLERANCES[0])
GOOD = replace(SOLVED, work=np.zeros(11), drives={"pivot": np.zeros((11, 1))})
WRONG: tuple[Any, ...] = (
    None, True, False, -1, 0, 1, 10**30, -1.0, 0.0, 1e-320, 1e300, math.inf, -math.inf, math.nan, 1j, "", "text",
    "\ud800", b"bytes", (), [], {}, {"tip": None}, {None: None}, {"kinetic": 1.0}, object(), Ellipsis, np.zeros(0),
    np.zeros(11), np.zeros((11, 3)), np.zeros((11, 4)), np.zeros((11, 6)), np.full((11, 6), np.nan),
    np.full((11, 3), 1j),
    np.zeros((11, 6), object), np.float32(1.0), np.int64(-1), np.array(1.0), np.array("a"),
    np.datetime64("2026-01-01"),
    MarkerPath(None, None, None), Support("no"), Effort("step", math.nan, ""), GOOD, type, len,
)  # fmt: skip


@pytest.mark.parametrize("part", [field.name for field in fields(Trajectory)])
@pytest.mark.parametrize("status", ["finished", "diverged"])
def test_any_part_of_a_run_may_be_anything(part: str, status: str) -> None:
    for wrong in WRONG:
        accepted_is_sound(replace(replace(GOOD, status=status, message="why"), **{part: wrong}))


@pytest.mark.parametrize("part", [field.name for field in fields(MarkerPath)])
def test_any_part_of_a_marker_may_be_anything(part: str) -> None:
    for wrong in WRONG:
        accepted_is_sound(replace(GOOD, markers={"tip": replace(GOOD.markers["tip"], **{part: wrong})}))


@pytest.mark.parametrize("group", ["loads", "wheel_loads", "drives", "energy"])
@pytest.mark.parametrize("name", ["pivot", "tip", "kinetic", 0, None])
def test_any_entry_of_a_group_may_be_anything(group: str, name: Any) -> None:
    for wrong in WRONG:
        accepted_is_sound(replace(GOOD, **{group: {name: wrong}}))


def test_every_answer_may_be_anything() -> None:
    for wrong in WRONG:
        accepted_is_sound(wrong)
        for check in (checked_version, checked_support, checked_ladder):
            try:
                check(wrong)
            except BrokenContract as error:
                assert str(error)
            else:
                assert isinstance(wrong, str | Support)
        for field, kind in (("kind", Effort), ("value", Effort), ("method", Effort), ("reason", Support)):
            sound = Effort("step", 1e-3, "rk4") if kind is Effort else Support("exact")
            odd = replace(sound, **{field: wrong})
            try:
                coarse = (Effort("step", 1.0, ""), Effort("step", 0.5, ""))
                found = checked_ladder((*coarse, odd)) if kind is Effort else ()
                assert all(0.0 < effort.value < math.inf for effort in found)
                checked_support(odd if kind is Support else sound)
            except BrokenContract:
                continue


def accepted_is_sound(answer: Any) -> None:
    """What passes is a trajectory of plain finite float64 arrays at the times asked for; what does not says why."""
    try:
        run = checked_run(answer, TIMES, SCENE)
    except BrokenContract as error:
        assert str(error)
        return
    assert run.status in ("finished", "diverged", "failed")
    assert np.array_equal(run.times, TIMES[: len(run.times)])
    assert len(run.times) == len(TIMES) or run.status != "finished"
    assert 0.0 <= run.wall_s < math.inf and 0 <= run.evaluations < 2**63
    run.message.encode()
    if len(run.times):
        for values in channels_of(run).values():
            assert type(values) is np.ndarray and values.dtype == np.float64 and values.shape[0] == len(run.times)
            assert np.all(np.isfinite(values))


def test_a_run_may_end_before_its_first_sample() -> None:
    """Every array is there, and empty: the run keeps its own status and reason."""
    tip = GOOD.markers["tip"]
    empty = replace(
        GOOD, status="diverged", message="singular at 0 s", times=TIMES[:0], momentum=GOOD.momentum[:0],
        markers={"tip": MarkerPath(tip.position[:0], tip.quaternion[:0], tip.velocity[:0])}, loads={},
        drives={"pivot": np.zeros((0, 1))}, energy={"kinetic": np.zeros(0)}, work=np.zeros(0),
    )  # fmt: skip
    run = checked_run(empty, TIMES, SCENE)
    assert (run.status, run.message, len(run.times)) == ("diverged", "singular at 0 s", 0)
    with pytest.raises(BrokenContract, match="before its first sample of 1 s and called it done"):
        checked_run(replace(empty, status="finished"), TIMES, SCENE)
