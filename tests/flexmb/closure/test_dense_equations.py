"""Random trees with random closures and couplings: accelerations and loads against one dense system of equations.

By unit loads through the recursion (with ruthless bodies: by its innovations), and by composite bodies.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

import flexmb
from flexmb.dense import DenseSystem
from flexmb.dense.closures import relation
from flexmb.scene.tree import coordinates
from tests import trees
from tests.bounds import algebra
from tests.flexmb.closure import chains
from tests.flexmb.closure.coupled import coupled_tree
from tests.flexmb.closure.least import least_loads

RECIPES = {
    "rigid": replace(trees.RIGID, prescribed=False), "full": replace(trees.FULL, prescribed=False),
    "linear": replace(trees.LINEAR, prescribed=False, deformation=0.01), "free-flying": trees.FREE_FLYING,
    "ruthless": replace(trees.RUTHLESS, prescribed=False), "every level": replace(trees.EVERY_LEVEL, deformation=0.01),
    "stiffened": replace(trees.STIFFENED, prescribed=False), "exact": replace(trees.EXACT, prescribed=False),
    "armatures": replace(trees.ARMED, prescribed=False, deformation=0.01),
}  # fmt: skip
PAIRS = [("weld", "spherical"), ("revolute", "universal"), ("prismatic", "planar"), ("cylindrical", "revolute")]
CLOSED = {f"{recipe} with {a} and {b}": (recipe, seed) for recipe in RECIPES for seed, (a, b) in enumerate(PAIRS)}
COUPLED = {
    "coupled rigid": (), "coupled rigid with spherical": ("spherical",), "coupled full with revolute": ("revolute",),
    "coupled free-flying": (), "coupled every level": (), "coupled ruthless with weld": ("weld",),
}  # fmt: skip
# By default every recipe has one of the pairs, and every pair two recipes or three.
BY_DEFAULT = {(recipe, i % 4) for i, recipe in enumerate(RECIPES)}
PARAMETERS = [
    name if case in BY_DEFAULT else pytest.param(name, marks=pytest.mark.slow) for name, case in CLOSED.items()
] + list(COUPLED)


@dataclass(frozen=True)
class Chain:
    """A closed chain at a state that fulfils all its relations, densely and by both algorithms."""

    system: flexmb.System
    state: flexmb.State
    dense: chains.Constrained
    evaluations: dict[flexmb.Algorithm, flexmb.Evaluation]
    bound: float


@cache
def solved(name: str) -> Chain:
    if name in CLOSED:
        recipe, seed = CLOSED[name]
        tree = trees.random_scene(seed, RECIPES[recipe])
        scene = chains.with_closures(tree, np.random.default_rng(seed), list(PAIRS[seed]))
    else:
        scene = coupled_tree(name.removeprefix("coupled ").partition(" with ")[0], COUPLED[name])
    system, given = flexmb.compile(scene), flexmb.System(scene).initial_state
    state = system.state(given.q, chains.consistent_speeds(scene, given.q, given.u))
    dense = chains.constrained(scene, state.q, state.u)
    bound = algebra(system.nu + len(dense.J), len(scene.bodies) + len(scene.point_masses))
    algorithms: tuple[flexmb.Algorithm, ...] = ("articulated", "composite")
    evaluations = {algorithm: system.evaluate(0.0, state.q, state.u, algorithm) for algorithm in algorithms}
    return Chain(system, state, dense, evaluations, bound)


@pytest.fixture(params=PARAMETERS)
def chain(request) -> Chain:
    return solved(request.param)


def test_the_scene_is_closed(chain):
    size = np.max(np.abs(chain.dense.J)) * np.sum(np.abs(chain.state.u))
    assert np.max(np.abs(chain.dense.value)) <= chain.bound
    assert np.max(np.abs(chain.dense.rate)) <= chain.bound * size


def test_accelerations_keep_all_relations(chain):
    J, gamma = chain.dense.J, chain.dense.gamma
    for evaluation in chain.evaluations.values():
        rates = evaluation.accelerations[chain.dense.free]
        size = np.max(np.abs(J)) * np.sum(np.abs(rates)) + np.max(np.abs(gamma))
        assert np.max(np.abs(J @ rates + gamma)) <= chain.bound * size


def test_what_is_left_of_the_trees_equations_are_loads_of_the_relations(chain):
    """M udot - right lies in the range of J': backward error."""
    J = chain.dense.J
    for evaluation in chain.evaluations.values():
        rates = evaluation.accelerations[chain.dense.free]
        missing = chain.dense.M @ rates - chain.dense.right
        left = missing - J.T @ np.linalg.lstsq(J.T, missing, rcond=1e-13)[0]
        size = np.max(np.abs(chain.dense.M) @ np.abs(rates) + np.abs(chain.dense.right))
        assert np.max(np.abs(left)) <= chain.bound * size


