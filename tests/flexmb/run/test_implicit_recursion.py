"""Implicit methods on trees of many speeds: Newton's method by the recursion, without Jacobians."""

from __future__ import annotations

import numpy as np
import pytest

import flexmb as fm
from flexmb.ready import scenes
from flexmb.scene.build import SceneBuilder
from flexmb.system import by_recursion
from tests import trees

METHODS = {"radau5": {"rtol": 1e-7, "atol": 1e-9}, "generalised_alpha": {"step": 1e-3}}


@pytest.fixture
def always(monkeypatch):
    """Trees of any size are solved by the recursion."""
    monkeypatch.setattr(by_recursion, "MANY_SPEEDS", 0)


def scene(seed: int = 4, **more) -> fm.Scene:
    """A tree with flexible bodies, quaternions, a wheel, a prescribed hinge and loads, without springs of balls."""
    recipe = trees.Recipe(bodies=4, hinges=("free", "revolute", "universal", "prismatic"), deformation=0.02, **more)
    return trees.random_scene(seed, recipe)


def end(run: fm.Trajectory) -> np.ndarray:
    assert run.finished, run.reason
    return np.concatenate([run.q[-1], run.u[-1]])


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("level", ["full", "stiffened", "ruthless"])
def test_same_motion(method, level, monkeypatch):
    """With the Jacobian and without, Newton's method finds the same motion; only its iterations differ."""
    found = {}
    for many in (0, 10**9):
        monkeypatch.setattr(by_recursion, "MANY_SPEEDS", many)
        run = fm.simulate(scene(levels=(level,)), 0.1, method, samples=3, **METHODS[method])
        found[many] = end(run)
        assert (run.statistics.jacobians == 0) == (many == 0)
    scale = np.abs(found[0]).max()
    # Steps may differ by a rejection, so that both differ by the error that rtol permits.
    np.testing.assert_allclose(found[0], found[10**9], rtol=0.0, atol=2e-6 * scale)


@pytest.mark.parametrize("method", METHODS)
def test_resumed_run_is_the_same(method, always):
    """A run that was interrupted ends with the same bits."""
    system = fm.compile(scene())
    whole = fm.simulate(system, 0.1, method, samples=3, **METHODS[method])
    first = fm.simulate(system, 0.05, method, samples=2, **METHODS[method])
    second = fm.simulate(system, 0.1, method, samples=2, state=first.restart, **METHODS[method])
    np.testing.assert_array_equal(end(second), end(whole))
    assert second.statistics.jacobians == 0


def pendulums(gravity: float) -> fm.Scene:
    """A chain of rigid pendulums: all of its stiffness is that of gravity, which the stiff part does not contain."""
    chain = SceneBuilder("pendulums", gravity=(0.0, -gravity, 0.0))
    for k in range(4):
        chain.rigid_body(f"b{k}", mass=1.0, com=(0.0, -0.5, 0.0), inertia=(0.1, 0.1, 0.1))
        place = {} if k == 0 else {"parent_position": (0.0, -1.0, 0.0)}
        chain.revolute(f"h{k}", "ground" if k == 0 else f"b{k - 1}", f"b{k}", angle=0.02, damping=0.4, **place)
    return chain.scene()


@pytest.mark.parametrize("method", ["radau5", "generalised_alpha"])
def test_jacobian_where_it_is_needed(method, always):
    """Steps so long that Newton's method needs what the stiff part leaves out are done with the Jacobian."""
    settings = {"radau5": {"rtol": 1e-3, "atol": 1e-3}, "generalised_alpha": {"step": 0.05}}[method]
    run = fm.simulate(pendulums(4000.0), 1.0, method, samples=3, **settings)
    end(run)
    assert run.statistics.jacobians > 0
    gentle = fm.simulate(pendulums(1.0), 1.0, method, samples=3, **settings)
    end(gentle)
    assert gentle.statistics.jacobians == 0


def test_without_it_they_use_the_jacobian(always):
    """Connectors between frames are not in the stiff part: nothing is tried without them."""
    tied = SceneBuilder("tied", gravity=(0, 0, 0)).rigid_body("a", mass=1.0, inertia=(1, 1, 1))
    tied.prismatic("slide", "ground", "a", axis=(1, 0, 0), position=0.2)
    tied.spring_damper("tie", "ground", "a", position_a=(-1.0, 0, 0), stiffness=1e4, free_length=1.0)
    run = fm.simulate(tied.scene(), 0.1, "radau5", samples=2)
    assert run.finished
    assert run.statistics.jacobians > 0


@pytest.mark.parametrize("method", METHODS)
def test_controllers(method, monkeypatch):
    """States of continuous controllers are not in the stiff part; sampled ones only hold their outputs."""
    for sampling, exact in ({}, True), ({"period": 0.01}, False):
        scene = scenes.with_feedback(scenes.pendulum(), **sampling)
        found = {}
        for many in (0, 10**9):
            monkeypatch.setattr(by_recursion, "MANY_SPEEDS", many)
            run = fm.simulate(scene, 0.1, method, samples=3, **METHODS[method])
            found[many] = end(run)
            assert (run.statistics.jacobians > 0) == (exact or many > 0)
        np.testing.assert_allclose(found[0], found[10**9], rtol=1e-6)
