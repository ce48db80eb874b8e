"""Identification from measurements: true values are found within their sigmas, what cannot be found is named."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from scipy.stats import binom, chi2

import flexmb as fm
from flexmb.ready import scenes
from flexmb.scene.shapes import beam_section, cuboid_inertia
from flexmb.sensitivity.measurements import measurements
from tests.flexmb.closure import mechanisms

LOOSE = {"rtol": 1e-8, "atol": 1e-10}  # far below the noise
CHANNELS = ("tip.acceleration.y", "attitude.rotation")
NOISE = {"tip.acceleration.y": 1e-3, "attitude.rotation": 1e-4}
TRUTH = {
    "panel.stations.*.EIz_Nm2": 295.0,
    "panel.modes.damping_ratio": 0.012,
    "attitude.rotation.stiffness_Nm_rad": 19.0,
    "attitude.rotation.damping_Nms_rad": 1.2,
}


def panel() -> fm.schema.Scene:
    """A flexible panel on a hub that is turned against a spring, and rings down."""
    section = beam_section(E=7e10, G=2.7e10, A=2e-4, Iy=2e-9, Iz=4e-9, rho=2700)
    modes = fm.Modes(count=2, families=("bending_y",), damping_ratio=0.01)
    return (
        fm.SceneBuilder("panel")
        .rigid_body("hub", mass=100.0, inertia=cuboid_inertia(100.0, (1.0, 1.0, 1.0)))
        .beam("panel", length=4.0, elements=8, section=section, modes=modes)
        .revolute("attitude", "ground", "hub", axis=(0, 0, 1), rate=0.05, stiffness=20.0, damping=1.0)
        .weld("yoke", "hub", "panel", parent_position=(0.5, 0.0, 0.0))
        .marker("tip", "panel", node="tip")
        .scene()
    )


def measured(seed: int, run: fm.Trajectory) -> dict[str, np.ndarray]:
    """The channels of a run with noise."""
    rng, found = np.random.default_rng(seed), {name: values for name, _, values in run.columns()}
    return {"t": run.t, **{name: found[name] + NOISE[name] * rng.standard_normal(len(run.t)) for name in CHANNELS}}


@pytest.fixture(scope="module")
def ring_down() -> fm.Trajectory:
    return fm.simulate(panel().with_values(TRUTH), 6.0, samples=121, **LOOSE)


def distance(found: fm.Fit) -> float:
    """The square of the distance from the truth in the metric of the covariance: chi-square of four degrees."""
    off = found.values - np.array(list(TRUTH.values()))
    return float(off @ np.linalg.solve(found.covariance, off))


def test_four_parameters_of_a_ring_down(ring_down):
    found = fm.fit(panel(), measured(1, ring_down), list(TRUTH), sigma=NOISE, **LOOSE)
    assert found.parameters == tuple(TRUTH) and not found.unidentifiable
    assert distance(found) < chi2.ppf(0.999, 4)
    assert chi2.ppf(1e-3, found.freedom) < found.chi_square < chi2.ppf(0.999, found.freedom)
    assert np.allclose(np.diag(found.correlation), 1.0) and found.trajectory.finished
    assert "panel.modes.damping_ratio" in str(found) and "degrees of freedom" in str(found)


def test_noise_is_estimated_where_it_is_not_given(ring_down):
    found = fm.fit(panel(), measured(2, ring_down), list(TRUTH), **LOOSE)
    given = np.array([NOISE[name] for name in found.channels])
    # The estimate of a sigma from n values has the relative standard deviation 1/sqrt(2 n): four of these.
    assert np.all(np.abs(found.noise / given - 1.0) < 4.0 / np.sqrt(2.0 * len(found.t)))
    assert found.estimated and distance(found) < chi2.ppf(0.999, 4)


@pytest.mark.slow
def test_true_values_lie_within_the_sigmas_in_as_many_of_a_hundred_fits_as_they_should(ring_down):
    """Distances are distributed as chi-square of four degrees: 95 of a hundred lie within its 95 % quantile, give or
    take the binomial spread; and single parameters within two sigmas in 95.4 of a hundred."""
    inside, within = 0, np.zeros(4, int)
    for seed in range(100):
        found = fm.fit(panel(), measured(100 + seed, ring_down), list(TRUTH), sigma=NOISE, **LOOSE)
        inside += distance(found) < chi2.ppf(0.95, 4)
        within += np.abs(found.values - np.array(list(TRUTH.values()))) < 2.0 * found.sigma
    assert binom.ppf(1e-3, 100, 0.95) <= inside
    assert np.all(binom.ppf(1e-3, 100, 0.9545) <= within)


def test_a_wrong_model_shows_in_chi_square(ring_down):
    """Negative control: with a damping of the panel that is wrong and not fitted, what is left is no noise."""
    names = [name for name in TRUTH if name != "panel.modes.damping_ratio"]
    scene = panel().with_values({"panel.modes.damping_ratio": 0.03})
    found = fm.fit(scene, measured(1, ring_down), names, sigma=NOISE, **LOOSE)
    assert found.chi_square > chi2.ppf(0.999, found.freedom)


def test_what_measurements_do_not_tell_is_named(ring_down):
    """The ratio of stiffness and inertia alone sets a frequency, and inertia about another axis has no effect."""
    scene = scenes.pendulum().scene().with_values({"gravity_m_s2.1": 0.0, "pivot.rotation.angle_rad": 0.2})
    run = fm.simulate(scene, 3.0, samples=31)
    data = {"t": run.t, "pivot.rotation": run.q[:, 0]}
    found = fm.fit(scene, data, ["pivot.rotation.stiffness_Nm_rad", "bob.mass_kg"], sigma=1e-3, **LOOSE)
    assert found.unidentifiable == () or set(found.unidentifiable) == {"pivot.rotation.stiffness_Nm_rad", "bob.mass_kg"}
    both = fm.fit(scene, data, ["pivot.rotation.stiffness_Nm_rad", "bob.inertia_kg_m2.0.0"], sigma=1e-3, **LOOSE)
    assert both.unidentifiable == ("bob.inertia_kg_m2.0.0",)
    assert np.isinf(both.sigma[1]) and np.isfinite(both.sigma[0]) and "not identifiable" in str(both)


def test_files_and_gaps(tmp_path, ring_down):
    data = measured(3, ring_down)
    path = tmp_path / "ringdown.csv"
    ring_down.to_csv(path)
    whole = measurements(path)
    assert whole.t[-1] == 6.0 and "tip.acceleration.y" in whole.channels
    lines = ["t [s],attitude.rotation [rad],tip.acceleration.y [m/s^2]"]
    rows = zip(data["t"], data["attitude.rotation"], data["tip.acceleration.y"], strict=True)
    lines += [f"{t},{angle}," + (f"{a}" if i % 2 else "") for i, (t, angle, a) in enumerate(rows)]
    path.write_text("\n".join(lines[:1] + lines[3:]) + "\n")  # the first times were not measured
    found = fm.fit(
        panel(), path, list(TRUTH)[:2], sigma=NOISE, bounds={"panel.modes.damping_ratio": (0.0, 0.1)}, **LOOSE
    )
    assert found.channels == ("attitude.rotation", "tip.acceleration.y") and len(found.t) == 119
    assert np.sum(np.isfinite(found.residuals)) == 119 + 59 + (119 % 2 == 0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"data": {"pivot.rotation": [0.0, 1.0]}}, 'no column "t"'),
        ({"data": {"t": [0.0, 1.0]}}, "no channels"),
        ({"data": {"t": [1.0, 0.0], "pivot.rotation": [0.0, 1.0]}}, "increase"),
        ({"data": {"t": [0.0, 1.0], "pivot.rotation": [0.0]}}, "shape"),
        ({"data": {"t": [0.0, 1.0], "pivot.rotation": [np.nan, np.nan]}}, "no values"),
        ({"data": {"t": [0.0, 1.0], "pivot.rotatio": [0.0, 1.0]}}, "no channel"),
        ({"sigma": 0.0}, "positive"),
        ({"sigma": {"pivot": 1.0}}, "no channel"),
        ({"bounds": {"bob.mass": (0.0, 1.0)}}, "not fitted"),
        ({"bounds": {"bob.mass_kg": (2.0, 3.0)}}, "search starts"),
        ({"bounds": {"bob.mass_kg": (3.0, 2.0)}}, "lower one"),
        ({"max_runs": 0}, "max_runs is 0: at least 1 is needed"),
    ],
)
def test_bad_input_is_refused(change, message):
    given = {"data": {"t": [0.0, 0.1, 0.2], "pivot.rotation": [0.0, 0.0, 0.0]}} | change
    with warnings.catch_warnings(), pytest.raises(ValueError, match=message):
        warnings.simplefilter("ignore")
        fm.fit(scenes.pendulum().scene(), given.pop("data"), ["bob.mass_kg"], **given)


@pytest.mark.parametrize("runs", [0.5, np.nan, 3.0, True, "3", None])
def test_the_number_of_runs_is_a_whole_number(runs):
    """Others were compared with the number of runs made, and a search never ended."""
    data = {"t": [0.0, 0.1, 0.2], "pivot.rotation": [0.0, 0.0, 0.0]}
    with pytest.raises(TypeError, match="max_runs is .*: give a whole number"):
        fm.fit(scenes.pendulum().scene(), data, ["bob.mass_kg"], max_runs=runs)


def test_measurements_of_what_the_motion_leaves_open_are_refused_by_name():
    """Of the loop's own two loads; SciPy said "Residuals are not finite in the initial point"."""
    scene, t = mechanisms.four_bar(), [0.0, 0.005, 0.01]
    by = [f"{scene.bodies[0].name}.mass_kg"]
    with pytest.raises(fm.DynamicsError, match='"loop.force.z" is not determined .*: take other outputs'):
        fm.fit(scene, {"t": t, "loop.force.z": [1.0, 1.0, 1.0]}, by)
    told = [values for name, _, values in fm.simulate(scene, 0.01, samples=t).columns() if name == "loop.force.x"]
    assert fm.fit(scene, {"t": t, "loop.force.x": told[0]}, by).values[0] == pytest.approx(scene.bodies[0].mass_kg)
