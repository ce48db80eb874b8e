"""Derivatives and frequencies of random trees: engines agree within what each says of its own, and that is little."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from crosscheck.engines.checked import CheckedEngine
from crosscheck.engines.contract import EngineMissing, Run, Trajectory
from crosscheck.engines.linear.coordinates import coordinate_names, modes_of, obstacle, places
from crosscheck.engines.linear.parts import DERIVATIVES, FREQUENCIES
from crosscheck.engines.registry import engine
from flexmb.linear.linearize import displacement_names, linearize
from flexmb.linear.variations import Equations
from flexmb.scene.build import SceneBuilder
from flexmb.scene.files import load_scene
from flexmb.scene.schema import Scene
from flexmb.system.compile import compile
from tests.crosscheck.engines.random_scenes import KINDS, random_scene
from tests.repo.project import ROOT
from tests.trees import with_armatures

TIMES = np.array([0.0, 1e-6])
KNOWN = {
    "native": 1e-10, "pinocchio": 1e-10, "drake": 1e-10, "mujoco": 1e-5, "native-composite": 1e-5,
    "native-frisch": 1e-5,
}  # fmt: skip
"""The largest error of a derivative, relative to its size, that an engine may claim of these well conditioned trees."""
OTHERS = [name for name in KNOWN if name != "native"]
SEEDS = range(4)


@cache
def tree(seed: int, driven: bool, armed: bool = False) -> Scene:
    rng = np.random.default_rng(400 + seed)
    first = "revolute" if driven else "free"
    scene = random_scene(rng, (first, *rng.choice(KINDS[:-1], 5)), driven=driven)
    return with_armatures(scene, seed=seed) if armed else scene


def asked(name: str, scene: Scene) -> Trajectory:
    tried = CheckedEngine(engine(name), duration_s=TIMES[-1])
    try:
        tried.version()
    except EngineMissing as missing:
        pytest.skip(str(missing))
    support = tried.supports(scene)
    if support.kind != "exact":
        pytest.skip(support.reason)
    run = tried.compile(scene).simulate(Run(TIMES, ("derivatives", "frequencies")), tried.efforts(scene)[-1])
    assert run.status == "finished", run.message
    return run


def agree(name: str, scene: Scene) -> None:
    """In the initial state, which all engines share."""
    ours, theirs = asked("native", scene), asked(name, scene)
    if name == "drake" and not theirs.derivatives:
        pytest.skip("a ball joint has a spring, whose torque the adapter computes beside the plant")
    for part in theirs.derivatives:
        a, b = ours.derivatives[part][0], theirs.derivatives[part][0]
        size, known = np.linalg.norm(a), theirs.known_to[part][0]
        assert known <= KNOWN[name] * size, (part, known, size)
        assert np.linalg.norm(a - b) <= known + ours.known_to[part][0], part
    apart = np.linalg.norm(ours.frequencies[0] - theirs.frequencies[0])
    assert apart <= ours.known_to[FREQUENCIES][0] + theirs.known_to[FREQUENCIES][0]


@pytest.mark.parametrize("name", OTHERS)
@pytest.mark.parametrize("seed", SEEDS)
def test_engines_agree_on_random_trees(name: str, seed: int) -> None:
    agree(name, tree(seed, driven=False))


@pytest.mark.parametrize("name", OTHERS)
@pytest.mark.parametrize("seed", SEEDS)
def test_engines_agree_beside_prescribed_coordinates(name: str, seed: int) -> None:
    agree(name, tree(seed, driven=True))


@pytest.mark.parametrize("name", ["pinocchio", "mujoco", "drake"])
@pytest.mark.parametrize("driven", [False, True], ids=["free", "driven"])
def test_armatures_are_part_of_the_mass_matrix(name: str, driven: bool) -> None:
    agree(name, tree(1, driven, armed=True))


@pytest.mark.parametrize("seed", SEEDS)
def test_the_names_of_coordinates_are_those_of_linear_models(seed: int) -> None:
    scene = tree(seed, driven=seed % 2 == 1)
    own = displacement_names(Equations(compile(scene)))[0]
    names = coordinate_names(scene)
    assert sorted(names) == sorted(own) and len(set(names)) == len(names)
    assert [own[place] for place in places(names, own)] == list(names)
    assert sum(modes_of(body) for body in scene.bodies) == 0 and obstacle(scene) == ""


def test_nothing_is_said_that_was_not_asked() -> None:
    scene = tree(0, driven=False)
    for name in ("native", "pinocchio", "mujoco"):
        tried = CheckedEngine(engine(name), duration_s=TIMES[-1])
        for part in ("derivatives", "frequencies"):
            run = tried.compile(scene).simulate(Run(TIMES, (part,)), tried.efforts(scene)[-1])
            given = set(run.derivatives) | ({FREQUENCIES} if run.frequencies is not None else set())
            assert given == set(run.known_to) == (set(DERIVATIVES) if part == "derivatives" else {FREQUENCIES})
        quiet = tried.compile(scene).simulate(Run(TIMES), tried.efforts(scene)[-1])
        assert not quiet.derivatives and quiet.frequencies is None and not quiet.known_to


@pytest.mark.parametrize("name", ["native", "pinocchio", "mujoco"])
def test_a_scene_without_shared_coordinates_has_no_derivatives(name: str) -> None:
    """Of a closed chain flexmb gives the frequencies alone: here of a pendulum that a closure holds to a line."""
    tree = SceneBuilder("held", gravity=(0.0, -9.81, 0.0)).rigid_body(
        "bar", mass=1.0, com=(0.0, -0.5, 0.0), inertia=(0.1, 0.1, 0.1)
    )
    tree.spherical("pivot", "ground", "bar").marker("bar", "bar")
    tree.closure("hold", "revolute", "ground", "bar", axis=(0.0, 0.0, 1.0))
    scene = tree.scene()
    support = engine(name).supports(scene)
    if support.kind == "no":
        pytest.skip(support.reason)
    run = asked(name, scene)
    assert not run.derivatives
    if name == "native":
        assert run.frequencies[0] == pytest.approx([np.sqrt(9.81 * 0.5 / 0.35)], rel=1e-12)


def test_exudyns_own_linearised_system_lacks_what_loads_of_joints_do():
    """As docs/linearised.md says. Where joints bear no loads it is right: then a new version may have repaired it."""
    assembly = pytest.importorskip("crosscheck.engines.exudyn.assembly")
    shown = {}
    for name in ("hanging_pendulum", "spring_chains"):
        try:
            mbs = assembly.assemble(load_scene(ROOT / "cases" / "linearised" / name / "scene.toml")).shop.mbs
        except EngineMissing as missing:
            pytest.skip(str(missing))
        M, K, *_ = mbs.ComputeLinearizedSystem(projectIntoConstraintNullspace=True)
        shown[name] = np.sort(np.linalg.eigvals(np.linalg.solve(M, K)).real)
    chains = linearize(load_scene(ROOT / "cases" / "linearised" / "spring_chains" / "scene.toml"))
    squares = np.sort(np.abs(chains.eigenvalues.imag))[::2] ** 2
    assert shown["spring_chains"] == pytest.approx(squares, rel=1e-6, abs=1e-6)
    assert shown["hanging_pendulum"] == pytest.approx([0.0, 0.0], abs=1e-6)
