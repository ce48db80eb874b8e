"""Derivatives by time at corners of functions of time: those of the side to which the function counts the instant.

A pulse has its value from its start, inclusive, to its end, exclusive: at both it is what follows. All other functions
are smooth enough for the derivatives of accelerations: also where they drive a coordinate, and their third derivative
enters.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flexmb as fm

BEGIN, LENGTH = 0.25, 0.5  # s, powers of two: the ends are exact
H = 2.0**-12
TABLE = fm.Table(times_s=tuple(np.linspace(-1.0, 2.0, 13)), values=tuple(np.sin(np.linspace(-2.0, 4.0, 13))))
FUNCTIONS = {
    "pulse": fm.Pulse(value=3.0, start_s=BEGIN, duration_s=LENGTH),
    "smooth step": fm.SmoothStep(start_value=0.2, end_value=1.4, start_s=BEGIN, duration_s=LENGTH),
    "spin up": fm.SpinUp(rate=2.0, duration_s=BEGIN + LENGTH),
    "sine": fm.Sine(amplitude=0.7, angular_frequency_rad_s=3.0),
    "table": TABLE,
}


def scene(driving: bool, function: fm.Function) -> fm.Scene:
    """Two arms: the function is the torque at the first hinge, or its angle; another is a force that stays in World."""
    moved = {"prescribed": function} if driving else {"torque": function}
    builder = (
        fm.SceneBuilder("timed", gravity=(0.0, 0.0, -9.81))
        .rigid_body("upper", mass=1.0, com=(0.5, 0.0, 0.0), inertia=(0.01, 0.1, 0.1))
        .rigid_body("lower", mass=0.5, com=(0.4, 0.1, 0.0), inertia=(0.01, 0.05, 0.05))
        .revolute("pivot", "ground", "upper", axis=(0.0, 1.0, 0.0), **moved)
        .revolute("elbow", "upper", "lower", axis=(0.0, 0.8, 0.6), angle=0.5, rate=0.3, parent_position=(1.0, 0.0, 0.0))
        .marker("end", "lower", offset=(0.8, 0.0, 0.0))
    )
    if not driving:
        builder.force("push", "lower", direction=(0.6, 0.0, 0.8), function=function)
    return builder.scene()


def one_sided(system: fm.System, state: fm.State, side: float) -> np.ndarray:
    """Extrapolated differences of third order of the accelerations, by instants on one side and the state's own."""

    def at(step: float) -> np.ndarray:
        t = state.t + side * step
        q, u = state.q.copy(), state.u.copy()
        return system.accelerations(replace(system.state(q, u), t=t))

    now = at(0.0)
    first = [(at(h) - now) / (side * h) for h in (H, 0.5 * H, 0.25 * H)]
    second = [2.0 * first[1] - first[0], 2.0 * first[2] - first[1]]
    return (4.0 * second[1] - second[0]) / 3.0


@pytest.mark.parametrize("t", [BEGIN, 0.4, BEGIN + LENGTH])
@pytest.mark.parametrize(("name", "driving"), [
    *((name, False) for name in FUNCTIONS), *((name, True) for name in FUNCTIONS if name != "pulse"),
])  # fmt: skip
def test_at_both_ends_and_between(name, driving, t):
    """From the right; of what has no jump also from the left."""
    system = fm.compile(scene(driving, FUNCTIONS[name]))
    state = replace(system.state(np.array([0.0, 0.5]), np.array([0.0, 0.3])), t=t)
    found = system.acceleration_derivatives(state).by_time
    sides = (1.0,) if name == "pulse" and t != 0.4 else (1.0, -1.0)
    for side in sides:
        expected = one_sided(system, state, side)
        assert np.max(np.abs(found - expected)) <= 1e-6 * max(np.max(np.abs(expected)), 1.0), side
    if name == "pulse":
        assert not found.any()
    elif t == 0.4:
        assert np.max(np.abs(found)) > 0.1


@pytest.mark.parametrize("t", [BEGIN, BEGIN + LENGTH])
def test_a_pulse_jumps_from_the_left(t):
    """The value at the instant is the one that follows, and so is everything observable."""
    system = fm.compile(scene(False, FUNCTIONS["pulse"]))
    state = replace(system.state(np.array([0.0, 0.5]), np.array([0.0, 0.3])), t=t)
    before, after = (system.accelerations(replace(state, t=t + step)) for step in (-H, H))
    assert np.array_equal(system.accelerations(state), after)
    assert np.max(np.abs(after - before)) > 1.0
    d = system.evaluation_derivatives(state)
    assert not d.loads["elbow"].by_time.any()
    assert not d.markers["end"].acceleration.by_time.any()
