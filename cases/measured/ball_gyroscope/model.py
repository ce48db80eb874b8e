"""A ball on an air bearing: steady precession under weights on its rod, free nutation, turn of the momentary axis.

The ball is symmetric; a torque of imbalance acts along its figure axis as a mass at 0.1 m would.
"""

from functools import cache
from math import cos, pi, radians, sin

import numpy as np

import flexmb as fm

G, WEIGHT, HALF = 9.81, 9.85e-3, 0.0055  # m/s2; kg of a weight, and half its length (m)
TILT = radians(60.0)
TURN = 2.0 * pi / 60.0


def predict(points, inputs, effort):
    """Precession times (s), nutation rates (1/min), times of ten turns of the momentary axis (s)."""
    return [quantity(point.series, point.conditions, inputs, effort) for point in points]


def quantity(series, conditions, inputs, effort):
    """The prediction of one reading."""
    Iz, ratio = inputs["inertia"], inputs["ratio"]
    spin = conditions["spin_rpm"] * TURN
    if series == "precession":
        mean = 0.5 * (spin + conditions["spin_after_rpm"] * TURN)
        n = conditions["weights"]
        arm = conditions["arm_m"] + inputs["arm"] + HALF * n
        return precession_time(Iz, Iz / ratio, mean, n * WEIGHT, arm, inputs["imbalance"], effort)
    if series == "nutation":
        return nutation_rate(Iz, Iz / ratio, spin, effort)
    return ten_turns(Iz, Iz / ratio, spin, effort)


def spun(Iz, Ix, spin, t_end, effort, kick=0.0, precession=0.0, weights=()):
    """A run of the ball with masses on its figure axis."""
    rates = (kick, precession * sin(TILT), spin + precession * cos(TILT))
    builder = fm.SceneBuilder("ball gyroscope", gravity=(0.0, 0.0, -G))
    builder.rigid_body("ball", mass=1.0, inertia=(Ix, Ix, Iz))
    builder.spherical(
        "bearing", "ground", "ball", quaternion=(cos(TILT / 2), sin(TILT / 2), 0.0, 0.0), angular_velocity=rates
    )
    for i, (mass, place) in enumerate(weights):
        builder.rigid_body(f"weight {i}", mass=mass, inertia=(1e-9,) * 3)
        builder.weld(f"rod {i}", "ball", f"weight {i}", parent_position=(0.0, 0.0, place))
    builder.marker("axis", "ball", offset=(0.0, 0.0, 1.0))
    return fm.simulate(builder.scene(), t_end, samples=801, rtol=(1e-6, 1e-9)[effort], atol=(1e-9, 1e-12)[effort])


def slope(t, x, y):
    """Mean rate of the angle of (x, y)."""
    return abs(np.polyfit(t, np.unwrap(np.arctan2(y, x)), 1)[0])


@cache
def precession_time(Iz, Ix, spin, mass, arm, imbalance, effort):
    """Time of one turn (s)."""
    guess = (mass * G * arm + imbalance) / (Iz * spin)
    weights = ((imbalance / (G * 0.1), 0.1), (mass, arm))
    run = spun(Iz, Ix, spin, 2.0, effort, precession=guess, weights=weights)
    place = run.markers["axis"].position
    return 2.0 * pi / slope(run.t, place[:, 0], place[:, 1])


@cache
def nutation_rate(Iz, Ix, spin, effort):
    """Turns a minute of the figure axis about the angular momentum."""
    run = spun(Iz, Ix, spin, 2.0, effort, kick=0.02 * spin)
    place = run.markers["axis"].position
    left, sizes, _ = np.linalg.svd(place - place.mean(axis=0), full_matrices=False)
    return slope(run.t, left[:, 0] * sizes[0], left[:, 1] * sizes[1]) / TURN


@cache
def ten_turns(Iz, Ix, spin, effort):
    """Time (s) in which the momentary axis turns ten times in the ball."""
    run = spun(Iz, Ix, spin, 10.0, effort, kick=0.02 * spin)
    return 20.0 * pi / slope(run.t, run.u[:, 0], run.u[:, 1])
