"""Bodies leave stops again, whatever the tolerance: what is exact on the stop must not carry steps beyond it."""

import numpy as np
import pytest

import flexmb as fm
from flexmb.integrate.catalogue import INTEGRATORS

ADAPTIVE = [name for name, integrator in INTEGRATORS.items() if integrator.linearises and not integrator.fixed]
MASS, STIFFNESS, HEIGHT, G = 2.0, 1e6, 0.5, 9.81


def falling() -> fm.Scene:
    """A ball on a vertical rail, over a stop without dissipation."""
    return (
        fm.SceneBuilder("drop", gravity=(0.0, 0.0, -G))
        .rigid_body("ball", mass=MASS, inertia=(1.0, 1.0, 1.0))
        .prismatic("rail", "ground", "ball", axis=(0, 0, 1), position=HEIGHT)
        .linear_spring("floor", "rail", lower=0.0, stop_stiffness=STIFFNESS, stop_dissipation=0.0)
        .scene()
    )


def height(t: float) -> float:
    """Closed form: free fall, and vibration about the depth at which the stop carries the ball, in turns."""
    fall, speed = np.sqrt(2.0 * HEIGHT / G), np.sqrt(2.0 * G * HEIGHT)
    frequency, sag = np.sqrt(STIFFNESS / MASS), G * MASS / STIFFNESS
    contact = (2.0 * np.pi - 2.0 * np.arctan2(speed / frequency, sag)) / frequency
    since = (t - fall) % (2.0 * fall + contact)
    if since < contact:
        return float(sag * (np.cos(frequency * since) - 1.0) - speed / frequency * np.sin(frequency * since))
    return float(speed * (since - contact) - 0.5 * G * (since - contact) ** 2)


@pytest.mark.parametrize("method", ADAPTIVE)
def test_a_ball_leaves_the_stop(method: str) -> None:
    """After two contacts. 200 tolerances had errors of at most 24 rtol; a ball that sticks is 0.1 m off."""
    system = fm.compile(falling())
    for rtol in np.logspace(-3, -8, 100):
        run = fm.simulate(system, 1.0, method, rtol=rtol, atol=1e-2 * rtol, samples=2)
        assert run.finished and abs(run.q[-1, 0] - height(1.0)) < 100.0 * rtol
    assert abs(height(1.0) + 0.0044) > 0.1
