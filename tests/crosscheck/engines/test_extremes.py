"""Envelopes of the library's own engines, by channel; and what the contract refuses."""

from dataclasses import replace

import numpy as np
import pytest

from crosscheck.engines.answers import BrokenContract, checked_run
from crosscheck.engines.contract import Effort, Run, Trajectory
from crosscheck.engines.extremes import ERROR, GREATEST, LEAST, T_LEAST, has_extremes
from crosscheck.engines.native import NativeEngine
from crosscheck.engines.openness import Openness
from crosscheck.library.find import load_case
from flexmb.ready import scenes
from flexmb.run.channels import channels_of
from flexmb.run.simulate import simulate
from tests.crosscheck.fake_engines import TOLERANCES, Pendulum
from tests.crosscheck.sessions import CASE
from tests.flexmb.run.test_envelope import latching, ringing
from tests.trees import random_scene

LOADED = load_case(CASE)
SCENE = LOADED.scene(LOADED.run.variants[0])
TIMES = np.linspace(0.0, 1.0, 11)


def test_what_samples_miss_behind_a_latch() -> None:
    model, times = NativeEngine().compile(latching()), np.linspace(0.0, 5.0, 21)
    run = checked_run(
        model.simulate(Run(times, envelope=True), Effort("tolerance", 1e-10, "dop853")), times, latching()
    )
    peak = ringing()
    assert np.abs(run.loads["rail"][:, 3]).max() < 0.75 * peak
    load = run.envelope["load:rail.force"]
    assert abs(max(-load[LEAST, 0], load[GREATEST, 0]) - peak) < 5e-4 * peak
    assert abs(load[GREATEST, 3] - peak) < 5e-4 * peak and load[LEAST, 3] >= 0.0  # the magnitude
    ((name, t),) = run.events
    assert name == "latch" and abs(t - 0.5) < 1e-9


def test_every_channel_but_the_work_has_one() -> None:
    """On closed chains without the undetermined loads, with the numbers of the library's own envelope."""
    for scene in (scenes.looped().scene(), random_scene(4)):
        run = checked_run(
            NativeEngine().compile(scene).simulate(Run(TIMES[:3], envelope=True), TOLERANCES[1]), TIMES[:3], scene
        )
        is_open = Openness.of(run.undetermined)
        wanted = {name for name in channels_of(run) if has_extremes(name) and name not in is_open} - {"work"}
        assert wanted == set(run.envelope)
        found = simulate(scene, 0.2, samples=3, rtol=1e-8, atol=1e-10).envelope
        total = found.energy["total"]
        assert run.envelope["energy.total"][:, 0].tolist() == [
            *map(float, (*total.least, *total.t_least, *total.greatest, *total.t_greatest, *total.error))
        ]
    assert not NativeEngine().compile(scene).simulate(Run(TIMES[:3]), TOLERANCES[1]).envelope


def with_extremes(**changed: object) -> Trajectory:
    run = Pendulum(SCENE).simulate(Run(TIMES, envelope=True), TOLERANCES[0])
    return replace(run, envelope=run.envelope | {name.replace("__", ":"): rows for name, rows in changed.items()})


@pytest.mark.parametrize(
    ("row", "value", "why"),
    [
        (LEAST, 1e9, "does not contain the run's own samples"),
        (GREATEST, -1e9, "does not contain the run's own samples"),
        (T_LEAST, 1.5, "a time outside the run"), (T_LEAST, -0.1, "a time outside the run"),
        (ERROR, -1.0, "a negative error"), (GREATEST, np.nan, "is not finite"), (GREATEST, np.inf, "is not finite"),
    ],
)  # fmt: skip
def test_extremes_that_cannot_be_are_refused(row: int, value: float, why: str) -> None:
    good = with_extremes()
    assert checked_run(good, TIMES, SCENE).envelope.keys() == good.envelope.keys()
    rows = good.envelope["energy.kinetic"].copy()
    rows[row] = value
    with pytest.raises(BrokenContract, match=why):
        checked_run(replace(good, envelope={**good.envelope, "energy.kinetic": rows}), TIMES, SCENE)


@pytest.mark.parametrize(
    ("name", "rows"),
    [
        ("energy.kinetic", np.zeros((5, 2))), ("energy.kinetic", np.zeros((4, 1))), ("energy.kinetic", np.zeros(5)),
        ("load:pivot.force", np.zeros((5, 3))), ("load:other.force", np.zeros((5, 4))), ("energy.kinetic", [1.0]),
        ("marker:tip.orientation", np.zeros((5, 4))),
    ],
)  # fmt: skip
def test_extremes_of_another_form_are_refused(name: str, rows: object) -> None:
    with pytest.raises(BrokenContract, match="envelope"):
        checked_run(replace(with_extremes(), envelope={name: rows}), TIMES, SCENE)


def test_a_run_that_did_not_finish_has_none() -> None:
    with pytest.raises(BrokenContract, match="envelope"):
        checked_run(replace(with_extremes(), status="diverged", message="at 1 s"), TIMES, SCENE)
