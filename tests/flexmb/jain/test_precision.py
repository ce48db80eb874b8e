"""The estimated digits of the accelerations against the true ones, by the same recursion in extended precision."""

from __future__ import annotations

import warnings
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from numpy.random import Generator

import flexmb
from flexmb.scene import schema as s
from flexmb.system.factors import ROUNDING
from flexmb.system.mechanics import FEW_DIGITS
from flexmb.tables.state import PrecisionWarning
from tests import trees
from tests.flexmb import extended
from tests.flexmb.jain.singular import FAMILIES

RECIPES = (
    trees.RIGID, replace(trees.FULL, carriers=("rigid", "modal")), replace(trees.FREE_FLYING, carriers=("rigid",)),
)  # fmt: skip
OPTIMISM = 1.0  # digits; the estimate bounds rounding in the norm of S, and is told to one
needs_long_doubles = pytest.mark.skipif(
    np.finfo(float).nmant >= extended.BITS, reason="long doubles are doubles here"
)


def tree(seed: int) -> s.Scene:
    """A random tree whose masses and inertias differ by up to fourteen decades."""
    rng = np.random.default_rng(10_000 + seed)
    decades = rng.uniform(0.0, 7.0)
    recipe = replace(RECIPES[seed % 3], bodies=int(rng.integers(2, 9)), prescribed=False)
    scene = trees.random_scene(seed, replace(recipe, branching=bool(rng.integers(2))))
    return msgspec.structs.replace(scene, bodies=tuple(_scaled(body, rng, decades) for body in scene.bodies))


def _scaled(body: s.Body, rng: Generator, decades: float) -> s.Body:
    """The same shape and frequencies of another mass."""
    factor = 10.0 ** rng.uniform(-decades, decades)
    if isinstance(body, s.RigidBody):
        inertia = trees.matrix(factor * np.array(body.inertia_kg_m2))
        return msgspec.structs.replace(body, mass_kg=factor * body.mass_kg, inertia_kg_m2=inertia)
    assert isinstance(body, s.ModalBody)
    points = tuple(
        msgspec.structs.replace(
            p, mass_kg=factor * p.mass_kg, inertia_kg_m2=trees.matrix(factor * np.array(p.inertia_kg_m2))
        )
        for p in body.points
    )
    stiffness, damping = (trees.matrix(factor * np.array(each)) for each in (body.stiffness, body.damping))
    return msgspec.structs.replace(body, points=points, stiffness=stiffness, damping=damping)


def digits(scene: s.Scene) -> tuple[float, float]:
    """Estimated and true digits of the accelerations, these weighed with the root of M's diagonal."""
    system = flexmb.compile(scene)
    state = system.initial_state
    exact, size = extended.accelerations(system, state), np.sqrt(np.diag(system.mass_matrix(state)))
    error = np.linalg.norm(size * (system.accelerations(state) - exact).astype(float))
    share = error / np.linalg.norm(size * exact.astype(float))
    return system.digits_left(state), float(-np.log10(max(share, ROUNDING)))


def excess(seeds: range) -> np.ndarray:
    """Estimated minus true digits."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PrecisionWarning)
        found = np.array([digits(tree(seed)) for seed in seeds])
    return found[:, 0] - found[:, 1]


@needs_long_doubles
def test_the_estimate_is_honest():
    found = excess(range(20))
    assert np.max(found) <= OPTIMISM
    assert np.median(found) >= -2.0


@needs_long_doubles
@pytest.mark.slow
def test_the_estimate_is_honest_over_many_trees():
    found = excess(range(20, 560))
    assert np.max(found) <= OPTIMISM
    assert np.quantile(found, 0.05) >= -3.0


def nearly_singular() -> s.Scene:
    """Of a condition of some 1e13."""
    return FAMILIES["one_line"](0, 1e-12)


def test_few_digits_are_told():
    system = flexmb.compile(nearly_singular())
    state = system.initial_state
    assert 0.0 < system.digits_left(state) < FEW_DIGITS
    for algorithm in ("articulated", "unsplit", "composite", "frisch"):
        with pytest.warns(PrecisionWarning, match='about 3 of 16 digits .* body "slider"'):
            system.accelerations(state, algorithm)


def test_a_run_with_few_digits_says_so():
    """Of the line that asked for it, in one stage or several; the message has it where the last stage begins so."""
    stages = [flexmb.RunStage(1e-3, samples=2)]
    for run in (
        lambda: flexmb.simulate(nearly_singular(), 1e-3, "rk4", step=1e-4, samples=2),
        lambda: flexmb.simulate_stages(nearly_singular(), stages, "rk4", step=1e-4),
        lambda: flexmb.simulate_stages(nearly_singular(), 2 * stages, "rk4", step=1e-4),
    ):
        with pytest.warns(PrecisionWarning, match="about 3 of 16 digits") as told:
            trajectory = run()
        assert __file__ in {each.filename for each in told}
        assert "about 3 of 16 digits" in trajectory.message


def test_a_run_with_many_says_nothing():
    with warnings.catch_warnings():
        warnings.simplefilter("error", PrecisionWarning)
        trajectory = flexmb.simulate(FAMILIES["one_line"](0, 1e-3), 0.01)
    assert trajectory.message == "finished at t = 0.01 s"


def test_units_do_not_matter():
    """Of the mass, and of the modes: the digits are the same to the tenth that they are told to."""
    scene = FAMILIES["two_points"](0, 1e-6)
    flexible = next(body for body in scene.bodies if isinstance(body, s.ModalBody))
    factors = 10.0 ** np.array([3.0, -2.0, 1.0, -4.0, 5.0, 0.0])
    points = tuple(
        msgspec.structs.replace(p, translation_modes=trees.matrix(factors[:, None] * np.array(p.translation_modes)))
        for p in flexible.points
    )
    other = msgspec.structs.replace(
        flexible, points=points, stiffness=trees.matrix(np.outer(factors, factors) * np.array(flexible.stiffness))
    )
    bodies = tuple(other if body is flexible else body for body in scene.bodies)
    state = next(iter(scene.modal_states))
    states = (msgspec.structs.replace(state, coordinates=tuple(np.array(state.coordinates) / factors)),)
    scaled = msgspec.structs.replace(scene, bodies=bodies, modal_states=states)
    found = [
        flexmb.compile(each).digits_left(flexmb.compile(each).initial_state) for each in (scene, scaled)
    ]
    assert found[0] == pytest.approx(found[1], abs=0.2)
