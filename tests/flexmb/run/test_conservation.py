"""Energy and momentum of conservative random trees over a run, and the orders of the integrators on quaternions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flexmb
from flexmb.scene.build import SceneBuilder
from flexmb.scene.functions import Pulse
from tests import trees
from tests.bounds import observed_order

RTOL = 1e-11
FINER = 1e-12  # what is left of a momentum is the sum of some hundred step errors: two digits above the tolerance
RIGID = replace(trees.CONSERVATIVE, carriers=("rigid",), bodies=6)
FULL = replace(trees.CONSERVATIVE, carriers=("modal", "rigid", "floating"), bodies=4)
STIFFENED = replace(FULL, carriers=("modal", "beam", "floating", "rigid"), levels=("stiffened",))
EXACT = replace(FULL, carriers=trees.EXACT.carriers, levels=("exact",))
CONSERVATIVE = {"rigid": RIGID, "full": FULL, "stiffened": STIFFENED, "exact": EXACT}
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


@pytest.mark.parametrize("level", ["ruthless", "linear"])
def test_truncated_levels_drift(level):
    """The levels that are not conservative are seen to be: the bounds above can be missed."""
    done = run(replace(FULL, levels=(level,)), 40, 2.0)
    assert np.max(np.abs(done.energy_drift)) > 1e-6 * done.energy_scale


def tumbling(hinge: str, gravity: float = 9.81, t_end: float = 1.0, segments: int = 0) -> flexmb.System:
    """An unsymmetric body with its mass centre off the origin, on a quaternion hinge.

    `segments`: pulses of no force switch at equal intervals up to t_end. No step may cross a switch.
    """
    scene = SceneBuilder("tumbling", gravity=(0.0, 0.0, -gravity)).rigid_body(
        "body", mass=2.0, com=(0.1, -0.2, 0.3), inertia=(0.3, 0.5, 0.6)
    )
    turn = {"quaternion": (0.8, 0.0, 0.6, 0.0), "angular_velocity": (3.0, 0.3, 0.5)}
    if hinge == "free":
        scene.free("hinge", "ground", "body", velocity=(1.0, -0.5, 0.3), **turn)
    else:
        scene.spherical("hinge", "ground", "body", **turn)
    for k in range(0, segments, 2):
        nothing = Pulse(value=0.0, start_s=t_end * k / segments, duration_s=t_end / segments)
        scene.force(f"nothing {k}", "body", direction=(1.0, 0.0, 0.0), function=nothing)
    return flexmb.compile(scene.scene())


def end(system: flexmb.System, t_end: float, **settings) -> np.ndarray:
    done = flexmb.simulate(system, t_end, samples=2, **settings)
    return np.concatenate([done.q[-1], done.u[-1]])


def size(error: np.ndarray) -> float:
    return float(np.sqrt(np.mean(error**2)))


@pytest.mark.parametrize("hinge", ["spherical", "free"])
def test_projected_quaternions_keep_order_four_of_rk4(hinge):
    """Steps halved from 1/64 s, against DOP853 at its finest tolerance."""
    system = tumbling(hinge)
    reference = end(system, 1.0, rtol=1e-13, atol=1e-15)
    steps = 1.0 / 2.0 ** np.arange(6, 10)
    errors = [size(end(system, 1.0, method="rk4", step=h) - reference) for h in steps]
    assert observed_order(steps, errors, floor=1e-14, last=1) == pytest.approx(4.0, abs=0.1)


@pytest.mark.parametrize("hinge", ["spherical", "free"])
def test_projected_quaternions_keep_order_eight_of_dop853(hinge):
    """A tolerance that accepts everything, and switches at equal intervals: equal steps, after the first few.

    Without gravity: the error of order 8 in a heavy top happens to be small against that of order 9 at such steps.
    """
    t_end, segments = 4.0, np.array([16, 24, 32, 48])
    reference = end(tumbling(hinge, 0.0), t_end, rtol=3e-14, atol=1e-16)
    errors = []
    for count in segments:
        system = tumbling(hinge, 0.0, t_end, count)
        errors.append(size(end(system, t_end, rtol=1e-2, atol=1e6) - reference))
    assert observed_order(t_end / segments, errors, floor=1e-14, last=1) == pytest.approx(8.0, abs=0.1)


@pytest.mark.parametrize("hinge", ["spherical", "free"])
@pytest.mark.parametrize("settings", [{"method": "rk4", "step": 0.05}, {"rtol": 1e-4, "atol": 1e-6}])
def test_quaternions_stay_unit(hinge, settings):
    done = flexmb.simulate(tumbling(hinge), 5.0, samples=51, **settings)
    norms = np.linalg.norm(done.q[:, -4:], axis=1)
    assert np.max(np.abs(norms - 1.0)) <= 4.0 * np.finfo(float).eps
