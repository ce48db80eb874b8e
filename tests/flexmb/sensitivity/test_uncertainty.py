"""First-order uncertainty: against sampled runs, and by its own identities."""

from __future__ import annotations

import numpy as np
import pytest

import flexmb as fm
from flexmb.ready import scenes
from tests.flexmb.closure import mechanisms

OUTPUTS = ["pivot.rotation", "pivot.torque.z"]
SIGMA = {"bob.mass_kg": 0.01, "pivot.rotation.stiffness_Nm_rad": 0.3, "pivot.rotation.angle_rad": 0.005}


def swinging() -> fm.schema.Scene:
    return scenes.pendulum().scene().with_values({"pivot.rotation.angle_rad": 0.3})


def test_contributions_add_up_to_the_variance_and_sampled_runs_agree():
    found = fm.uncertainty(swinging(), 1.5, SIGMA, OUTPUTS, samples=4)
    assert found.contributions.shape == (4, 2, 3) and np.all(found.contributions >= 0.0)
    assert np.allclose(np.sum(found.contributions, axis=-1), found.sigma**2)
    assert np.allclose(np.sum(found.shares, axis=-1)[found.sigma > 0.0], 1.0)
    rng, runs, nominal = np.random.default_rng(1), [], found.sensitivities.parameter_values
    for _ in range(200):
        values = dict(zip(SIGMA, nominal + np.array(list(SIGMA.values())) * rng.standard_normal(3), strict=True))
        run = fm.simulate(swinging().with_values(values), 1.5, samples=4)
        columns = {name: each for name, _, each in run.columns()}
        runs.append(np.column_stack([columns[name] for name in OUTPUTS]))
    spread = np.std(runs, axis=0, ddof=1)
    # A standard deviation of 200 samples is known to 1/sqrt(400) = 5 %: four of these; the rest is linear to 1 %.
    moved = found.sigma > 1e-12
    assert np.all(np.abs(spread[moved] / found.sigma[moved] - 1.0) < 0.21)
    assert "bob.mass_kg" in str(found) and "%" in str(found)


def test_correlation_changes_the_variance_as_it_should():
    """Fully correlated parameters: derivatives add up before they are squared."""
    names = dict(list(SIGMA.items())[:2])
    found = fm.uncertainty(swinging(), 1.0, names, OUTPUTS, samples=3, correlation=np.ones((2, 2)))
    sums = found.sensitivities.derivatives @ np.array(list(names.values()))
    assert np.allclose(found.sigma, np.abs(sums))


def test_a_fit_brings_its_covariance():
    run = fm.simulate(swinging(), 2.0, samples=41)
    noisy = run.q[:, 0] + 1e-3 * np.random.default_rng(2).standard_normal(41)
    fit = fm.fit(
        swinging(),
        {"t": run.t, "pivot.rotation": noisy},
        ["pivot.rotation.stiffness_Nm_rad", "pivot.rotation.angle_rad"],
    )
    found = fm.uncertainty(fit.scene, 1.0, fit, OUTPUTS, samples=3)
    assert np.array_equal(found.covariance, fit.covariance)
    assert found.sigma[0, 0] == pytest.approx(fit.sigma[1])  # the initial angle itself


@pytest.mark.parametrize(
    ("given", "correlation", "message"),
    [
        ({}, None, "no parameters"),
        ({"bob.mass_kg": -1.0}, None, "negative"),
        (SIGMA, np.eye(2), "shape"),
        (SIGMA, 2.0 * np.eye(3), "ones on the diagonal"),
        (SIGMA, [[1.0, 1.0, -1.0], [1.0, 1.0, 1.0], [-1.0, 1.0, 1.0]], "eigenvalue"),
    ],
)
def test_bad_input_is_refused(given, correlation, message):
    with pytest.raises(ValueError, match=message):
        fm.uncertainty(swinging(), 1.0, given, OUTPUTS, correlation=correlation)


def test_what_the_motion_leaves_open_has_no_share_and_is_said():
    """The load out of the plane of a loop of four hinges, beside one that is determined."""
    scene = mechanisms.four_bar()
    by = f"{scene.bodies[0].name}.mass_kg"
    found = fm.uncertainty(scene, 0.01, {by: 0.1}, ["loop.force.z", "loop.force.x"], samples=3)
    assert np.all(np.isnan(found.shares[:, 0])) and np.all(np.isnan(found.sigma[:, 0]))
    assert found.shares[-1, 1, 0] == pytest.approx(1.0)
    first, second, share = str(found).splitlines()
    assert first == "loop.force.z: not determined by the motion, because closures are redundant"
    assert second.startswith("loop.force.x: sigma at most") and share.endswith("100.0 %")
