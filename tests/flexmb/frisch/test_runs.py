"""Whole runs in both routes: the same trajectory to the integrator's tolerance."""

from __future__ import annotations

import numpy as np
import pytest

import flexmb
from tests.flexmb.frisch.scenes import at_level, random_scene
from tests.repo.project import ROOT

pytestmark = pytest.mark.filterwarnings("ignore:.*leaves out that this pulls it straight")  # fast turns are meant

CASES = {
    "three-wheel gyrostat with a flexible appendage": "wheel_gyrostat/flexible_appendage",
    "deploying boom": "deploying_boom/flexible",
}
RTOL = 1e-9


def scene(case: str):
    return at_level(flexmb.load_scene(ROOT / "cases" / CASES[case] / "scene.toml"), "linear")


@pytest.mark.parametrize("case", CASES)
def test_routes_run_alike(case):
    """Two seconds of adaptive steps; differences are rounding carried along, far below the tolerance."""
    system = flexmb.compile(scene(case))
    ours, theirs = (
        flexmb.simulate(system, 2.0, rtol=RTOL, atol=1e-2 * RTOL, samples=41, algorithm=algorithm)
        for algorithm in ("frisch", "articulated")
    )
    assert ours.finished and theirs.finished
    for found, expected in ((ours.q, theirs.q), (ours.u, theirs.u), (ours.work, theirs.work)):
        assert np.max(np.abs(found - expected)) <= RTOL * max(1.0, np.max(np.abs(expected)))
    largest = max(np.max(np.abs(load)) for load in theirs.loads.values())
    for found, expected in ((ours.loads, theirs.loads), (ours.wheel_loads, theirs.wheel_loads)):
        for name in expected:
            assert np.max(np.abs(found[name] - expected[name])) <= RTOL * largest
    for name in theirs.drives:
        assert np.max(np.abs(ours.drives[name] - theirs.drives[name])) <= RTOL * largest
    for name, path in theirs.markers.items():
        accelerations = np.max(np.abs(path.acceleration))
        assert np.max(np.abs(ours.markers[name].acceleration - path.acceleration)) <= RTOL * accelerations
    assert np.array_equal(ours.momentum, theirs.momentum) or np.allclose(ours.momentum, theirs.momentum, atol=RTOL)


def test_fixed_steps_too():
    """RK4 with the same steps differs by rounding alone."""
    system = flexmb.compile(scene("three-wheel gyrostat with a flexible appendage"))
    ours, theirs = (
        flexmb.simulate(system, 0.05, "rk4", step=1e-4, samples=3, algorithm=algorithm)
        for algorithm in ("frisch", "articulated")
    )
    assert np.max(np.abs(ours.u - theirs.u)) <= 1e-12 * np.max(np.abs(theirs.u))


def test_print_runs_away_with_a_flexible_body_inside():
    """The boom has flexible members inside the tree: as printed the run fails, and says when; nothing is lost."""
    system = flexmb.compile(scene("deploying boom"))
    printed = flexmb.simulate(system, 2.0, rtol=1e-6, atol=1e-8, samples=201, algorithm="frisch_as_printed")
    assert not printed.finished
    assert 0.0 < printed.stopped_at < 2.0
    assert len(printed.t) >= 1
    assert "stopped at" in printed.message


def test_a_check_of_one_state_is_not_for_runs():
    """The unsplit recursion is there to be compared with at a state; a run names what it can be done by."""
    system = flexmb.compile(scene("three-wheel gyrostat with a flexible appendage"))
    with pytest.raises(ValueError, match="frisch"):
        flexmb.simulate(system, 1.0, algorithm="unsplit")


def test_print_refuses_modes_that_are_not_clamped():
    system = flexmb.compile(random_scene(0))
    with pytest.raises(ValueError, match="clamps every body"):
        system.accelerations(system.initial_state, "frisch_as_printed")
