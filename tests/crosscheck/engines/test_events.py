"""Scenes with events run in flexmb; engines that know no events say so before anything runs."""

import pytest

import flexmb as fm
from crosscheck.engines.checked import CheckedEngine
from crosscheck.engines.registry import engine
from flexmb.run.warm_up import pendulum
from flexmb.scene.schema import Scene

LATCH = fm.SceneEvent(
    name="caught", watch="pivot.rotation", level=-1.0, actions=(fm.Latch(coordinate="pivot.rotation"),)
)


def eventful() -> Scene:
    return fm.SceneBuilder("caught").add(*pendulum().bodies, *pendulum().hinges, *pendulum().markers, LATCH).scene()


@pytest.mark.parametrize("name", ["pinocchio", "mujoco", "exudyn", "exudyn-beam", "drake"])
def test_peers_refuse_scenes_with_events(name: str) -> None:
    support = CheckedEngine(engine(name)).supports(eventful())
    assert support.kind == "no" and "caught" in support.reason and "knows no events" in support.reason


@pytest.mark.parametrize("name", ["native", "native-composite", "native-frisch", "native-generalised-alpha"])
def test_our_own_algorithms_run_them(name: str) -> None:
    assert CheckedEngine(engine(name)).supports(eventful()).kind == "exact"
