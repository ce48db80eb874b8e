"""Energy and momentum of conservative random trees over a run, and the orders of the integrators on quaternions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flexmb
from flexmb.scene.build import SceneBuilder
from tests import trees

RTOL = 1e-11
FINER = 1e-12  # what is left of a momentum is the sum of some hundred step errors: two digits above the tolerance
RIGID = replace(trees.CONSERVATIVE, carriers=("rigid",), bodies=6)
FULL = replace(trees.CONSERVATIVE, carriers=("modal", "rigid", "floating"), bodies=4)
CONSERVATIVE = {"rigid": RIGID, "full": FULL}
FREE_FLYING = {name: replace(recipe, grounded=False) for name, recipe in CONSERVATIVE.items()}
# Without three-axis gimbals: a tumbling tree would run into their singular angle.
SAFE = tuple(kind for kind in trees.KINDS if kind != "gimbal")


def run(recipe: trees.Recipe, seed: int, t_end: float, rtol: float = RTOL) -> flexmb.Trajectory:
    scene = trees.random_scene(seed, replace(recipe, hinges=SAFE))
    done = flexmb.simulate(scene, t_end, rtol=rtol, atol=1e-2 * rtol, samples=11)
    assert done.finished, done.message
    return done


@pytest.mark.parametrize("seed", (40, 41))
@pytest.mark.parametrize("name", CONSERVATIVE)
def test_energy_is_conserved(name, seed):
    """A step may err by RTOL of the state; over the few hundred steps of a run that adds up to 1e-9 of the energy."""
    done = run(CONSERVATIVE[name], seed, 2.0)
    assert np.max(np.abs(done.energy_drift)) <= 1e-9 * done.energy_scale
    assert np.ptp(done.energy["kinetic"]) > 1e-3 * done.energy_scale, "nothing moves: this would show nothing"


@pytest.mark.parametrize("seed", (42, 43))
@pytest.mark.parametrize("name", FREE_FLYING)
def test_energy_and_momentum_of_free_flying_trees_are_conserved(name, seed):
    done = run(FREE_FLYING[name], seed, 2.0, FINER)
    assert np.max(np.abs(done.energy_drift)) <= 1e-9 * done.energy_scale
    for part in (slice(0, 3), slice(3, 6)):
        assert np.max(np.abs(done.momentum_drift[:, part])) <= 1e-10 * np.max(np.abs(done.momentum[0, part]))


def test_ruthless_bodies_drift():
    """The level that is not conservative is seen to be: the bounds above can be missed."""
    done = run(replace(FULL, levels=("ruthless",)), 40, 2.0)
    assert np.max(np.abs(done.energy_drift)) > 1e-6 * done.energy_scale


def tumbling(hinge: str) -> flexmb.System:
    """An unsymmetric body with a heavy off-centre mass under gravity, on a quaternion hinge."""
    scene = SceneBuilder("tumbling", gravity=(0.0, 0.0, -9.81)).rigid_body(
        "body", mass=2.0, com=(0.1, -0.2, 0.3), inertia=(0.3, 0.5, 0.6)
    )
    turn = {"quaternion": (0.8, 0.0, 0.6, 0.0), "angular_velocity": (0.5, 2.0, -1.0)}
    if hinge == "free":
        scene.free("hinge", "ground", "body", velocity=(1.0, -0.5, 0.3), **turn)
    else:
        scene.spherical("hinge", "ground", "body", **turn)
    return flexmb.compile(scene.scene())


def end(system: flexmb.System, **settings) -> np.ndarray:
    done = flexmb.simulate(system, 1.0, samples=2, **settings)
    return np.concatenate([done.q[-1], done.u[-1]])


@pytest.mark.parametrize("hinge", ["spherical", "free"])
def test_projected_quaternions_keep_order_four(hinge):
    """Slope 4 +- 0.1 of the error at 1 s over steps halved from 1/16 s, against DOP853 at its finest tolerance."""
    system = tumbling(hinge)
    reference = end(system, rtol=1e-13, atol=1e-15)
    steps = 1.0 / 2.0 ** np.arange(5, 10)
    errors = [np.max(np.abs(end(system, method="rk4", step=h) - reference)) for h in steps]
    slopes = -np.diff(np.log2(errors))
    assert slopes[-1] == pytest.approx(4.0, abs=0.1)


@pytest.mark.parametrize("hinge", ["spherical", "free"])
def test_dop853_converges_like_order_eight(hinge):
    """Error per unit time is proportional to the tolerance, and the cost grows as tolerance^(-1/8) only.

    The fixed-step order is measured where the integrators are (`integrate/test_orders.py`).
    """
    system = tumbling(hinge)
    reference = end(system, rtol=1e-13, atol=1e-15)
    tolerances = np.array([1e-5, 1e-7, 1e-9, 1e-11])
    steps, errors = [], []
    for rtol in tolerances:
        done = flexmb.simulate(system, 1.0, rtol=rtol, atol=1e-2 * rtol, samples=2)
        steps.append(done.statistics.accepted_steps)
        errors.append(np.max(np.abs(np.concatenate([done.q[-1], done.u[-1]]) - reference)))
    assert np.all(np.array(errors) <= 100.0 * tolerances)
    assert np.all(np.diff(errors) < 0.0)
    growth = np.log(steps[-1] / steps[0]) / np.log(tolerances[0] / tolerances[-1])
    assert 1.0 / 10.0 < growth < 1.0 / 7.0


@pytest.mark.parametrize("hinge", ["spherical", "free"])
@pytest.mark.parametrize("settings", [{"method": "rk4", "step": 0.05}, {"rtol": 1e-4, "atol": 1e-6}])
def test_quaternions_stay_unit(hinge, settings):
    done = flexmb.simulate(tumbling(hinge), 5.0, samples=51, **settings)
    norms = np.linalg.norm(done.q[:, -4:], axis=1)
    assert np.max(np.abs(norms - 1.0)) <= 4.0 * np.finfo(float).eps
