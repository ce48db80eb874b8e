"""The closed-chain family: adapters at the first instant, what they refuse, and its folders judged as a user would."""

from pathlib import Path

import msgspec
import numpy as np
import pytest

from crosscheck.engines.contract import Effort, Run
from crosscheck.engines.registry import engine
from flexmb.scene.files import load_scene
from flexmb.scene.schema import Closure, Scene
from flexmb.surrogate import modal_points, rigidify

FAMILY = Path(__file__).parents[2] / "cases" / "closed_chains"
RIGID = ("four_bar", "slider_crank")
# Relative to the largest load or acceleration. Roundings of a dozen unknowns, amplified by inertias of bars about their
# axes (condition 1e3); Exudyn's differ further by differences over 1e-3 of a coordinate (see its kkt.py).
WITHIN = {"native-composite": 1e-12, "pinocchio": 1e-12, "exudyn": 1e-10}


def scene_of(case: str) -> Scene:
    return load_scene(FAMILY / case / "scene.toml")


@pytest.mark.parametrize("case", RIGID)
@pytest.mark.parametrize("name", WITHIN)
def test_first_accelerations_and_loads(case, name):
    pytest.importorskip({"native-composite": "flexmb"}.get(name, name))
    scene = scene_of(case)
    ours, theirs = (engine(each).compile(scene).evaluate() for each in ("native", name))
    size = max(np.max(np.abs(at.acceleration)) for at in ours.markers.values())
    for marker, at in ours.markers.items():
        assert np.max(np.abs(at.acceleration - theirs.markers[marker].acceleration)) <= WITHIN[name] * size
    size = max(np.max(np.abs(load)) for load in ours.loads.values())
    assert set(theirs.loads) == set(ours.loads) == {*(h.name for h in scene.hinges), scene.closures[0].name}
    for joint, load in ours.loads.items():
        assert np.max(np.abs(load - theirs.loads[joint])) <= WITHIN[name] * size


@pytest.mark.parametrize("case", RIGID)
def test_a_soft_closure_is_close_to_a_closed_one_and_differs(case):
    """MuJoCo's impedance of 0.9 leaves about a tenth of the acceleration across the closure."""
    pytest.importorskip("mujoco")
    scene = scene_of(case)
    support = engine("mujoco").supports(scene)
    assert support.kind == "surrogate" and "springs" in support.reason
    ours, theirs = (engine(each).compile(scene).evaluate() for each in ("native", "mujoco"))
    name = scene.closures[0].name
    off = np.linalg.norm(ours.loads[name] - theirs.loads[name]) / np.linalg.norm(ours.loads[name])
    assert 1e-3 < off < 0.3


def test_floating_frames_in_a_flexible_loop():
    """Exudyn's joints at deforming nodes are not workless: percents of a per mille; a wrong closure is off by all."""
    pytest.importorskip("exudyn")
    scene = modal_points(scene_of("flexible_four_bar"))
    support = engine("exudyn").supports(scene)
    assert support.kind == "surrogate" and 'closure "c"' in support.reason
    run = Run(np.linspace(0.0, 0.1, 11))
    ours = engine("native").compile(scene).simulate(run, Effort("tolerance", 1e-8, "dop853"))
    theirs = engine("exudyn").compile(scene).simulate(run, Effort("step", 1e-3, "GeneralizedAlpha"))
    assert ours.status == theirs.status == "finished"
    for joint, load in ours.loads.items():
        assert np.max(np.abs(load[:, :3] - theirs.loads[joint][:, :3])) < 5e-3 * np.max(np.abs(load[:, :3]))
    height = ours.markers["pin"].position[:, 2]
    assert np.max(np.abs(height - theirs.markers["pin"].position[:, 2])) < 1e-2 * np.max(height)


def closed_by(scene: Scene, **changes) -> Scene:
    return msgspec.structs.replace(scene, closures=(msgspec.structs.replace(scene.closures[0], **changes),))


REFUSED = [
    ("mujoco", closed_by(scene_of("four_bar"), type="universal"), "of type universal"),
    ("exudyn", closed_by(scene_of("four_bar"), body_b="ground", node_b="origin"), "exchange a and b"),
    ("native", rigidify(scene_of("flexible_four_bar")), "the mechanism is locked"),
    ("native-frisch", scene_of("four_bar"), "closures"),
]


@pytest.mark.parametrize(("name", "scene", "reason"), REFUSED, ids=[f"{name}-{reason}" for name, _, reason in REFUSED])
def test_what_cannot_be_run_is_refused_with_its_reason(name, scene, reason):
    support = engine(name).supports(scene)
    assert support.kind == "no" and reason in support.reason


def test_exudyn_takes_closures_of_every_type():
    """At the state that native finds for it: a second constraint on what is closed already changes nothing."""
    pytest.importorskip("exudyn")
    scene = scene_of("slider_crank")
    expected = engine("exudyn").compile(scene).evaluate().markers["slider"].acceleration
    turn = (np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0)  # z of the closure along the guide
    for kind in ("prismatic", "cylindrical"):
        second = Closure(
            name="again", type=kind, body_a="ground", body_b="slider", quaternion_a=turn, quaternion_b=turn
        )
        doubled = msgspec.structs.replace(scene, closures=(*scene.closures, second))
        found = engine("exudyn").compile(doubled).evaluate().markers["slider"].acceleration
        assert np.max(np.abs(found - expected)) < 1e-9 * np.max(np.abs(expected))
