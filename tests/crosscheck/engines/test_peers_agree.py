"""Random rigid trees: every engine that represents them exactly agrees with Pinocchio at a random state."""

import numpy as np
import pytest

from crosscheck.engines.contract import Snapshot
from crosscheck.engines.links import first_armature
from crosscheck.engines.registry import engines
from flexmb.scene.build import SceneBuilder
from flexmb.scene.functions import Constant
from flexmb.scene.schema import Scene
from tests.crosscheck.engines.peers import taking
from tests.crosscheck.engines.random_scenes import KINDS, LATER_KINDS, random_scene
from tests.trees import with_armatures

ENGINES = engines()

# In minimal coordinates the system of about 20 freedoms is well conditioned: round-off is some 1e-13, and these bounds
# hold with room to spare. Redundant coordinates solve for constraint forces as well, with conditions of 1e6 and more.
ACCELERATION = 1e-10
LOAD = 1e-9
REDUNDANT = {"exudyn": 100.0}
NO_ARMATURES = ("basilisk", "dart", "exudyn", "opensim")


def _snapshot(name: str, scene: Scene) -> Snapshot:
    return taking(name, scene).compile(scene).evaluate()


def _equal_motion(ours: Snapshot, theirs: Snapshot, bound: float) -> None:
    for kind in ("position", "quaternion", "velocity", "acceleration"):
        ours_all = np.array([getattr(m, kind) for m in ours.markers.values()])
        theirs_all = np.array([getattr(theirs.markers[key], kind) for key in ours.markers])
        if kind == "quaternion":
            theirs_all *= np.sign(np.sum(ours_all * theirs_all, axis=1))[:, None]
        assert np.abs(ours_all - theirs_all).max() <= bound * np.abs(ours_all).max(), kind


def _compare(scene, name: str) -> None:
    worse = REDUNDANT.get(name, 1.0)
    ours, theirs = _snapshot("pinocchio", scene), _snapshot(name, scene)
    _equal_motion(ours, theirs, worse * ACCELERATION)
    for kind in ("loads", "wheel_loads"):
        a, b = getattr(ours, kind), getattr(theirs, kind)
        both = a.keys() & b.keys()
        assert a.keys() ^ b.keys() <= {point.name for point in scene.point_masses}  # an engine may not know these
        if both:
            scale = max(np.abs(load).max() for load in a.values())
            assert max(np.abs(a[key] - b[key]).max() for key in both) <= worse * LOAD * scale, kind
    assert ours.drives.keys() == theirs.drives.keys()
    for key, drive in ours.drives.items():
        assert np.abs(drive - theirs.drives[key]).max() <= worse * LOAD * max(1.0, np.abs(drive).max())
    for kind, energy in ours.energy.items():
        assert theirs.energy.get(kind, energy) == pytest.approx(energy, rel=1e-12, abs=1e-12)
    if theirs.momentum is not None:
        assert np.abs(ours.momentum - theirs.momentum).max() <= 1e-12 * np.abs(ours.momentum).max()


PEERS = [name for name in ENGINES if name != "pinocchio"]


@pytest.mark.parametrize("name", PEERS)
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("driven", [False, True], ids=["free", "driven"])
def test_random_tree(name, seed, driven):
    rng = np.random.default_rng(100 * driven + seed)
    kinds = ("revolute", *rng.choice(KINDS[:-1], 7)) if driven else ("free", *rng.choice(KINDS, 8))
    _compare(random_scene(rng, kinds, driven=driven), name)


@pytest.mark.parametrize("name", PEERS)
@pytest.mark.parametrize("driven", [False, True], ids=["free", "driven"])
def test_random_tree_with_armatures(name, driven):
    """Pinocchio, MuJoCo and Drake have armatures; the others refuse the first one by its name."""
    rng = np.random.default_rng(200 + driven)
    scene = random_scene(rng, ("revolute" if driven else "free", *rng.choice(KINDS[:-1], 8)), driven=driven)
    armed = with_armatures(scene, seed=1)
    if name in NO_ARMATURES:
        reason = ENGINES[name].supports(armed).reason
        assert "has an armature" in reason and first_armature(armed) in reason
    else:
        _compare(armed, name)
        _notices_armatures(scene, armed, name)


@pytest.mark.parametrize("name", PEERS)
def test_frames_without_mass_that_are_welded_to_others(name):
    """What every robot's file has: a base, a flange that carries the next link, a tool. MuJoCo refused them."""
    none = (0.0, 0.0, 0.0)
    builder = SceneBuilder("arm", gravity=(0.0, 0.0, -9.81))
    for frame in ("base", "flange", "tool"):
        builder.rigid_body(frame, mass=0.0, inertia=none)
    for link in ("upper", "lower"):
        builder.rigid_body(link, mass=1.0, com=(0.1, 0.0, -0.5), inertia=(0.1, 0.1, 0.01))
    builder.weld("b", "ground", "base").revolute("j", "base", "upper", axis=(0, 1, 0), angle=0.5, rate=1.0)
    builder.weld("f", "upper", "flange", parent_position=(0, 0, -1), parent_quaternion=(0.8, 0.6, 0.0, 0.0))
    builder.revolute("k", "flange", "lower", axis=(1, 0, 0), angle=0.2, rate=-2.0)
    builder.weld("t", "lower", "tool", parent_position=(0, 0, -1)).marker("end", "tool").marker("middle", "flange")
    _compare(builder.force("push", "tool", direction=(0, 1, 0), function=Constant(value=3.0)).scene(), name)


@pytest.mark.parametrize("name", ["mujoco"])
def test_points_of_mass_that_are_welded_to_light_links(name, monkeypatch):
    """The feet of a small quadruped. MuJoCo's were given an inertia, 1e-8 of this link's, and codes *differ* by it."""
    builder = SceneBuilder("leg", gravity=(0.0, 0.0, -9.81))
    builder.rigid_body("shank", mass=0.02, com=(0.0, 0.0, -0.005), inertia=(1e-7, 1.1e-7, 1e-7))
    builder.rigid_body("foot", mass=0.003, inertia=(0.0, 0.0, 0.0))
    builder.revolute("knee", "ground", "shank", axis=(0, 1, 0), angle=0.5, rate=1.0)
    scene = builder.weld("tip", "shank", "foot", parent_position=(0, 0, -0.01)).marker("foot", "foot").scene()
    _compare(scene, name)
    tree = pytest.importorskip("crosscheck.engines.mujoco.tree")
    raised = tree._principal
    monkeypatch.setattr(tree, "_principal", lambda inertia, least: raised(inertia, tree.LEAST_INERTIA))
    with pytest.raises(AssertionError, match="acceleration"):
        _compare(scene, name)


def _notices_armatures(scene: Scene, armed: Scene, name: str) -> None:
    """Without armatures the motion is another."""
    with pytest.raises(AssertionError, match="acceleration"):
        _equal_motion(_snapshot(name, scene), _snapshot(name, armed), ACCELERATION)


@pytest.mark.parametrize("name", [
    pytest.param(name, marks=pytest.mark.slow if name.startswith("native-") else ())  # each compiles for half a minute
    for name in PEERS
])  # fmt: skip
def test_random_tree_with_kinds_that_came_later(name):
    """... one by itself, one that is prescribed and one behind others."""
    rng = np.random.default_rng(7)
    kinds = [kind for later in LATER_KINDS for kind in (later, later, "spherical", later)]
    _compare(random_scene(rng, kinds, driven=True), name)
