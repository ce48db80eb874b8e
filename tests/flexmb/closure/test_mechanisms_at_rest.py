"""Driven mechanisms that stand still, or come to rest and turn back: rounding is all the speed they have there."""

from __future__ import annotations

import numpy as np
import pytest

import flexmb
from flexmb.scene import functions as f
from flexmb.tables.status import Status
from tests.flexmb.closure import mechanisms as m

SETTINGS = {
    "rk4": {"method": "rk4", "step": 0.025}, "coarse rk4": {"method": "rk4", "step": 0.1}, "dop853": {},
    "composite": {"algorithm": "composite"},
}  # fmt: skip


@pytest.mark.parametrize("settings", SETTINGS)
@pytest.mark.parametrize("crank", [1.0, 2.0, 4.0])
@pytest.mark.parametrize("swing", [0.5, -0.5])
def test_a_crank_that_turns_back(crank, swing, settings):
    """Steps end where it turns: closures neither open nor are singular there, however small the speed."""
    there = f.Sine(amplitude=swing, angular_frequency_rad_s=np.pi / 2.0, offset=crank)
    _stays_closed(crank, there, settings)


@pytest.mark.parametrize("settings", SETTINGS)
@pytest.mark.parametrize("crank", [1.0, 2.0, 4.0])
@pytest.mark.parametrize("swing", [0.5, -0.5])
def test_a_crank_that_rests_before_and_after(crank, swing, settings):
    """Where it rests pivots fall by rounding, and there is no speed to compare that with."""
    to = f.SmoothStep(start_value=crank, end_value=crank + swing, start_s=0.5, duration_s=1.0)
    _stays_closed(crank, to, settings)


def _stays_closed(crank: float, motion, settings: str) -> None:
    run = flexmb.simulate(m.four_bar(crank=crank, prescribed=motion), 3.0, samples=13, **SETTINGS[settings])
    assert run.status is Status.OK, run.message
    assert run.statistics.accepted_steps + run.statistics.rejected_steps < 500
    for q in run.q:
        coupler, rocker = m.GRASHOF.angles(q[0])
        assert np.sin(q[0] + q[1] - coupler) == pytest.approx(0.0, abs=1e-9)
        assert np.sin(q[2] - rocker) == pytest.approx(0.0, abs=1e-9)
