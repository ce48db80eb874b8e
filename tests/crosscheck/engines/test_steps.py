"""Default steps follow the run's duration and the scene's fastest motion, from 1 ms to 1000 s, from 1 Hz to 10 kHz."""

from __future__ import annotations

import numpy as np
import pytest

from crosscheck.engines.checked import CheckedEngine
from crosscheck.engines.contract import Effort
from crosscheck.engines.pace import Pace
from crosscheck.engines.registry import engine
from crosscheck.engines.steps import FINE, LEAST, MOST, TURN, VIBRATION, ladder
from flexmb.scene.build import SceneBuilder
from flexmb.scene.schema import Scene

ENGINES = ("native-generalised-alpha", "mujoco", "exudyn")
PER_PERIOD = 20  # steps by which a period is resolved


def pendulum() -> tuple[Scene, float]:
    """With its frequency (Hz), of a point mass on an arm of 1 m."""
    scene = (
        SceneBuilder("pendulum", gravity=(0.0, 0.0, -9.81))
        .rigid_body("bob", mass=1.0, com=(1.0, 0.0, 0.0), inertia=(1e-6, 1e-6, 1e-6))
        .revolute("pivot", "ground", "bob", axis=(0.0, 1.0, 0.0))
    )
    return scene.scene(), np.sqrt(9.81) / (2.0 * np.pi)


def oscillator(hertz: float) -> tuple[Scene, float]:
    scene = (
        SceneBuilder("oscillator")
        .rigid_body("mass", mass=2.0, inertia=(1.0, 1.0, 1.0))
        .prismatic("rail", "ground", "mass", axis=(1.0, 0.0, 0.0), stiffness=2.0 * (2.0 * np.pi * hertz) ** 2)
    )
    return scene.scene(), hertz


@pytest.mark.parametrize("name", ENGINES)
@pytest.mark.parametrize("duration_s", [1e-3, 1.0, 1000.0])
@pytest.mark.parametrize("made", [pendulum(), oscillator(1.0), oscillator(1e4)], ids=["pendulum", "1 Hz", "10 kHz"])
def test_steps_resolve_the_fastest_motion(name: str, duration_s: float, made: tuple[Scene, float]) -> None:
    scene, hertz = made
    steps = [effort.value for effort in CheckedEngine(engine(name), duration_s=duration_s).efforts(scene)]
    assert duration_s / steps[0] >= 200 and duration_s / steps[-1] <= MOST * (1.0 + 1e-12)
    assert np.allclose(np.divide(steps[:-1], steps[1:]), 2.0, rtol=1e-15)
    if hertz * duration_s * PER_PERIOD <= MOST:  # 10 kHz over 1000 s is beyond every default
        assert hertz * steps[-1] <= 1.0 / PER_PERIOD


def test_more_is_taken_where_it_costs_little() -> None:
    """About 10 s of something slow: the fine angle of whatever is fastest, be it a mode."""
    for slow in (Pace(2.0, 0.0), Pace(0.0, 2.0), Pace(0.0, 0.0, 2.0)):
        assert FINE / 5.0 < 2.0 * ladder("rk4", slow, 10.0, 3)[0].value <= FINE


def test_modes_are_stepped_over_where_they_would_cost_too_much() -> None:
    stiff = ladder("rk4", Pace(1.0, 0.0, 1e6), 10.0, 3, usual=5000)
    assert [effort.value for effort in stiff] == [2e-3, 1e-3, 5e-4]


def test_motion_and_springs_are_followed_whatever_it_costs() -> None:
    assert ladder("rk4", Pace(1e3, 0.0), 10.0, 3)[0].value <= TURN / 1e3
    assert ladder("rk4", Pace(0.0, 1e4), 10.0, 3)[0].value <= VIBRATION / 1e4


def test_what_does_not_move_takes_the_least_steps() -> None:
    assert ladder("rk4", Pace(0.0, 0.0), LEAST * 0.5, 3) == tuple(Effort("step", h, "rk4") for h in (0.5, 0.25, 0.125))


class Older:
    """An engine of the first contract: its efforts know no duration."""

    name = "older"

    def efforts(self, scene: Scene) -> tuple[Effort, ...]:
        return tuple(Effort("step", value, "rk4") for value in (4e-3, 2e-3, 1e-3))


def test_an_engine_without_durations_is_asked_as_before() -> None:
    scene, _ = pendulum()
    assert CheckedEngine(Older(), duration_s=1e3).efforts(scene)[0].value == 4e-3  # type: ignore[arg-type]
