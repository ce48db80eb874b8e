"""Random trees with random couplings, and closures beside them, against one dense system of equations.

By the recursion (with ruthless bodies: by its innovations) and by composite bodies.
"""

from __future__ import annotations

from dataclasses import dataclass

import msgspec
import numpy as np
import pytest

import flexmb
from flexmb.dense import DenseSystem
from flexmb.dense.closures import relation
from flexmb.scene import schema as s
from flexmb.scene.tree import coordinates
from tests.bounds import algebra
from tests.flexmb.closure import chains
from tests.flexmb.closure.coupled import coupled_tree
from tests.flexmb.closure.least import least_loads

CASES = [("rigid", ()), ("rigid", ("spherical",)), ("full", ("revolute",)), ("free-flying", ()), ("every level", ()),
         ("ruthless", ("weld",))]  # fmt: skip


@dataclass(frozen=True)
class Coupled:
    """Both routes at a state that fulfils all relations."""

    system: flexmb.System
    state: flexmb.State
    dense: chains.Constrained
    found: dict[str, flexmb.Evaluation]
    bound: float


@pytest.fixture(scope="module", params=CASES, ids=str)
def case(request) -> Coupled:
    recipe, closures = request.param
    scene = coupled_tree(recipe, closures)
    system = flexmb.compile(scene)
    tree = flexmb.System(msgspec.structs.replace(scene, closures=(), couplings=())).initial_state
    state = system.state(tree.q, chains.consistent_speeds(scene, tree.q, tree.u))
    dense = chains.constrained(scene, state.q, state.u)
    bound = algebra(system.nu + len(dense.J), len(scene.bodies) + len(scene.point_masses))
    found = {name: system.evaluate(0.0, state.q, state.u, name) for name in ("articulated", "composite")}
    return Coupled(system, state, dense, found, bound)


def test_accelerations_keep_all_relations(case):
    for found in case.found.values():
        rates = found.accelerations[case.dense.free]
        size = np.max(np.abs(case.dense.J)) * np.sum(np.abs(rates)) + np.max(np.abs(case.dense.gamma))
        assert np.max(np.abs(case.dense.J @ rates + case.dense.gamma)) <= case.bound * size


def test_what_is_left_of_the_trees_equations_are_loads_of_the_relations(case):
    J = case.dense.J
    for found in case.found.values():
        rates = found.accelerations[case.dense.free]
        missing = case.dense.M @ rates - case.dense.right
        left = missing - J.T @ np.linalg.lstsq(J.T, missing, rcond=1e-13)[0]
        size = np.max(np.abs(case.dense.M) @ np.abs(rates) + np.abs(case.dense.right))
        assert np.max(np.abs(left)) <= case.bound * size


def test_as_many_rows_are_independent(case):
    size = np.linalg.norm(case.dense.J, axis=1, keepdims=True)
    rank = np.linalg.matrix_rank(case.dense.J / np.where(size > 1e-12, size, 1.0), tol=1e-10)
    assert case.system.closures.independent == rank


def test_hinges_transmit_what_is_outboard_of_them(case):
    """Newton and Euler: a coupling acts inside its hinges, and adds nothing to what is outboard of any other."""
    scene = case.system.scene
    for algorithm, found in case.found.items():
        loads = least_loads(case.system, case.state, algorithm)
        expected = chains.on_hinges(scene, case.state.q, case.state.u, found.accelerations, loads)
        size = 10.0 * max(np.max(np.abs(load)) for load in (*loads.values(), *expected.values()))
        for name, load in expected.items():
            assert np.max(np.abs(loads[name] - load)) <= case.bound * size


def test_motors_couplings_and_drives_make_up_what_a_hinge_transmits_along_its_axis(case):
    """M udot + bias along a coupled coordinate = springs and motors + factor f + the drive where it is prescribed."""
    scene, dense = case.system.scene, DenseSystem(case.system.scene)
    if scene.closures:
        pytest.skip("closures load these coordinates too")
    q, u = case.state.q, case.state.u
    angular = {hinge.name: coordinates(hinge)[0][1].ANGULAR for hinge in scene.hinges if coordinates(hinge)}
    for algorithm, found in case.found.items():
        tau = dense.mass_matrix(q) @ found.accelerations + dense.bias(q, u) - dense.applied(q, u)
        closing = least_loads(case.system, case.state, algorithm)
        frames = case.system.referred_loads(case.state, closing, axes="outboard")
        for x in dense.tree.scalars:
            if x.owner not in angular or len(coordinates(_hinge(scene, x.owner))) != 1:
                continue
            supplied, size = 0.0, abs(tau[x.u])
            for coupling in scene.couplings:
                factor = relation(dense, coupling)[1][x.u]
                load = frames[coupling.name][:3] if angular[coupling.hinge] else frames[coupling.name][3:]
                supplied += factor * float(load @ np.array(_hinge(scene, coupling.hinge).axis))
                size += abs(factor) * float(np.linalg.norm(load))
            if x.prescribed is not None:
                supplied += found.drives[x.owner][0]
            assert abs(tau[x.u] - supplied) <= 10.0 * case.bound * max(size, np.max(np.abs(tau)))


def _hinge(scene: s.Scene, name: str) -> s.Hinge:
    return next(hinge for hinge in scene.hinges if hinge.name == name)


def test_couplings_have_no_power(case):
    """The work rate equals the rate of the energy: by a difference along the motion."""
    system, scene = case.system, case.system.scene
    if scene.closures or any(body.level == "ruthless" for body in scene.bodies if hasattr(body, "level")):
        pytest.skip("energies of ruthless bodies and positions off a loop are approximate")
    run = flexmb.simulate(system, 0.05, state=case.state, samples=6, rtol=1e-11, atol=1e-12)
    size = max(abs(value) for values in run.energy.values() for value in values)
    assert np.max(np.abs(run.energy_drift)) <= 1e-8 * size
