"""Predefined relative motion, (137)-(145): fewer unknowns, and the loads that enforce the motion."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np
import pytest

import flexmb
from flexmb.scene import schema as s
from tests.bounds import algebra, backward_error
from tests.flexmb.frisch.scenes import SMALL, packed, random_scene

DRIVEN = replace(SMALL, bodies=8, point_masses=3)
SEEDS = (3, 6, 9)


@pytest.fixture(params=SEEDS)
def system(request) -> flexmb.System:
    """A tree with prescribed hinges, wheels and point masses."""
    system = flexmb.compile(random_scene(request.param, DRIVEN))
    assert np.any(system.constants.speed["prescribed"] >= 0)
    return system


def test_partitioned_solution(system):
    """(137), (142)-(144): Z* reordered into free and given accelerations; the given ones are the functions' own."""
    state = system.initial_state
    M, right = system.nested().reduced(0.0, packed(state))
    rates = system.accelerations(state, "frisch")
    given = np.flatnonzero(system.constants.speed["prescribed"] >= 0)
    free = np.setdiff1d(np.arange(system.nu), given)
    R = np.eye(system.nu)[:, np.concatenate([free, given])]
    Z, mu = R.T @ M @ R, R.T @ right  # (143)
    n = len(free)
    expected = mu[:n] - Z[:n, n:] @ rates[given]
    size = np.array([np.max(np.abs(M) @ np.abs(rates)) + np.max(np.abs(right))])
    assert backward_error(Z[:n, :n], rates[free], expected, size) <= algebra(system.nu, len(system.body_names))
    assert np.array_equal(rates[given], system.accelerations(state)[given])


def test_drive_loads_are_what_is_left_over(system):
    """(140), (145): Z*_21 x_F + Z*_22 x_c - mu*_2; free speeds have none."""
    state = system.initial_state
    M, right = system.nested().reduced(0.0, packed(state))
    _, motion = system.nested().motion(0.0, packed(state))
    given = system.constants.speed["prescribed"] >= 0
    left = M @ motion.accelerations - right
    size = np.max(np.abs(M) @ np.abs(motion.accelerations)) + np.max(np.abs(right))
    bound = algebra(system.nu, len(system.body_names))
    assert np.max(np.abs(left - np.where(given, motion.drives, 0.0))) <= bound * size


def test_a_drive_can_be_replaced_by_its_load():
    """Physics, not algebra: with the prescribed hinge set free and its drive load as motor, it accelerates the same."""
    scene = random_scene(SEEDS[0], replace(DRIVEN, hinges=("revolute",), wheels=0))
    system = flexmb.compile(scene)
    state = system.initial_state
    seen = system.evaluate(0.0, state.q, state.u, "frisch")
    driven = {name: drive for name, drive in seen.drives.items() if name.startswith("h")}
    assert driven
    hinges = tuple(_freed(system, hinge, driven, state) for hinge in scene.hinges)
    freed = flexmb.compile(msgspec.structs.replace(scene, hinges=hinges))
    right = freed.initial_state
    assert np.array_equal(right.q, state.q)
    found = freed.accelerations(right, "frisch")
    M = system.mass_matrix(state)
    size = np.max(np.abs(M) @ np.abs(seen.accelerations))
    assert np.max(np.abs(M @ (found - seen.accelerations))) <= algebra(system.nu, len(system.body_names), 20) * size


def _freed(system: flexmb.System, hinge: s.Hinge, driven: dict, state: flexmb.State) -> s.Hinge:
    if hinge.name not in driven:
        return hinge
    angle, rate = state.q[system.coordinate(hinge.name)][0], state.u[system.speed(hinge.name)][0]
    torque = s.Constant(value=float(driven[hinge.name][0]))
    return msgspec.structs.replace(
        hinge, rotation=s.AngularCoordinate(angle_rad=float(angle), rate_rad_s=float(rate), torque_Nm=torque)
    )


def test_print_is_right_without_flexible_bodies():
    """(138), (141), (145): the drives of rigid trees are those of the print."""
    scene = random_scene(SEEDS[0], replace(DRIVEN, carriers=("rigid",)))
    system = flexmb.compile(scene)
    state = system.initial_state
    printed = system.evaluate(0.0, state.q, state.u, "frisch_as_printed").drives
    ours = system.evaluate(0.0, state.q, state.u, "frisch").drives
    for name, drive in ours.items():
        assert np.allclose(printed[name], drive, rtol=1e-9, atol=1e-9)
