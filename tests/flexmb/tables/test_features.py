"""What a scene contains, by name; and kernels of just that compute what general ones compute."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import flexmb as fm
from flexmb.connectors.catalogue import FRAME_LAWS, LAWS
from flexmb.hinges.catalogue import KINDS
from flexmb.integrate.catalogue import INTEGRATORS
from flexmb.jit.features import GENERAL
from flexmb.levels.body import LEVELS
from flexmb.levels.body import RIGID as RIGID_LEVEL
from flexmb.run import situation
from flexmb.run.propagate import integration
from flexmb.scene.build import SceneBuilder
from flexmb.system.compile import assembled
from flexmb.tables import features
from flexmb.tables.arrays import Constants
from flexmb.tables.status import OK
from flexmb.typing import Real
from tests.benchmarks.rivals import turns
from tests.bounds import gamma
from tests.flexmb.connectors.connected_scenes import everything as connected
from tests.flexmb.connectors.connected_scenes import free_flying
from tests.trees import EXACT, RIGID, SINGLE, Recipe, random_scene

WORTH = 1.05  # times as fast as general kernels
FEW = {"conservative": True, "wheels": 0, "point_masses": 0}
AXES = Recipe(bodies=4, carriers=("rigid",), hinges=("revolute", "prismatic"), **FEW)
RUTHLESS_CHAIN = Recipe(bodies=3, carriers=("beam",), levels=("ruthless",), hinges=("revolute",), **FEW)
STRAINS_IN_A_PLANE = Recipe(bodies=1, carriers=("beam",), levels=("exact",), hinges=("revolute",), **FEW)
STRAINS = Recipe(bodies=4, carriers=("beam",), levels=("exact",), hinges=("revolute",), **FEW)
EVERYTHING = Recipe(bodies=8, levels=("full", "ruthless", "linear", "stiffened"))


def evaluations(system: fm.System) -> Callable[[], object]:
    return partial(system.evaluator(), 0.0, system.initial_state.q, system.initial_state.u)


def derivatives(system: fm.System) -> Callable[[], object]:
    return partial(system.derivative_evaluator(), 0.0, system.initial_state.q, system.initial_state.u)


def copies(system: fm.System) -> Callable[[], object]:
    q, u = (np.tile(each, (64, 1)) for each in (system.initial_state.q, system.initial_state.u))
    return partial(system.accelerations_batch, q, u, threads=1)


CALLS = {"accelerations": evaluations, "derivatives": derivatives, "copies": copies}


def chain(bodies: int = 2, **hinge: float) -> fm.SceneBuilder:
    builder = SceneBuilder("chain", gravity=(0, 0, -9.81))
    for k in range(bodies):
        builder.rigid_body(f"b{k}", mass=1.0, inertia=(0.1, 0.2, 0.3), com=(0.2, 0.1, 0), nodes={"tip": (1.0, 0, 0)})
        inboard, at = ("ground", {}) if k == 0 else (f"b{k - 1}", {"parent_node": "tip"})
        builder.revolute(f"h{k}", inboard, f"b{k}", axis=(0, 1, 0), **at, **hinge)
    return builder


@pytest.fixture
def exact(monkeypatch):
    monkeypatch.setenv("FLEXMB_KERNELS", "exact")


def test_a_chain_has_hardly_anything(exact):
    found = fm.compile(chain().scene()).constants.features()
    assert found == {"axis 2", "hinge 1", "level 0"}


@pytest.mark.filterwarnings("ignore:.*is doubtful")
def test_each_thing_has_its_name(exact):
    assert features.SPRINGS in fm.compile(chain(stiffness=2.0).scene()).constants.features()
    assert features.DAMPERS in fm.compile(chain(damping=2.0).scene()).constants.features()
    armed = chain(armature=2.0).scene()
    assert features.ARMATURES in fm.compile(armed).constants.features()
    drawn = (random_scene(0, recipe) for recipe in (EVERYTHING, Recipe(levels=("stiffened",)), EXACT))
    scenes = *drawn, connected(), armed
    found = frozenset.union(*(fm.compile(scene).constants.features() for scene in scenes))
    named = {name: value for name, value in vars(features).items() if not name.startswith("_") and name.isupper()}
    names = {value for value in named.values() if isinstance(value, str)}
    uses = {features.RECURSION, features.BATCHES, features.DERIVATIVES}
    missing = names - {GENERAL} - uses - {name.rstrip("0123456789- ") for name in found}
    assert missing <= {features.BALL_SPRINGS}, missing  # drawn at random: another seed may have others


def test_the_environment_asks_for_everything(monkeypatch):
    monkeypatch.setenv("FLEXMB_KERNELS", "general")
    assert fm.compile(chain().scene()).constants.features() == {GENERAL}
    monkeypatch.setenv("FLEXMB_KERNELS", "all")
    with pytest.raises(ValueError, match=r"'all'.*special"):
        fm.compile(chain().scene())


def test_a_call_asks_whatever_the_environment_says(monkeypatch):
    monkeypatch.setenv("FLEXMB_KERNELS", "general")
    assert fm.compile(chain().scene(), kernels="special").kernels == "special"
    monkeypatch.setenv("FLEXMB_KERNELS", "special")
    assert fm.compile(chain().scene(), kernels="general").kernels == "general"
    with pytest.raises(ValueError, match="kernels"):
        fm.compile(chain().scene(), kernels="exact")


@pytest.mark.parametrize(
    ("came", "warm", "kernels"),
    [("", False, "general"), ("", True, "special"), ("for another numba", False, "special")],
    ids=["at hand", "compiled ahead", "not at hand"],
)
def test_what_is_at_hand_decides_where_nobody_does(came, warm, kernels, monkeypatch):
    monkeypatch.setenv("FLEXMB_KERNELS", "auto")
    monkeypatch.setattr(features, "unfit", lambda: came)
    monkeypatch.setattr(features, "is_warm", lambda found: warm)
    assert fm.compile(chain().scene()).kernels == kernels


def loop() -> fm.Scene:
    return chain().closure("end", "spherical", "ground", "b1", position_a=(2.0, 0, 0), node_b="tip").scene()


@pytest.mark.parametrize("scene", [chain().scene(), loop()], ids=["tree", "loop"])
@pytest.mark.parametrize("kernels", ["general", "special"])
def test_copies_are_run_by_the_same_kernels(scene, kernels, monkeypatch):
    """Whatever is asked for by then."""
    system = fm.compile(scene, kernels=kernels)
    monkeypatch.setenv("FLEXMB_KERNELS", "special" if kernels == "general" else "general")
    for other in (copy.copy(system), copy.deepcopy(system), pickle.loads(pickle.dumps(system))):
        assert other.kernels == kernels


def test_what_came_up_in_a_run_is_run_by_the_same_kernels(monkeypatch):
    """A latch makes another scene of it."""
    monkeypatch.setenv("FLEXMB_KERNELS", "special")
    latched = chain(1).event("held", "time", 0.1, fm.Latch(coordinate="h0.rotation"))
    system = fm.compile(latched.scene(), kernels="general")
    made = []
    monkeypatch.setattr(situation, "assembled", lambda scene: made.append(assembled(scene)) or made[-1])
    assert fm.simulate(system, 0.2, samples=3).finished
    assert [each.kernels for each in made] == ["general"]


def test_constants_are_read_only(exact):
    with pytest.raises(ValueError, match="read-only"):
        fm.compile(chain().scene()).constants.speed["damping"] = 3.0


def slope(scene: fm.System, scale: float, constants: Constants | None = None) -> Real:
    state, w = scene.initial_state, scene.recursion_workspace()
    y = np.concatenate([state.q * scale, state.u, [0.0]])
    dy = np.empty_like(y)
    assert scene.rhs(0.1, y, dy, constants or scene.recursion_constants, w) == OK
    return dy


@pytest.mark.parametrize(
    "recipe",
    [
        AXES,
        RUTHLESS_CHAIN,
        pytest.param(RIGID, marks=pytest.mark.slow),
        pytest.param(EVERYTHING, marks=pytest.mark.slow),
        pytest.param(STRAINS_IN_A_PLANE, marks=pytest.mark.slow),
        pytest.param(STRAINS, marks=pytest.mark.slow),
    ],
    ids=["axes", "ruthless", "rigid", "everything", "strains in a plane", "strains"],
)
def test_exact_kernels_compute_what_general_ones_do(recipe, monkeypatch):
    compare_kernels(random_scene(5, recipe), monkeypatch)


@pytest.mark.slow
def test_exact_kernels_of_connectors_do_too(monkeypatch):
    compare_kernels(connected(), monkeypatch)


def test_rigid_trees_may_have_every_hinge_and_law_but_no_level_of_flexible_bodies():
    counts = {features.HINGE: KINDS, features.FRAME_LAW: FRAME_LAWS, features.LAW: LAWS, features.AXIS: range(3)}
    every = {f"{name} {n}" for name, kinds in counts.items() for n in range(len(kinds))} | {f"{features.AXIS} -1"}
    assert every <= features.OF_RIGID_TREES
    levels = {f"{features.LEVEL} {n}" for n in range(len(LEVELS))}
    assert levels & features.OF_RIGID_TREES == {RIGID_LEVEL}


def test_single_axes_are_the_smaller_set():
    """So that what they have not is a matter of a tree of rigid bodies, and a scene takes the smallest that serves."""
    assert features.OF_SINGLE_AXES < features.OF_RIGID_TREES
    assert [ready.features for ready in features.READY.values()] == [features.OF_SINGLE_AXES, features.OF_RIGID_TREES]


@pytest.mark.parametrize(
    ("scene", "found", "derivatives"),
    [
        (random_scene(5, RIGID), features.OF_RIGID_TREES, {GENERAL}),
        (chain(stiffness=2.0).scene(), features.OF_SINGLE_AXES, features.OF_SINGLE_AXES),
        (random_scene(0, SINGLE), features.OF_SINGLE_AXES, features.OF_SINGLE_AXES),
    ],
    ids=["drawn", "sprung", "single axes"],
)
def test_a_rigid_tree_has_kernels_without_modes(scene, found, derivatives, monkeypatch):
    """Ready ones, which compute what general ones do."""
    monkeypatch.setenv("FLEXMB_KERNELS", "general")
    system = fm.compile(scene)
    assert system.kernels == "general" and system.constants.features() == {GENERAL}
    assert system.explicit_constants.features() == found
    assert system.derivative_constants.features() == derivatives
    close(system, slope(system, 1.0), slope(system, 1.0, system.explicit_constants))
    special = fm.compile(scene, kernels="special")
    assert special.explicit_constants.features() == features.contained(system.constants)
    assert special.derivative_constants.features() == features.contained(system.constants)


def test_kernels_compiled_beside_are_not_those_of_derivatives(monkeypatch):
    """Nobody waits for the compiler: derivatives keep what is ready."""
    monkeypatch.setattr(features, "is_warm", lambda found: True)
    monkeypatch.setattr(features, "unfit", lambda: "")
    with features.asking("beside"):
        system = fm.compile(chain().scene())
    assert system.explicit_constants.features() == features.contained(system.constants)
    assert system.derivative_constants.features() == features.OF_SINGLE_AXES


@pytest.mark.parametrize("call", CALLS)
def test_ready_kernels_of_single_axes_gain(call, monkeypatch):
    """At least 5 %, or they are not worth their compilation; general ones against themselves do not gain so much."""
    monkeypatch.setenv("FLEXMB_KERNELS", "general")
    scene = chain(20).scene()
    fast = CALLS[call](fm.compile(scene))
    fast()
    monkeypatch.setattr(features, "READY", {})
    general = CALLS[call](fm.compile(scene))
    gained = gain(general, fast)
    assert gained >= WORTH
    assert gain(general, CALLS[call](fm.compile(scene))) < (1.0 + gained) / 2.0


def test_ready_kernels_of_rigid_trees_gain(monkeypatch):
    monkeypatch.setenv("FLEXMB_KERNELS", "general")
    scene = random_scene(5, replace(RIGID, bodies=30))
    fast = CALLS["accelerations"](fm.compile(scene))
    fast()
    monkeypatch.setattr(features, "READY", {})
    assert gain(CALLS["accelerations"](fm.compile(scene)), fast) >= WORTH


def gain(general: Callable[[], object], fast: Callable[[], object]) -> float:
    """How many times as fast, by the median over rounds in which both take turns."""
    seconds = turns(general, fast)
    return float(np.median(seconds[:, 0] / seconds[:, 1]))


def test_trees_with_modes_and_linearised_runs_have_general_ones(monkeypatch):
    monkeypatch.setenv("FLEXMB_KERNELS", "general")
    assert fm.compile(random_scene(5, EVERYTHING)).explicit_constants.features() == {GENERAL}
    for method, found in (("dop853", features.OF_SINGLE_AXES), ("rk4", features.OF_SINGLE_AXES), ("radau5", {GENERAL})):
        with integration(fm.compile(chain().scene()), "articulated", 0.0, INTEGRATORS[method]) as solve:
            assert solve._constants.features() == found


def test_connectors_are_compiled_kind_by_kind(exact):
    found = fm.compile(free_flying()).constants.features()
    assert {features.CONNECTORS, features.ONE_SIDED, features.FRAME_LAWS} <= found
    assert not {features.ACTUATORS, features.HINGE_SPRINGS, features.COORDINATE_LAWS} & found


def compare_kernels(scene, monkeypatch) -> None:
    found = []
    for kernels in ("general", "exact"):
        monkeypatch.setenv("FLEXMB_KERNELS", kernels)
        found.append((fm.compile(scene), slope(fm.compile(scene), 1.0)))
    (system, general), (_, of_its_own) = found
    close(system, general, of_its_own)


def close(system: fm.System, general: Real, of_its_own: Real) -> None:
    """Slopes that differ by rounding."""
    M = system.mass_matrix(system.initial_state)
    nq = system.nq
    residual = M @ (general - of_its_own)[nq:-1]
    size = np.max(np.abs(M) @ np.abs(general[nq:-1]))
    assert np.max(np.abs(residual)) <= gamma(100 * len(M)) * size
    assert np.max(np.abs((general - of_its_own)[:nq]), initial=0.0) <= gamma(100) * np.max(np.abs(general[:nq]))
