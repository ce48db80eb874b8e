"""The error of a run by a second, tighter one: of the size of the true error, on every channel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flexmb as fm
from flexmb.run.channels import channels_of, distance


def double_pendulum() -> fm.Scene:
    bar = {"mass": 1.0, "com": (0.5, 0.0, 0.0), "inertia": (0.01, 0.1, 0.1)}
    return (
        fm.SceneBuilder("double pendulum", gravity=(0, -9.81, 0))
        .rigid_body("upper", **bar).rigid_body("lower", **bar)
        .revolute("a", "ground", "upper", angle=1.0)
        .revolute("b", "upper", "lower", parent_position=(1, 0, 0), angle=0.5)
        .marker("end", "lower", offset=(1, 0, 0))
        .scene()
    )  # fmt: skip


@pytest.fixture(scope="module")
def truth() -> dict[str, np.ndarray]:
    return channels_of(fm.simulate(double_pendulum(), 2.0, samples=21, rtol=1e-13, atol=1e-15))


@pytest.mark.parametrize(
    ("method", "settings", "low", "high"),
    [
        ("dop853", {"rtol": 1e-7, "atol": 1e-9}, 0.9, 1.1),
        ("rk4", {"step": 0.01}, 1.0, 1.35),
        ("generalised_alpha", {"step": 0.005}, 0.8, 1.2),
    ],
)
def test_it_is_the_error(method: str, settings: dict, low: float, high: float, truth: dict) -> None:
    run = fm.simulate(double_pendulum(), 2.0, method, samples=21, **settings)
    estimate, own = run.error_estimate(), channels_of(run)
    assert set(estimate) == set(own)
    for name, values in own.items():
        error = np.max(distance(name, values, truth[name]))
        if error > 1e-9:
            assert low * error < np.max(estimate[name]) < high * error, name


def test_a_second_run_that_stops_early_leaves_nan() -> None:
    """Only common times are compared; the end of the first run says nothing of itself."""
    run = fm.simulate(double_pendulum(), 1.0, samples=11, rtol=1e-6, atol=1e-8)
    assert run.made_by is not None
    again = run.made_by.again
    made_by = replace(run.made_by, again=lambda settings: again(replace(settings, max_steps=20)))
    short = replace(run, made_by=made_by).error_estimate()
    assert np.isnan(short["energy.total"][-1]) and np.isfinite(short["energy.total"][0])


def test_what_cannot_be_tighter_or_is_not_known_is_refused() -> None:
    run = fm.simulate(double_pendulum(), 0.1, samples=3, rtol=1e-13, atol=1e-15)
    with pytest.raises(ValueError, match="estimate the error of a run with rtol 2.2e-12 or more"):
        run.error_estimate()
    for other in (replace(run, made_by=None), replace(run, t=run.t + 1.0)):
        with pytest.raises(ValueError, match="one run as simulate made it"):
            other.error_estimate()
