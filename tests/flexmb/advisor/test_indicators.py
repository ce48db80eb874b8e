"""Predictions from the rigid run against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

import flexmb as fm
from flexmb.advisor.indicators import indicators, predicted
from flexmb.advisor.modal_response import _oscillators, modal_response, rigid_run
from flexmb.advisor.models import BodyModel
from tests.flexmb.advisor.scenes import LENGTH, loaded, spun, turned

EI = 12.0
SCALE = {"marker:tip.position": LENGTH}


def seen(scene: fm.Scene, t_end: float, samples: int = 401):
    run = rigid_run(scene, np.linspace(0.0, t_end, samples))
    assert not isinstance(run, str), run
    response = modal_response(run, scene, scene.bodies[0])
    return response, indicators(run, scene, response, SCALE)


def test_oscillators_follow_a_ramp_exactly() -> None:
    """etadd + w^2 eta = a t from rest: eta = a (t - sin(w t)/w) / w^2."""
    times, w, a = np.linspace(0.0, 2.0, 41), np.array([3.0, 40.0]), 2.5
    force = np.outer(times, [a, a])
    eta, etad = _oscillators(w, np.zeros(2), force, times, np.zeros((2, 2)))
    t = times[:, None]
    assert_allclose(eta, a * (t - np.sin(w * t) / w) / w**2, atol=1e-14)
    assert_allclose(etad, a * (1.0 - np.cos(w * t)) / w**2, atol=1e-13)


def test_a_slow_tip_force_deflects_as_statics_says() -> None:
    """P L^3 / 3 EI at the tip; the first mode's part of it is 0.9707 (12 / beta^4 of a cantilever)."""
    force = 0.01
    scene = loaded(fm.SmoothStep(start_value=0.0, end_value=force, start_s=0.0, duration_s=20.0), (0.0, 1.0, 0.0))
    response, body = seen(scene, 20.0)
    tip = force * LENGTH**3 / (3.0 * EI)
    assert body.flexibility == pytest.approx(tip, rel=1e-3)
    assert body.static[0] == pytest.approx(12.0 / 1.875104069**4 * tip, rel=1e-3)
    assert body.dynamic[0] < 0.01 * body.static[0]
    assert predicted(BodyModel("rigid"), body) == body.flexibility
    left = body.static[1:].sum() + body.shortening
    assert predicted(BodyModel("modes", 1, "full"), body) == pytest.approx(left, rel=1e-3)


def test_compression_is_measured_in_buckling_loads() -> None:
    """One mode puts the tip load of buckling at 1.078 of Euler's: kappa is -P / (1.078 P_Euler)."""
    euler = np.pi**2 * EI / (4.0 * LENGTH**2)
    _, body = seen(loaded(fm.Constant(value=0.25 * euler), (-1.0, 0.0, 0.0)), 0.5)
    assert -body.compression == pytest.approx(0.25 / 1.078, rel=1e-3)


def test_spin_softens_and_stiffens_as_the_rotating_beam_does() -> None:
    """(rate / omega_1)^2, and Southwell's coefficients 1.1933 and 6.478 of it of axial force, hub radius 0."""
    rate, first = 10.0, 3.516015 * np.sqrt(EI / 0.27)
    _, body = seen(spun(rate, 2.0), 2.2)
    assert body.spin == pytest.approx((rate / first) ** 2, rel=1e-3)
    southwell = 1.1933 * rate**2 / first**2
    second = 6.478 * rate**2 / (22.034492 * np.sqrt(EI / 0.27)) ** 2
    assert body.stiffening == pytest.approx(max(southwell, second), rel=2e-3)


def test_past_the_critical_speed_what_does_not_stiffen_is_predicted_to_fail() -> None:
    _, body = seen(spun(30.0, 2.0), 2.2)
    assert body.spin > 1.0
    for level in ("linear", "full"):
        assert predicted(BodyModel("modes", 3, level), body) == np.inf
    assert predicted(BodyModel("modes", 3, "stiffened"), body) < 1.0


def test_a_family_that_is_left_out_counts_with_all_its_modes() -> None:
    scene = turned(1.0, 0.5, planes=("bending_y", "bending_z"))
    run = rigid_run(scene, np.linspace(0.0, 1.0, 201))
    body = indicators(run, scene, modal_response(run, scene, scene.bodies[0]), SCALE)
    families = (), ("bending_y",), ("bending_z",)
    both, bent, idle = (predicted(BodyModel("modes", 2, "full", False, some), body) for some in families)
    assert bent < both < idle
    assert idle == pytest.approx(predicted(BodyModel("modes", 0, "full", False, ("bending_z",)), body))
