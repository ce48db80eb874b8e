"""Which loads the motion leaves open, by the dense route: as flexmb's own algorithm finds them in its runs."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest

import flexmb
from crosscheck.engines.answers import LOAD_PARTS
from crosscheck.running.undetermined import undetermined
from flexmb.scene import schema as s
from flexmb.scene.files import load_scene
from tests.flexmb.closure import mechanisms
from tests.flexmb.closure.test_redundant_and_null import pendulum


def latched(scene: s.Scene) -> s.Scene:
    """Crank and rocker are both latched at 0.1 s: then one of them would do."""
    stops = tuple(s.Latch(coordinate=f"{hinge}.rotation") for hinge in ("drive", "pivot"))
    return msgspec.structs.replace(scene, events=(s.SceneEvent(name="stop", watch="time", level=0.1, actions=stops),))


DETERMINED = load_scene(Path(__file__).parents[3] / "cases" / "closed_chains" / "four_bar" / "scene.toml")
SCENES = {
    "plane": mechanisms.four_bar(), "determined": DETERMINED, "flexible": mechanisms.four_bar(modes=2),
    "driven": pendulum("weld", driven=s.Constant(value=0.0)), "latched": latched(DETERMINED),
}  # fmt: skip


def by_run(scene: s.Scene) -> set[str]:
    run = flexmb.simulate(scene, 0.2, samples=9, rtol=1e-8, atol=1e-10)
    found = set()
    for name, is_open in run.undetermined.items():
        if name.endswith(".drive") and name not in run.loads:
            found.add(f"drive:{name.removesuffix('.drive')}")
        else:
            found |= {f"load:{name}.{part}" for part, place in LOAD_PARTS.items() if np.any(is_open[place])}
    return found


@pytest.mark.parametrize("name", SCENES)
def test_what_is_open_is_what_the_run_finds_open(name):
    found = undetermined(SCENES[name], 0.2)
    assert set(found) == by_run(SCENES[name])
    assert bool(found) == (name in ("plane", "driven", "latched"))
    assert list(found) == sorted(found)


def test_a_latch_opens_nothing_before_it_happens():
    assert undetermined(SCENES["latched"], 0.05) == () == undetermined(SCENES["latched"])


def test_a_tree_has_none():
    assert undetermined(msgspec.structs.replace(SCENES["plane"], closures=()), 1.0) == ()
