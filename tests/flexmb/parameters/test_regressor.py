"""The inertia regressor, base parameters with counts from the literature, and what noisy torques identify."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flexmb
from flexmb.scene.build import SceneBuilder
from tests import trees
from tests.bounds import algebra

RECIPES = {
    "rigid": trees.ARMED_RIGID, "full": trees.FULL, "ruthless": trees.RUTHLESS, "every level": trees.EVERY_LEVEL,
}  # fmt: skip


@pytest.mark.parametrize(("recipe", "seed"), [(name, seed) for seed, name in enumerate(RECIPES)])
def test_regressor_times_parameters_is_inverse_dynamics(recipe, seed):
    """Y pi + rest = tau to rounding, and the parameters are those of the scene. An error of 1e-10 is noticed."""
    scene = trees.random_scene(seed, replace(RECIPES[recipe], bodies=6))
    system = flexmb.compile(scene)
    regressor, state = system.inertia_regressor(), system.initial_state
    rates = np.random.default_rng(seed).normal(size=system.nu)
    Y, rest = regressor.at(state, rates), regressor.rest(state, rates)
    tau = system.inverse_dynamics(state, rates)
    size = np.max(np.abs(Y) @ np.abs(regressor.values) + np.abs(rest))
    bound = 10.0 * algebra(system.nu, 6, len(regressor.names)) * size
    assert np.max(np.abs(Y @ regressor.values + rest - tau)) <= bound
    assert np.max(np.abs(Y @ (regressor.values * (1.0 + 1e-10)) + rest - tau)) > 0.1 * bound
    values = dict(zip(regressor.names, regressor.values, strict=True))
    for body in scene.bodies:
        if isinstance(body, flexmb.RigidBody) and body.name not in {wheel.body for wheel in scene.wheels}:
            assert values[f"{body.name}.mass"] == pytest.approx(body.mass_kg, rel=1e-12)
            assert values[f"{body.name}.first_moment.y"] == pytest.approx(body.mass_kg * body.com_m[1], rel=1e-11)


def test_regressor_of_free_rigid_trees_has_no_rest():
    scene = trees.random_scene(3, replace(trees.RIGID, bodies=5, wheels=0, conservative=True, prescribed=False))
    system = flexmb.compile(scene)
    rates = np.ones(system.nu)
    assert not system.inertia_regressor().rest(system.initial_state, rates).any()
    some = system.inertia_regressor(["b1"])
    assert len(some.names) == 10
    tau = some.at(system.initial_state, rates) @ some.values + some.rest(system.initial_state, rates)
    np.testing.assert_allclose(
        tau, system.inverse_dynamics(system.initial_state, rates), rtol=0.0, atol=1e-12 * np.max(np.abs(tau))
    )
    with pytest.raises(ValueError, match="bodies"):
        system.inertia_regressor(["b11"])


def arm(axes: list[tuple[float, float, float]], gravity=(0.0, 0.0, -9.81), twist: float = 0.1) -> flexmb.System:
    """A serial arm of revolute hinges, with offsets in all directions."""
    builder = SceneBuilder("arm", gravity=gravity)
    before, at = "ground", (0.0, 0.0, 0.0)
    for i, axis in enumerate(axes):
        builder.rigid_body(f"l{i}", mass=1.0 + i, com=(0.2, 0.03, -0.05), inertia=(0.02, 0.03, 0.04))
        builder.revolute(f"h{i}", before, f"l{i}", axis=axis, parent_position=at)
        before, at = f"l{i}", (0.5, twist, 0.2)
    return flexmb.compile(builder.scene())


def randomly(system: flexmb.System, count: int, seed: int = 0):
    rng = np.random.default_rng(seed)
    states = [system.state(rng.normal(size=system.nq), 2.0 * rng.normal(size=system.nu)) for _ in range(count)]
    return states, 3.0 * rng.normal(size=(count, system.nu))


X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
SKEW = [(0.6, 0.0, 0.8), (0.48, 0.8, 0.36), (0.36, -0.48, 0.8), (0.8, 0.36, 0.48), (-0.6, 0.8, 0.0), (0.0, 0.6, 0.8)]


@pytest.mark.parametrize(("axes", "gravity", "expected"), [
    ([Z, Z], (0.0, -9.81, 0.0), 6),  # planar 2R in a vertical plane: ZZ, MX, MY of each link
    ([Z, Z], (0.0, 0.0, -9.81), 4),  # in a horizontal plane the first moments of the first link have no effect
    ([Z, Z, Z], (0.0, -9.81, 0.0), 9),
    (SKEW, (0.0, 0.0, -9.81), 38),  # 7 n - 4, Mayeda, Yoshida & Osuka (1990): three of the first link, seven of others
    ([Z, *SKEW[1:]], (0.0, 0.0, -9.81), 36),  # its first axis along gravity: two less
    ([Z, Y, Y, X, Y, X], (0.0, 0.0, -9.81), 36),  # axes of a PUMA 560
])  # fmt: skip
def test_known_numbers_of_base_parameters(axes, gravity, expected):
    """Khalil & Dombre, ch. 9; with a clear gap between what counts and rounding errors."""
    system = arm(axes, gravity, twist=0.0 if axes[1] == Z else 0.1)
    base = system.inertia_regressor().base(*randomly(system, 80))
    assert base.rank == expected, base.names
    assert base.gap > 1e6


def test_a_free_body_shows_all_ten():
    builder = SceneBuilder("free", gravity=(0.0, 0.0, -9.81))
    builder.rigid_body("box", mass=2.0, com=(0.1, 0.2, 0.3), inertia=(0.2, 0.3, 0.4)).free("flight", "ground", "box")
    system = flexmb.compile(builder.scene())
    base = system.inertia_regressor().base(*randomly(system, 20))
    assert base.rank == 10 and base.names == system.inertia_regressor().names and base.gap == np.inf


def test_planar_arm_has_its_known_combinations():
    """ZZ_1 + m_2 l^2 and MX_1 + m_2 l, of a second link at the distance l = 0.5 (and 0.2 along the axis)."""
    system = arm([Z, Z], (0.0, -9.81, 0.0), twist=0.0)
    regressor = system.inertia_regressor()
    base = regressor.base(*randomly(system, 30))
    shown = dict(zip(base.names, base.matrix @ regressor.values, strict=True))
    assert "l0.first_moment.x + 0.5 l1.mass" in shown and "l0.inertia.zz + 0.25 l1.mass" in shown
    assert shown["l0.inertia.zz + 0.25 l1.mass"] == pytest.approx(0.04 + 1.0 * (0.2**2 + 0.03**2) + 0.25 * 2.0)
    states, rates = randomly(system, 3, seed=5)
    for state, udot in zip(states, rates, strict=True):
        Y = regressor.at(state, udot)
        np.testing.assert_allclose(base.reduced(Y) @ base.matrix @ regressor.values, Y @ regressor.values, atol=1e-12)


def test_identification_from_noisy_torques():
    """Estimates scatter as their covariance says: the mean of chi^2 / r over many experiments is 1."""
    system = arm([Z, Z], (0.0, -9.81, 0.0), twist=0.0)
    regressor = system.inertia_regressor()
    states, rates = randomly(system, 200)
    base = regressor.base(states, rates)
    W = regressor.stacked(states, rates)
    true, tau, rng = base.matrix @ regressor.values, W @ regressor.values, np.random.default_rng(1)
    squares = []
    for _ in range(200):
        found = base.fit(W, tau + 0.3 * rng.normal(size=len(tau)))
        off = found.values - true
        squares.append(off @ np.linalg.solve(found.covariance, off) / base.rank)
        assert found.noise == pytest.approx(0.3, rel=0.3)
    # chi^2 / r has the variance 2 / r, so that the mean of 200 is within 0.2 of 1 with five standard deviations
    assert np.mean(squares) == pytest.approx(1.0, abs=0.2)
    exact = base.fit(W, tau, noise=0.3)
    np.testing.assert_allclose(exact.values, true, atol=1e-10)
    assert np.all(exact.deviations > 0.0)


def test_motions_that_say_too_little_are_refused():
    system = arm([Z, Z], (0.0, -9.81, 0.0), twist=0.0)
    regressor = system.inertia_regressor()
    states, rates = randomly(system, 30)
    base = regressor.base(states, rates)
    still = [system.state(np.array([0.1 * i, 0.0]), np.zeros(2)) for i in range(10)]
    W = np.concatenate([regressor.at(each, np.zeros(2)) for each in still])
    with pytest.raises(ValueError, match="livelier"):
        base.fit(W, np.zeros(len(W)))
    with pytest.raises(ValueError, match="livelier"):
        base.fit(W[:4], np.zeros(4))
    with pytest.raises(ValueError, match="as many"):
        regressor.base(states, rates[:3])
    with pytest.raises(ValueError, match="deviation"):
        base.fit(np.ones((50, 20)), np.zeros(50), noise=0.0)


def test_level_stiffened_has_no_parameters():
    scene = trees.random_scene(0, replace(trees.STIFFENED, bodies=3))
    with pytest.raises(NotImplementedError, match="stiffened"):
        flexmb.compile(scene).inertia_regressor()
