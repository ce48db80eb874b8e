"""Connectors in other codes: at the first instant to rounding, over time to the error of their steps, or refused."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest

from crosscheck.engines.answers import support_of
from crosscheck.engines.contract import Effort, Run, Support
from crosscheck.engines.registry import engine
from flexmb.scene.connectors import AngularFriction, Connector, SpringDamper
from flexmb.scene.files import load_scene
from flexmb.scene.schema import Scene

CASE = Path(__file__).parents[3] / "cases" / "connectors" / "sprung_platform" / "scene.toml"
WITHIN = {"native-composite": 1e-12, "pinocchio": 1e-12, "mujoco": 1e-11, "drake": 1e-11, "exudyn": 1e-10}
LIBRARY = {"native-composite": "flexmb", "drake": "pydrake"}


def scene_for(name: str) -> Scene:
    """All connectors, or those that Exudyn has."""
    scene = load_scene(CASE)
    return only(scene, SpringDamper) if name == "exudyn" else scene


def only(scene: Scene, *kinds: type[Connector]) -> Scene:
    return msgspec.structs.replace(scene, connectors=tuple(x for x in scene.connectors if isinstance(x, kinds)))


def off(ours: dict, theirs: dict) -> float:
    """Largest difference of named arrays, relative to the largest number of all."""
    assert ours.keys() == theirs.keys()
    size = max((float(np.max(np.abs(each))) for each in ours.values()), default=1.0)
    return max((float(np.max(np.abs(ours[name] - theirs[name]))) for name in ours), default=0.0) / size


@pytest.mark.parametrize("name", WITHIN)
def test_first_instant(name):
    pytest.importorskip(LIBRARY.get(name, name))
    scene = scene_for(name)
    assert support_of(engine(name), scene).kind == "exact"
    ours, theirs = (engine(each).compile(scene).evaluate() for each in ("native", name))
    accelerations = [{marker: at.acceleration for marker, at in each.markers.items()} for each in (ours, theirs)]
    assert off(*accelerations) <= WITHIN[name]
    for output in ("loads", "connectors", "hinge_forces"):
        assert off(getattr(ours, output), getattr(theirs, output)) <= WITHIN[name]
    assert all(abs(ours.energy[kind] - theirs.energy[kind]) <= 1e-11 for kind in ours.energy)
    assert abs(ours.energy["spring"]) > 1.0


def test_springs_of_exudyn_over_time():
    """Of second order: a quarter of the error at half the step; a spring 1 % too stiff would be off by far more."""
    pytest.importorskip("exudyn")
    scene, run = scene_for("exudyn"), Run(np.linspace(0.0, 0.1, 6))
    ours = engine("native").compile(scene).simulate(run, Effort("tolerance", 1e-10, "dop853"))
    errors = []
    for step in (2e-3, 1e-3):
        theirs = engine("exudyn").compile(scene).simulate(run, Effort("step", step, "TrapezoidalIndex2"))
        assert theirs.status == "finished"
        errors.append(np.max(np.abs(ours.markers["top"].position - theirs.markers["top"].position)))
    assert errors[0] < 1e-4 and 3.5 < errors[0] / errors[1] < 4.5


@pytest.mark.parametrize("name", ["exudyn", "exudyn-beam"])
def test_what_an_adapter_does_not_have_it_refuses(name):
    scene = only(load_scene(CASE), AngularFriction)
    support = support_of(engine(name), scene)
    assert support.kind == "no" and "bearing" in support.reason


class Unaware:
    """An engine of somebody else, from before there were connectors, that takes any scene."""

    name = "unaware"

    def supports(self, scene: Scene) -> Support:
        return Support("exact")


def test_an_engine_that_knows_of_none_is_not_asked_to_leave_them_out():
    support = support_of(Unaware(), load_scene(CASE))
    assert support.kind == "no" and support.reason == '"spring a": the adapter of engine unaware knows no connectors'
    assert support_of(Unaware(), only(load_scene(CASE))).kind == "exact"
