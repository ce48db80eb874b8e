"""Manufactured motions: engines return them within U, faults are noticed, and what has none is refused by name."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import msgspec
import numpy as np
import pytest
from typer.testing import CliRunner

import flexmb as fm
from crosscheck.cli.common import app
from crosscheck.engines.contract import EngineMissing
from crosscheck.engines.registry import engine
from crosscheck.library.case_error import CaseError
from crosscheck.library.find import load_case, shipped_folder
from crosscheck.library.reference import current_reference
from crosscheck.manufacture.case import held, sample_times
from crosscheck.manufacture.doubt import answers
from crosscheck.manufacture.drives import Manufactured, MotionLoads, manufacture, without_motors
from crosscheck.manufacture.motion import draw
from crosscheck.references.regenerate import regenerate
from flexmb.dense import DenseSystem
from flexmb.scene import schema as s
from flexmb.scene.files import dumps, loads, save_scene
from tests.crosscheck.manufacture import scenes
from tests.crosscheck.manufacture.through import ENGINES, SLOW_SEEDS, TIMES, Tally, faulty, outside, through

QUICK = (0, 1, 2, 6, 7)
SEEDS = [pytest.param(seed, marks=() if seed in QUICK else pytest.mark.slow) for seed in range(12)]
"""By default rigid bodies with and without losses and prescribed motions, a beam, a stiffened and a ruthless body."""


@cache
def made(seed: int) -> Manufactured:
    return manufacture(scenes.scene(seed), seed)


@cache
def exact(seed: int) -> tuple[dict[str, np.ndarray], dict[str, float]]:
    return answers(made(seed), TIMES)


@pytest.mark.parametrize("seed", SEEDS)
def test_native_returns_the_motion_and_every_load_within_its_u(seed: int) -> None:
    channels, known = exact(seed)
    found = held(engine("native"), made(seed).scene, TIMES, channels, known)
    assert found.keys() == channels.keys()
    assert any(name.startswith("load:") for name in found)
    assert not outside(found)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_number_that_is_off_by_a_ten_thousandth_is_noticed(seed: int) -> None:
    channels, known = exact(seed)
    assert outside(held(engine("native"), faulty(made(seed).scene, seed), TIMES, channels, known))


def test_a_scene_that_is_written_and_read_is_the_same(tmp_path: Path) -> None:
    assert loads(dumps(made(0).scene)) == made(0).scene


def test_the_bound_covers_coarse_tables() -> None:
    """The exact answers of a motion whose tables are far apart are off by what is stated, and no more than that."""
    bare = without_motors(scenes.scene(0))
    motion = draw(bare, DenseSystem(bare), 0, 1.0, 0.3)
    coarse = MotionLoads(bare, motion).manufactured(1.0, 16)
    times = np.linspace(0.0, 1.0, 9)
    channels, known = answers(coarse, times)
    found = held(engine("native"), coarse.scene, times, channels, known)
    positions = [name for name in found if name.endswith(".position")]
    assert not outside({name: found[name] for name in positions})
    assert max(found[name].error / known[name] for name in positions) > 0.03
    assert max(known[name] for name in positions) > 1e-9


def test_a_loop_is_driven_at_its_independent_coordinates() -> None:
    loop = fm.load_scene(shipped_folder() / "closed_chains" / "four_bar" / "scene.toml")
    found = manufacture(loop, 1, 0.5, 0.1)
    times = sample_times(0.5)
    channels, known = answers(found, times)
    assert "load:loop.force" in channels
    assert np.ptp(channels["load:loop.force"]) > 0.0
    assert not outside(held(engine("native"), found.scene, times, channels, known))


def test_what_has_no_such_motion_is_refused_by_name() -> None:
    pulsed = msgspec.structs.replace(
        scenes.scene(0),
        loads=(s.Load(name="kick", body="b0", type="force", direction=(1.0, 0.0, 0.0),
                      function=s.Pulse(value=1.0, start_s=0.3, duration_s=0.2)),),
    )  # fmt: skip
    with pytest.raises(CaseError, match="not smooth enough.*--amplitude"):
        manufacture(pulsed, 0)
    led = msgspec.structs.replace(
        pulsed, loads=(msgspec.structs.replace(pulsed.loads[0], function=s.ControlSignal(source="law")),)
    )
    with pytest.raises(CaseError, match='"kick" is led by a controller'):
        manufacture(led, 0)


def test_a_motion_through_a_singular_gimbal_is_refused_and_one_beside_it_is_not() -> None:
    """Native stops at 0.542 s, where the middle angle of this gimbal is zero; half the amplitude does not reach it."""
    with pytest.raises(CaseError, match="near t = 0.547 s .*singular angle.*--amplitude"):
        manufacture(scenes.rigid(141), 141)
    assert manufacture(scenes.rigid(141), 141, amplitude=0.1).duration_s == 1.0


def test_the_command_writes_a_case_that_is_read_and_cannot_be_regenerated(tmp_path: Path) -> None:
    save_scene(scenes.rigid(0), tmp_path / "scene.toml")
    folder = tmp_path / "family" / "case"
    words = ["manufacture", str(tmp_path / "scene.toml"), "--seed", "5", "--out", str(folder)]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    case = load_case(folder)
    assert "native" in case.run.variants[0].engines
    reference = current_reference(case)
    assert reference.knowledge.channels.keys() == reference.channels.keys()
    assert all(0.0 < each.uncertainty < 1e-6 for each in reference.knowledge.channels.values())
    with pytest.raises(CaseError, match="manufactured motion.*crosscheck manufacture"):
        regenerate(case)
    assert "is not empty" in CliRunner().invoke(app, words).output


@pytest.mark.slow
@pytest.mark.parametrize("name", ENGINES)
def test_two_hundred_trees_pass_every_engine_and_a_fault_is_noticed(name: str) -> None:
    """A fault in one element by 99 of 100. Motions that grow away from themselves have no answer."""
    tally = all_through(name)
    assert len(tally.refused) <= 0.1 * len(SLOW_SEEDS), tally.refused
    assert tally.tried >= 100
    assert len(tally.blind) <= 0.01 * tally.tried


OUTSIDE = pytest.mark.xfail(
    strict=True,
    reason="in two trees of a hundred, by up to 3.3: its sweeps leave 0.02 of the tolerance in each step, which adds "
    "up at tight ones, so that an error which changed its sign at the tolerance before grows again",
)


@pytest.mark.slow
@pytest.mark.parametrize("name", [
    pytest.param(name, marks=OUTSIDE if name == "native-exponential" else ()) for name in ENGINES
])  # fmt: skip
def test_two_hundred_trees_are_within_the_u_of_every_engine(name: str) -> None:
    assert not all_through(name).wrong


def all_through(name: str) -> Tally:
    """What became of the trees, run once; skipped where the engine is not installed."""
    try:
        return through(name, SLOW_SEEDS)
    except EngineMissing as error:
        pytest.skip(str(error))
