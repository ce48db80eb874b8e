"""Two native routes to the same motion: the nested-body equations, corrected, and the articulated-body recursion.

They share scenes, hinges and node kinematics; the inertia of bodies, all sums over bodies, the elimination of loads and
the solution are different algorithms (an import contract keeps them apart). The agreement is that of rounding.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

import flexmb
from flexmb.entry import observation
from flexmb.frisch.nested_system import NestedMotion, NestedSystem, Partitions
from tests import trees
from tests.bounds import algebra, backward_error
from tests.flexmb.frisch.scenes import SMALL, packed, random_scene
from tests.trees import deformed
from tests.unlocked import unlocked

RECIPES = {
    "rigid": trees.RIGID,
    "ruthless": trees.RUTHLESS,
    "linear": SMALL,
    "levels mixed": replace(SMALL, levels=("linear", "ruthless", "rigid")),
    "free-flying": replace(SMALL, grounded=False, prescribed=False, conservative=True),
    "chain": replace(SMALL, branching=False, bodies=12),
    "armatures": replace(SMALL, armatures=True),
}


@dataclass(frozen=True)
class Pair:
    """Both routes at the scene's own random state, and the bound of their difference."""

    system: flexmb.System
    nested: NestedSystem
    state: flexmb.State
    motion: NestedMotion
    M: np.ndarray
    right: np.ndarray  # applied less bias, by the recursion
    size: float  # of the generalised forces before they cancel
    bound: float


@pytest.fixture(scope="module", params=[(name, seed) for name in RECIPES for seed in (0, 1)], ids=str)
def pair(request) -> Pair:
    name, seed = request.param
    system = flexmb.compile(random_scene(seed, RECIPES[name]))
    nested, state = system.nested(), system.initial_state
    status, motion = nested.motion(0.0, packed(state))
    assert status == 0
    M, bias = system.mass_matrix(state), system.bias(state)
    loads = max(np.max(np.abs(load)) for load in system.hinge_loads(state).values())
    size = float(np.max(np.abs(M) @ np.abs(motion.accelerations)) + np.max(np.abs(bias)) + loads)
    points = max(len(link.model.mass) for link in system.links)
    bound = algebra(system.nu, len(system.body_names), points)
    return Pair(system, nested, state, motion, M, system.applied(state) - bias, size, bound)


def test_mass_matrix_and_right_side(pair):
    """(136), corrected: the congruence is the mass matrix of the recursion, and symmetric to the last bit."""
    M, right = pair.nested.reduced(0.0, packed(pair.state))
    assert np.max(np.abs(M - pair.M)) <= pair.bound * np.max(np.abs(pair.M))
    assert np.array_equal(M, M.T)
    assert np.max(np.abs(right - pair.right)) <= pair.bound * pair.size


def test_accelerations(pair):
    """(136), (144): backward error within n u of the recursion's equations."""
    free = pair.system.constants.speed["prescribed"] < 0
    error = backward_error(pair.M[free], pair.motion.accelerations, pair.right[free], np.array([pair.size]))
    assert error <= pair.bound


def test_hinge_loads(pair):
    """(107), (108), (115): the suppressed rows and the last partition give the recursion's six load components."""
    expected = pair.system.hinge_loads(pair.state, pair.motion.accelerations)
    for found, load in zip(pair.motion.loads, expected.values(), strict=True):
        assert np.max(np.abs(found - load)) <= pair.bound * pair.size


def test_wheel_torques(pair):
    """(82), (94), (102), (113): the whole torque on a wheel, bearing and motor, from the wheel's own momentum."""
    system, none = pair.system, np.zeros(0, np.int64)
    c = system.constants
    out = observation.outputs(observation.shapes(system.nu, 0, len(c.body), len(c.wheel)), none, none)
    out.rates[:] = pair.motion.accelerations
    observation.observe_motion(0.0, packed(pair.state), c, system.workspace(), out)
    assert np.max(np.abs(pair.motion.wheel_torques - out.wheel_loads[:, :3]), initial=0.0) <= pair.bound * pair.size


def test_drives(pair):
    """(145): what prescribed motion takes, beyond springs and motors."""
    moved = pair.motion.accelerations
    tau = pair.system.inverse_dynamics(pair.state, moved) - pair.system.applied(pair.state)
    fixed = pair.system.constants.speed["prescribed"] >= 0
    assert np.max(np.abs(pair.motion.drives - tau)[fixed], initial=0.0) <= pair.bound * pair.size
    assert not np.any(pair.motion.drives[~fixed])


PARTS = ("X", "I_c", "F", "Gamma", "I_s", "M1", "A", "M2")


