"""A racket in free flight: the times at which its rate about the unstable axis changes sign, from the first rates.

Axes: x in the plane of the strings across the handle (the unstable one), y along the handle, z across the plane. The
racket turns about its mass centre, and the air's torque is that of a damper.
"""

from functools import cache

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline

import flexmb as fm

NUMBERS = (
    "racket.inertia_kg_m2.0.0", "racket.inertia_kg_m2.1.1", "racket.inertia_kg_m2.2.2",
    *(f"flight.angular_velocity_rad_s.{i}" for i in range(3)),
)  # fmt: skip
START = NUMBERS[3:]
RATES = tuple(f"flight.angular_velocity.{axis}" for axis in "xyz")
AXES = np.eye(3)


def predict(points, inputs, effort):
    """Times (s) after the first reading."""
    return [value for value, _ in answers(points, inputs, effort, exact=False)]


def derivatives(points, inputs, effort):
    """Of the times by all inputs."""
    found = [rates for _, rates in answers(points, inputs, effort, exact=True)]
    return {name: [rates[name] for rates in found] for name in inputs}


def answers(points, inputs, effort, exact):
    """A time and its derivatives for each point."""
    for point in points:
        c = point.conditions
        first = tuple(c[name] for name in ("wx", "wy", "wz"))
        count = max(p.conditions["flip"] for p in points if p.conditions["throw"] == c["throw"])
        yield flips(first, int(count), tuple(inputs.items()), effort, exact)[int(c["flip"]) - 1]


@cache
def flips(first, count, items, effort, exact):
    """The first flips of a throw, each with its derivatives by the inputs (none unless `exact`)."""
    inputs = dict(items)
    offset = np.array([inputs[f"offset {axis}"] for axis in "xyz"])
    turn = np.array([inputs[f"turned about {axis}"] for axis in "xyz"])
    measured = np.array(first) + offset
    start = measured + np.cross(turn, measured)
    Iy, Iz = inputs["inertia y"], inputs["inertia z"]
    inertia = np.array([Iz - Iy + inputs["thickness"], Iy, Iz])
    scene = (
        fm.SceneBuilder("racket", gravity=(0.0, 0.0, 0.0))
        .rigid_body("racket", mass=0.457, inertia=tuple(inertia))
        .spherical("flight", "ground", "racket", angular_velocity=tuple(start))
        .scene()
    )
    settings = {"samples": 801, "rtol": (1e-6, 1e-9)[effort], "atol": (1e-8, 1e-11)[effort]}
    if exact:
        run = fm.sensitivities(scene, 2.0, NUMBERS, RATES, **settings)
        w, by_number = run.values, run.derivatives
    else:
        run, by_number = fm.simulate(scene, 2.0, **settings), None
        w = run.u
    slope = np.cross(w * inertia, w) / inertia  # Euler's equations
    seen = CubicHermiteSpline(run.t, (w - np.cross(turn, w))[:, 0], (slope - np.cross(turn, slope))[:, 0])
    times = seen.roots(extrapolate=False)[:count]
    if not exact:
        return [(t, {}) for t in times]
    by_input = {
        "inertia y": {NUMBERS[0]: -1.0, NUMBERS[1]: 1.0}, "inertia z": {NUMBERS[0]: 1.0, NUMBERS[2]: 1.0},
        "thickness": {NUMBERS[0]: 1.0},
    }  # fmt: skip
    by_input |= {
        f"offset {axis}": dict(zip(START, AXES[i] + np.cross(turn, AXES[i]), strict=True))
        for i, axis in enumerate("xyz")
    }
    by_input |= {
        f"turned about {axis}": dict(zip(START, np.cross(AXES[i], measured), strict=True))
        for i, axis in enumerate("xyz")
    }
    found = [(t, {}) for t in times]
    for name, numbers in by_input.items():
        moved = sum(by_number[:, :, NUMBERS.index(number)] * factor for number, factor in numbers.items())
        rate = (moved - np.cross(turn, moved))[:, 0]
        if name.startswith("turned"):
            rate = rate - np.cross(AXES["xyz".index(name[-1])], w)[:, 0]
        change = CubicSpline(run.t, rate)
        for t, rates in found:
            rates[name] = float(-change(t) / seen(t, 1))
    return found
