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


INPUTS = ("inertia", "ratio", "imbalance", "arm")


def predict(points, inputs, effort):
    """Precession times (s), nutation rates (1/min), times of ten turns of the momentary axis (s)."""
    return [quantity(point.series, point.conditions, inputs, effort)[0] for point in points]


def derivatives(points, inputs, effort):
    """Of all three by all inputs."""
    found = [quantity(point.series, point.conditions, inputs, effort, True)[1] for point in points]
    return dict(zip(INPUTS, np.transpose(found), strict=True))


def quantity(series, conditions, inputs, effort, exact=False):
    """The prediction of one reading, and its derivatives (4,)."""
    Iz, ratio = inputs["inertia"], inputs["ratio"]
    spin = conditions["spin_rpm"] * TURN
    if series == "precession":
        mean = 0.5 * (spin + conditions["spin_after_rpm"] * TURN)
        n = conditions["weights"]
        arm = conditions["arm_m"] + inputs["arm"] + HALF * n
        return precession_time(Iz, ratio, mean, n * WEIGHT, arm, inputs["imbalance"], effort, exact)
    if series == "nutation":
        return nutation_rate(Iz, ratio, spin, effort, exact)
    return ten_turns(Iz, ratio, spin, effort, exact)


def spun(Iz, ratio, rates, t_end, effort, of, weights=(), by_input=None):
    """Times, outputs (T,K) of a run of the ball with masses on its figure axis, and their derivatives (T,K,4).

    `by_input`: numbers of the scene with their derivatives (4,), in addition to the inertias of the ball.
    """
    builder = fm.SceneBuilder("ball gyroscope", gravity=(0.0, 0.0, -G))
    builder.rigid_body("ball", mass=1.0, inertia=(Iz / ratio, Iz / ratio, Iz))
    builder.spherical(
        "bearing", "ground", "ball", quaternion=(cos(TILT / 2), sin(TILT / 2), 0.0, 0.0), angular_velocity=rates
    )
    for i, (mass, place) in enumerate(weights):
        builder.rigid_body(f"weight {i}", mass=mass, inertia=(1e-9,) * 3)
        builder.weld(f"rod {i}", "ball", f"weight {i}", parent_position=(0.0, 0.0, place))
    builder.marker("axis", "ball", offset=(0.0, 0.0, 1.0))
    settings = {"samples": 801, "rtol": (1e-6, 1e-9)[effort], "atol": (1e-9, 1e-12)[effort]}
    if by_input is None:
        run = fm.simulate(builder.scene(), t_end, **settings)
        columns = {name: values for name, _, values in run.columns()}
        return run.t, np.column_stack([columns[name] for name in of]), np.zeros((len(run.t), len(of), len(INPUTS)))
    across = np.array([1.0 / ratio, -Iz / ratio**2, 0.0, 0.0])
    inertia = {f"ball.inertia_kg_m2.{i}.{i}": row for i, row in enumerate((across, across, np.eye(4)[0]))}
    numbers = inertia | by_input
    run = fm.sensitivities(builder.scene(), t_end, list(numbers), of, **settings)
    return run.t, run.values, run.derivatives @ np.array(list(numbers.values()))


def slope(t, x, y, dx, dy):
    """Mean rate of the angle of (x, y), and its derivatives by those of x and y (T,4)."""
    from_middle = t - np.mean(t)
    weights = from_middle / np.sum(from_middle**2)
    rate = weights @ np.unwrap(np.arctan2(y, x))
    turned = (x[:, None] * dy - y[:, None] * dx) / (x**2 + y**2)[:, None]
    return abs(rate), np.sign(rate) * (weights @ turned)


@cache
def precession_time(Iz, ratio, spin, mass, arm, imbalance, effort, exact):
    """Time of one turn (s)."""
    guess = (mass * G * arm + imbalance) / (Iz * spin)
    by_guess = np.array([-guess / Iz, 0.0, 1.0 / (Iz * spin), mass * G / (Iz * spin)])
    of_imbalance, of_arm = np.eye(4)[2:]
    by_input = {
        "weight 0.mass_kg": of_imbalance / (G * 0.1), "rod 1.parent_position_m.2": of_arm,
        "bearing.angular_velocity_rad_s.1": sin(TILT) * by_guess,
        "bearing.angular_velocity_rad_s.2": cos(TILT) * by_guess,
    }  # fmt: skip
    rates, of = (0.0, guess * sin(TILT), spin + guess * cos(TILT)), ("axis.position.x", "axis.position.y")
    weights = ((imbalance / (G * 0.1), 0.1), (mass, arm))
    t, place, moved = spun(Iz, ratio, rates, 2.0, effort, of, weights, by_input if exact else None)
    return times(2.0 * pi, *slope(t, *place.T, moved[:, 0], moved[:, 1]))


@cache
def nutation_rate(Iz, ratio, spin, effort, exact):
    """Turns a minute of the figure axis about the angular momentum."""
    rates = np.array([0.02 * spin, 0.0, spin])
    of = tuple(f"axis.position.{axis}" for axis in "xyz")
    t, place, moved = spun(Iz, ratio, tuple(rates), 2.0, effort, of, by_input={} if exact else None)
    turn = np.array([[1.0, 0.0, 0.0], [0.0, cos(TILT), -sin(TILT)], [0.0, sin(TILT), cos(TILT)]])
    momentum = turn @ (rates * (1.0 / ratio, 1.0 / ratio, 1.0))  # by Iz
    by_ratio = turn @ (rates * (-1.0 / ratio**2, -1.0 / ratio**2, 0.0))
    size = np.linalg.norm(momentum)
    along = momentum / size
    dalong = np.outer((by_ratio - along * (along @ by_ratio)) / size, np.eye(4)[1])  # (3,4)
    aside = np.cross((1.0, 0.0, 0.0), along)
    wide = np.linalg.norm(aside)
    e1 = aside / wide
    daside = np.cross((1.0, 0.0, 0.0), dalong, axisb=0, axisc=0)
    de1 = (daside - np.outer(e1, e1 @ daside)) / wide
    e2, de2 = np.cross(along, e1), np.cross(dalong, e1, axisa=0, axisc=0) + np.cross(along, de1, axisb=0, axisc=0)
    dx, dy = (place @ de + np.einsum("tki,k->ti", moved, e) for e, de in ((e1, de1), (e2, de2)))
    rate, by_input = slope(t, place @ e1, place @ e2, dx, dy)
    return rate / TURN, by_input / TURN


@cache
def ten_turns(Iz, ratio, spin, effort, exact):
    """Time (s) in which the momentary axis turns ten times in the ball."""
    of = ("bearing.angular_velocity.x", "bearing.angular_velocity.y")
    t, rates, moved = spun(Iz, ratio, (0.02 * spin, 0.0, spin), 10.0, effort, of, by_input={} if exact else None)
    return times(20.0 * pi, *slope(t, *rates.T, moved[:, 0], moved[:, 1]))


def times(turned, rate, by_input):
    """The time of an angle at a rate, and its derivatives."""
    return turned / rate, -turned / rate**2 * by_input