def test_partitions_and_relative_motion_are_those_of_the_same_equations(pair):
    """(111), (128), (136): S' Z S and S' (eta - Z bias) of all partitions, and the forces that they leave over (135).

    Rotation and translation of nests (26), (98), (107), (108), (112), wheels (109), (113), modes (53), (106), (110),
    (114), suppressed translation (99), (103), (115), and their right sides (80), (81), (87), (89), (100)-(102), (105),
    (171), (172), (186), about hinge points and mass centres (2), (43), (78), (79). Rates of bodies, wheels and hinge
    points relative to what carries them (116)-(118), (120), (121), (123), (124), (126), (129), (131), (133), and their
    accelerations (90), (119), (122), (125), (127), (130), (132), (134). Any of them with another sign is another
    matrix, another right side, or another force.
    """
    system, found = pair.system, pair.system.partitions(pair.state)
    rates, applied = pair.motion.accelerations, system.applied(pair.state)
    names, last, first, wheels = system.body_names, len(found.M2), len(found.X), len(found.I_s)
    still = np.flatnonzero(~np.any(pair.nested.own_workspace.nest["hinge_map"][:, 3:, :], axis=(1, 2)))
    loads = system.hinge_loads(pair.state, rates)
    forces = np.concatenate([np.zeros(0), *(list(loads.values())[k][3:] for k in still)])
    parents = {link.name: link.parent for link in system.links}
    mass = {link.name: link.model.mass.sum() for link in system.links}
    common = [[sum(mass[x] for x in mass if {names[k], names[i]} <= _path(x, parents)) for i in still] for k in still]
    armature = system.constants.speed["armature"]  # beside the inertia of the bodies
    held, blocks = armature * rates, np.kron(common, np.eye(3)) if len(still) else 0.0

    def misses(parts: Partitions) -> float:
        Z, S, eta = parts.matrix, parts.S, np.concatenate(parts.eta)
        x = S @ rates + parts.bias
        left = Z @ x - eta
        size = np.max(np.abs(S.T) @ (np.abs(eta) + np.abs(Z) @ np.abs(x)) + np.abs(applied))
        return max(
            np.max(np.abs(S.T @ Z @ S + np.diag(armature) - pair.M)) / np.max(np.abs(pair.M)),
            np.max(np.abs(S.T @ left + held - applied - pair.motion.drives)) / size,
            np.max(np.abs(left[len(left) - last :] - forces), initial=0.0) / pair.size,
            np.max(np.abs(left[first : first + wheels] - pair.motion.wheel_torques.ravel()), initial=0.0) / pair.size,
            np.max(np.abs(parts.M2 - blocks), initial=0.0) / sum(mass.values()),
        )

    assert np.array_equal(found.matrix, found.matrix.T) and misses(found) <= pair.bound
    wrong = {name: {name: -getattr(found, name)} for name in PARTS if np.any(getattr(found, name))}
    bounds = np.cumsum([0, *map(len, found.eta)])
    for i, rows in enumerate(map(slice, bounds[:-1], bounds[1:])):
        for name in ("S", "bias"):
            other = getattr(found, name).copy()
            other[rows] *= -1.0
            if np.any(other[rows]):
                wrong[f"{name} {i + 1}"] = {name: other}
        if np.any(found.eta[i]):
            wrong[f"eta {i + 1}"] = {"eta": tuple(-e if j == i else e for j, e in enumerate(found.eta))}
    for name, change in wrong.items():
        assert misses(replace(found, **change)) > 1e4 * pair.bound, name


def _path(name: str, parents: dict[str, str]) -> set[str]:
    """A body and all that carry it."""
    return {name} | (_path(parents[name], parents) if name in parents else set())


def test_ring_of_a_gimbal_without_mass():
    """(8): a body without mass has no mass centre, and needs none."""
    scene = flexmb.SceneBuilder("ring", gravity=(0.0, 0.0, -9.8)).rigid_body("ring", mass=0.0, inertia=(0.0, 0.0, 0.0))
    scene.rigid_body("rotor", mass=1.0, com=(0.1, 0.2, 0.3), inertia=(1.0, 1.2, 1.4))
    scene.revolute("outer", "ground", "ring", axis=(1.0, 0.0, 0.0), rate=0.3)
    scene.revolute("inner", "ring", "rotor", axis=(0.0, 1.0, 0.0), rate=-0.5)
    system = flexmb.compile(scene.scene())
    state = system.initial_state
    for algorithm in ("frisch", "frisch_as_printed"):
        difference = system.accelerations(state, algorithm) - system.accelerations(state)
        size = 1.0 * 9.8 * np.linalg.norm((0.1, 0.2, 0.3)) + 1.4 * 0.5**2  # weight times arm, and gyroscopic torque
        assert np.max(np.abs(system.mass_matrix(state) @ difference)) <= algebra(2, 2) * size


def test_it_is_not_blind():
    """Negative control: one per cent more mass in one body is seen in matrix, accelerations and loads."""
    scene = random_scene(0, SMALL)
    other = flexmb.compile(scene)
    heavier = np.array([1.01, *np.ones(len(other.body_names) - 1)])
    unlocked(other.constants).body["rigid"] *= heavier[:, None]
    other.constants.mfr[:] *= heavier[:, None, None]
    state = other.initial_state
    nested = flexmb.compile(scene).nested()
    _, motion = nested.motion(0.0, packed(state))
    assert np.max(np.abs(nested.reduced(0.0, packed(state))[0] - other.mass_matrix(state))) > 1e-4
    assert np.max(np.abs(motion.accelerations - other.accelerations(state))) > 1e-4
    expected = other.hinge_loads(state, motion.accelerations)["h0"]
    assert np.max(np.abs(motion.loads[0] - expected)) > 1e-4


@pytest.mark.parametrize("seed", (30, 31))
def test_full_is_approached_with_the_square_of_the_deformation(seed):
    """Slope 2 +- 0.1 over four decades of eta and its rate."""
    recipe = replace(trees.FULL, bodies=5, carriers=("modal", "beam", "floating", "rigid"), deformation=0.03)
    full = flexmb.compile(random_scene(seed, recipe))
    scales = 10.0 ** -np.arange(0.5, 5.0)
    distance = [_distance(full, deformed(full, scale)) for scale in scales]
    slopes = np.diff(np.log10(distance)) / np.diff(np.log10(scales))
    assert np.all(np.abs(slopes - 2.0) <= 0.1), (distance, slopes)


def _distance(full: flexmb.System, state: flexmb.State) -> float:
    """Of the generalised forces that hold both accelerations: those are not spoilt by a near-singular matrix."""
    difference = full.accelerations(state, "frisch") - full.accelerations(state)
    M = full.mass_matrix(state)
    return float(np.max(np.abs(M @ difference)) / np.max(np.abs(M) @ np.abs(full.accelerations(state))))
