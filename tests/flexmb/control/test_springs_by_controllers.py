"""Controllers that do what springs and dampers do: the same motion, energy and work, and the same linear model."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import flexmb as fm
from tests.flexmb.control.scenes import INERTIA, pendulum, rotor

ONE = fm.ProfileSensor(name="one", function=fm.Constant(value=1.0))
APART = fm.DistanceSensor(name="apart", marker_a="hip", marker_b="end")
STIFF, LOSSY, FREE = 12.0, 0.7, 0.5
ENDS: dict[str, Any] = {"position_a": (0.2, 0.1, 0.3), "position_b": (0.8, 0.0, 0.0), "free_length": FREE}
RUN: dict[str, Any] = {"t_end": 1.0, "samples": 11, "rtol": 1e-11, "atol": 1e-13}


def passive() -> fm.Scene:
    return pendulum().spring_damper("strut", "upper", "lower", stiffness=STIFF, damping=LOSSY, **ENDS).scene()


def active(stiffness: float = STIFF) -> fm.Scene:
    """An actuator along the same line, told by the distance of its ends and its rate."""
    gains = ((-stiffness, -LOSSY, STIFF * FREE),)
    law = fm.StateSpace(name="law", inputs=("apart", "one[0]"), D=gains)
    builder = pendulum(ONE, APART, law).marker("hip", "upper", offset=ENDS["position_a"])
    return builder.spring_damper("strut", "upper", "lower", force=fm.ControlSignal(source="law"), **ENDS).scene()


def test_an_actuator_told_by_a_distance_is_a_strut() -> None:
    """What its spring stores is its work, for nobody knows that a controller is a spring."""
    ours, springs = fm.simulate(active(), **RUN), fm.simulate(passive(), **RUN)
    assert np.max(np.abs(ours.q - springs.q)) <= 1e-9
    assert np.max(np.abs(ours.connectors["strut"] - springs.connectors["strut"])) <= 1e-8
    stored = springs.energy["spring"] - springs.energy["spring"][0]
    assert np.max(np.abs(ours.work - springs.work + stored)) <= 1e-8 and np.ptp(stored) > 0.1
    assert np.max(np.abs(ours.energy_drift)) <= 1e-9 * ours.energy_scale
    stiffer = fm.simulate(active(1.001 * STIFF), **RUN)
    assert np.max(np.abs(stiffer.q - springs.q)) > 1e-5


def test_and_has_the_strut_s_poles() -> None:
    found, expected = (np.sort_complex(fm.linearize(scene).eigenvalues) for scene in (active(), passive()))
    assert found == pytest.approx(expected, rel=1e-8)


TABLE = fm.GainTable(name="law", inputs=("angle",), points=(-1.0, 1.0), values=(3.0, -3.0))
GAIN = fm.StateSpace(name="gain", inputs=("angle",), D=((-3.0,),))


@pytest.mark.parametrize(("parts", "stiffness"), [
    ((TABLE,), 3.0),
    ((GAIN, fm.Saturation(name="law", inputs=("gain",), lower=-2.0, upper=2.0)), 3.0),
    ((GAIN, fm.Saturation(name="law", inputs=("gain",), lower=-0.1, upper=0.1)), 0.0),
], ids=["a table", "within limits", "at a limit"])  # fmt: skip
def test_slopes_of_tables_and_limits(parts: Any, stiffness: float) -> None:
    """J s^2 = -k: at a limit nothing holds the rotor."""
    A = fm.linearize(rotor(*parts)).A
    assert np.max(np.abs(A - [[0.0, 1.0], [-stiffness / INERTIA, 0.0]])) <= 1e-9
