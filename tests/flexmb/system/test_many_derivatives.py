"""Derivatives of many random trees against a complex step through the dense route."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flexmb as fm
from flexmb.dense import DenseSystem
from tests import trees
from tests.flexmb.entry.test_tangent import RECIPES, H, terms

REQUIRED = 1e-11  # relative, of accelerations; the worst of 500 trees was off by 4e-12, of inverse dynamics by 7e-15


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 125))
@pytest.mark.parametrize("recipe", RECIPES)
def test_a_random_tree(recipe: str, seed: int) -> None:
    scene = trees.random_scene(seed, replace(RECIPES[recipe], bodies=6))
    system, dense, rng = fm.compile(scene), DenseSystem(scene), np.random.default_rng(seed)
    state, free = system.initial_state, system.constants.speed["prescribed"] < 0
    rates = rng.normal(size=system.nu)
    of_rates, of_tau = system.acceleration_derivatives(state), system.inverse_dynamics_derivatives(state, rates)
    xi, du = rng.normal(size=(2, system.nu)) * free
    q, u = state.q + 1j * H * (of_rates.motion @ xi), state.u + 1j * H * du
    missing = sum(np.imag(part) / H for part in terms(dense, q, u, of_rates.accelerations))
    expected = -np.linalg.solve(dense.mass_matrix(state.q)[np.ix_(free, free)], missing[free])
    found = (of_rates.by_displacement @ xi + of_rates.by_speed @ du)[free]
    assert np.max(np.abs(found - expected)) <= REQUIRED * np.max(np.abs(expected))
    expected = np.imag(dense.mass_matrix(q) @ rates + dense.bias(q, u)) / H
    found = of_tau.by_displacement @ xi + of_tau.by_speed @ du
    assert np.max(np.abs(found - expected)) <= REQUIRED * np.max(np.abs(expected))