def test_as_many_rows_are_independent(chain):
    size = np.linalg.norm(chain.dense.J, axis=1, keepdims=True)
    rank = np.linalg.matrix_rank(chain.dense.J / np.where(size > 1e-12, size, 1.0), tol=1e-10)
    assert chain.system.closures.independent == rank


def test_loads_of_closures_and_hinges_balance(chain):
    """Newton and Euler for everything outboard of each hinge, with the loads that the closures report.

    A coupling acts inside its hinges, and adds nothing to what is outboard of any other.
    """
    state, scene = chain.state, chain.system.scene
    for algorithm, evaluation in chain.evaluations.items():
        loads = least_loads(chain.system, state, algorithm)
        for name, load in evaluation.loads.items():
            assert np.all(np.isnan(load) | (load == loads[name]))
        expected = chains.on_hinges(scene, state.q, state.u, evaluation.accelerations, loads)
        size = 10.0 * max(np.max(np.abs(load)) for load in (*loads.values(), *expected.values()))
        for name, load in expected.items():
            assert np.max(np.abs(loads[name] - load)) <= chain.bound * size


def test_both_routes_find_the_same_drive_loads(chain):
    size = 10.0 * max(np.max(np.abs(load)) for load in least_loads(chain.system, chain.state).values())
    for name, drive in chain.evaluations["articulated"].drives.items():
        other, known = chain.evaluations["composite"].drives[name], ~np.isnan(drive)
        assert np.array_equal(known, ~np.isnan(other))
        assert np.max(np.abs(other - drive)[known], initial=0.0) <= chain.bound * size


# Closures load the coupled coordinates too.
@pytest.mark.parametrize("name", [name for name, closures in COUPLED.items() if not closures])
def test_motors_couplings_and_drives_make_up_what_a_hinge_transmits_along_its_axis(name: str) -> None:
    """M udot + bias along a coupled coordinate = springs and motors + factor f + the drive where it is prescribed."""
    chain = solved(name)
    scene, dense = chain.system.scene, DenseSystem(chain.system.scene)
    q, u = chain.state.q, chain.state.u
    single = {hinge.name: hinge for hinge in scene.hinges if len(coordinates(hinge)) == 1}
    for algorithm, evaluation in chain.evaluations.items():
        tau = dense.mass_matrix(q) @ evaluation.accelerations + dense.bias(q, u) - dense.applied(q, u)
        closing = least_loads(chain.system, chain.state, algorithm)
        loads = chain.system.referred_loads(chain.state, closing, axes="outboard")
        for x in dense.tree.scalars:
            if x.owner not in single:
                continue
            supplied, size = 0.0, abs(tau[x.u])
            for coupling in scene.couplings:
                factor, led = relation(dense, coupling)[1][x.u], single[coupling.hinge]
                angular = coordinates(led)[0][1].ANGULAR
                load = loads[coupling.name][:3] if angular else loads[coupling.name][3:]
                supplied += factor * float(load @ np.array(led.axis))
                size += abs(factor) * float(np.linalg.norm(load))
            if x.prescribed is not None:
                supplied += evaluation.drives[x.owner][0]
            assert abs(tau[x.u] - supplied) <= 10.0 * chain.bound * max(size, np.max(np.abs(tau)))


# Without closures: positions off a loop are approximate.
@pytest.mark.parametrize("name", ["coupled rigid", "coupled free-flying"])
def test_couplings_have_no_power(name: str) -> None:
    """The work rate equals the rate of the energy: by a difference along the motion."""
    chain = solved(name)
    run = flexmb.simulate(chain.system, 0.05, state=chain.state, samples=6, rtol=1e-11, atol=1e-12)
    size = max(abs(value) for values in run.energy.values() for value in values)
    assert np.max(np.abs(run.energy_drift)) <= 1e-8 * size
