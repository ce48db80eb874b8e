"""Random trees with random closures: accelerations and closure loads against one dense system of equations.

By unit loads through the recursion (with ruthless bodies: by its innovations), and by composite bodies.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

import flexmb
from tests import trees
from tests.bounds import algebra
from tests.flexmb.closure import chains
from tests.flexmb.closure.least import least_loads

RECIPES = {
    "rigid": replace(trees.RIGID, prescribed=False), "full": replace(trees.FULL, prescribed=False),
    "linear": replace(trees.LINEAR, prescribed=False, deformation=0.01), "free-flying": trees.FREE_FLYING,
    "ruthless": replace(trees.RUTHLESS, prescribed=False), "every level": replace(trees.EVERY_LEVEL, deformation=0.01),
    "stiffened": replace(trees.STIFFENED, prescribed=False), "exact": replace(trees.EXACT, prescribed=False),
    "armatures": replace(trees.ARMED, prescribed=False, deformation=0.01),
}  # fmt: skip
PAIRS = [("weld", "spherical"), ("revolute", "universal"), ("prismatic", "planar"), ("cylindrical", "revolute")]
CASES = [(recipe, types, seed) for recipe in RECIPES for seed, types in enumerate(PAIRS)]
# By default every recipe has one of the pairs, and every pair two recipes or three.
BY_DEFAULT = {(recipe, PAIRS[i % 4], i % 4) for i, recipe in enumerate(RECIPES)}
PARAMETERS = [case if case in BY_DEFAULT else pytest.param(case, marks=pytest.mark.slow) for case in CASES]


@dataclass(frozen=True)
class Pair:
    """Both routes at a state with closed closures and consistent speeds."""

    system: flexmb.System
    state: flexmb.State
    dense: chains.Constrained
    found: flexmb.Evaluation
    by_composite_bodies: flexmb.Evaluation
    bound: float

    @property
    def both(self) -> tuple[flexmb.Evaluation, flexmb.Evaluation]:
        return self.found, self.by_composite_bodies


@pytest.fixture(scope="module", params=PARAMETERS, ids=str)
def pair(request) -> Pair:
    recipe, types, seed = request.param
    scene = trees.random_scene(seed, RECIPES[recipe])
    scene = chains.with_closures(scene, np.random.default_rng(seed), list(types))
    system = flexmb.compile(scene)
    state = flexmb.System(scene).initial_state
    state = system.state(state.q, chains.consistent_speeds(scene, state.q, state.u))
    dense = chains.constrained(scene, state.q, state.u)
    depth = len(scene.bodies) + len(scene.point_masses)
    bound = algebra(system.nu + len(dense.J), depth)
    found = [system.evaluate(0.0, state.q, state.u, algorithm) for algorithm in ("articulated", "composite")]
    return Pair(system, state, dense, *found, bound)


def test_the_scene_is_closed(pair):
    assert np.max(np.abs(pair.dense.value)) <= pair.bound
    assert np.max(np.abs(pair.dense.rate)) <= pair.bound * np.max(np.abs(pair.dense.J)) * np.sum(np.abs(pair.state.u))


def test_accelerations_keep_the_closures_closed(pair):
    J = pair.dense.J
    for found in pair.both:
        rates = found.accelerations[pair.dense.free]
        size = np.max(np.abs(J)) * np.sum(np.abs(rates)) + np.max(np.abs(pair.dense.gamma))
        assert np.max(np.abs(J @ rates + pair.dense.gamma)) <= pair.bound * size


def test_what_is_left_of_the_trees_equations_is_a_load_of_closures(pair):
    """M udot - right lies in the range of J': backward error."""
    J = pair.dense.J
    for found in pair.both:
        rates = found.accelerations[pair.dense.free]
        missing = pair.dense.M @ rates - pair.dense.right
        left = missing - J.T @ np.linalg.lstsq(J.T, missing, rcond=1e-13)[0]
        size = np.max(np.abs(pair.dense.M) @ np.abs(rates) + np.abs(pair.dense.right))
        assert np.max(np.abs(left)) <= pair.bound * size


def test_as_many_rows_are_independent(pair):
    size = np.linalg.norm(pair.dense.J, axis=1, keepdims=True)
    rank = np.linalg.matrix_rank(pair.dense.J / np.where(size > 1e-12, size, 1.0), tol=1e-10)
    assert pair.system.closures.independent == rank


def test_loads_of_closures_and_hinges_balance(pair):
    """Newton and Euler for everything outboard of each hinge, with the loads that the closures report."""
    state, scene = pair.state, pair.system.scene
    for algorithm, found in zip(("articulated", "composite"), pair.both, strict=True):
        loads = least_loads(pair.system, state, algorithm)
        for name, load in found.loads.items():
            assert np.all(np.isnan(load) | (load == loads[name]))
        expected = chains.on_hinges(scene, state.q, state.u, found.accelerations, loads)
        size = 10.0 * max(np.max(np.abs(load)) for load in (*loads.values(), *expected.values()))
        for name, load in expected.items():
            assert np.max(np.abs(loads[name] - load)) <= pair.bound * size


def test_both_routes_find_the_same_drive_loads(pair):
    size = 10.0 * max(np.max(np.abs(load)) for load in least_loads(pair.system, pair.state).values())
    for name, drive in pair.found.drives.items():
        other, known = pair.by_composite_bodies.drives[name], ~np.isnan(drive)
        assert np.array_equal(known, ~np.isnan(other))
        assert np.max(np.abs(other - drive)[known], initial=0.0) <= pair.bound * size
