"""Fidelity levels: where they coincide exactly, and how fast they part."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np
import pytest

import flexmb
from flexmb.scene import schema as s
from flexmb.system import System
from tests import trees
from tests.bounds import algebra, observed_order, relative

RECIPE = replace(trees.FULL, bodies=5, carriers=("modal", "beam", "floating", "rigid"))
SCALES = np.array([1e-1, 1e-2, 1e-3, 1e-4])
SEEDS = (30, 31)


def at_level(scene: s.Scene, level: s.Level) -> s.Scene:
    bodies = [body if isinstance(body, s.RigidBody) else msgspec.structs.replace(body, level=level)
              for body in scene.bodies]  # fmt: skip
    states = scene.modal_states if level != "rigid" else ()
    return msgspec.structs.replace(scene, bodies=tuple(bodies), modal_states=states)


def with_deformation(system: System, scale: float) -> flexmb.State:
    """The initial state with modal coordinates and rates times `scale`."""
    state = system.initial_state
    for body in system.scene.bodies:
        if not isinstance(body, s.RigidBody):
            state.q[system.coordinate(f"{body.name}.modes")] *= scale
            state.u[system.speed(f"{body.name}.modes")] *= scale
    return state


@pytest.fixture(scope="module", params=SEEDS)
def scene(request) -> s.Scene:
    return trees.random_scene(request.param, RECIPE)


@pytest.fixture(scope="module")
def systems(scene) -> dict[str, System]:
    return {level: flexmb.compile(at_level(scene, level)) for level in ("full", "ruthless", "rigid")}


def test_full_and_ruthless_coincide_at_rest_shape(systems):
    """Undeformed and with the modes still, both are the same equations, summed in different orders."""
    full, ruthless = systems["full"], systems["ruthless"]
    state = with_deformation(full, 0.0)
    bound = algebra(full.nu, len(full.body_names), 15)
    M = full.mass_matrix(state)
    assert relative(M, ruthless.mass_matrix(state)) <= bound
    assert relative(full.bias(state), ruthless.bias(state)) <= bound
    free = full.constants.speed["prescribed"] < 0
    a, b = full.accelerations(state), ruthless.accelerations(state)
    # both solve the same equations to backward error, so their difference is a force within twice that
    size = np.max(np.abs(M) @ np.abs(a) + np.abs(full.bias(state)))
    assert np.max(np.abs(M @ (a - b))[free]) <= 2.0 * bound * size


def test_ruthless_is_wrong_to_first_order_in_the_deformation(systems):
    """Slope one of M, of the bias and of the accelerations: the elastic forces, equal in both, do not enter."""
    full, ruthless = systems["full"], systems["ruthless"]
    for quantity in (System.mass_matrix, System.bias, System.accelerations):
        errors = []
        for scale in SCALES:
            state = with_deformation(full, scale)
            a, b = quantity(full, state), quantity(ruthless, state)
            errors.append(np.linalg.norm(a - b) / np.linalg.norm(a))
        assert observed_order(SCALES, errors, floor=1e-12) == pytest.approx(1.0, abs=0.1), quantity.__name__


def test_a_stiff_flexible_body_moves_like_the_rigid_one(systems):
    """The rigid level is `full` with its modal rows and columns struck out at rest shape."""
    full, rigid = systems["full"], systems["rigid"]
    state = with_deformation(full, 0.0)
    modal = np.zeros(full.nu, dtype=bool)
    for body in full.scene.bodies:
        if not isinstance(body, s.RigidBody):
            modal[full.speed(f"{body.name}.modes")] = True
    bound = algebra(full.nu, len(full.body_names), 15)
    assert relative(full.mass_matrix(state)[np.ix_(~modal, ~modal)], rigid.mass_matrix(rigid.initial_state)) <= bound
    assert relative(full.bias(state)[~modal], rigid.bias(rigid.initial_state)) <= bound


def test_levels_share_strain_energy_and_marker_positions(systems):
    """`ruthless` forgets the deformation in its inertia only: springs and drawings see it."""
    full, ruthless = systems["full"], systems["ruthless"]
    state = full.initial_state
    a, b = (system.evaluate(0.0, state.q, state.u) for system in (full, ruthless))
    bound = algebra(full.nu, len(full.body_names), 15)
    assert a.energy["strain"] == b.energy["strain"] > 0.0
    for name, marker in a.markers.items():
        assert relative(marker.position, b.markers[name].position) <= bound


@pytest.mark.parametrize("level", ["linear", "stiffened"])
def test_levels_to_come_are_refused_honestly(scene, level):
    with pytest.raises(NotImplementedError, match=level):
        flexmb.compile(at_level(scene, level))
