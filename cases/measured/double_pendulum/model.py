"""Two arms whose masses are not given, swinging freely: rigid bodies on damped revolutes.

A motion depends on ratios of the inertias and first moments only: both arms have 1 kg here, and the centre of the
second is at 0.1 m. The centre of the first, inertias and frictions are what they would be then. The readings are
absolute angles, zero upright; the hinges' angles are relative.
"""

from functools import cache
from typing import NamedTuple

import numpy as np

import flexmb as fm

LENGTH, CENTRE, G = 0.1727192, 0.1, 9.80858023  # m, between the hinges; m; m/s2
HINGES = ("hinge 0.rotation", "hinge 1.rotation")
FITTED = {
    "centre 1": "arm 0.com_m.1", "inertia 1": "arm 0.inertia_kg_m2.2.2",
    "inertia 2": "arm 1.inertia_kg_m2.2.2", "friction 1": "hinge 0.rotation.damping_Nms_rad",
    "friction 2": "hinge 1.rotation.damping_Nms_rad",
}  # fmt: skip


def predict(points, inputs, effort):
    """Absolute angles (rad)."""
    return [swung.angles[time][arm] for time, arm, swung in runs(points, inputs, effort)]


def derivatives(points, inputs, effort):
    """Of the angles by all inputs; start rates of other pieces do not matter."""
    found = list(runs(points, inputs, effort, exact=True))
    return {
        name: [swung.rates[name][time][arm] if name in swung.rates else 0.0 for time, arm, swung in found]
        for name in inputs
    }


def runs(points, inputs, effort, exact=False):
    """For each point its time, the number of its arm, and the run of its piece."""
    times, known = {}, {}
    for point in points:
        times.setdefault(point.series, set()).add(point.conditions["time_s"])
    for point in points:
        if (piece := point.series) not in known:
            c = point.conditions
            angles = tuple(c[f"angle{i}"] + inputs[f"zero {i}"] for i in (1, 2))
            rates = tuple(c[f"rate{i}"] + inputs[f"rate {i}, {piece}"] for i in (1, 2))
            fitted = tuple(inputs[name] for name in FITTED)
            known[piece] = swing(piece, angles, rates, tuple(sorted(times[piece])), fitted, effort, exact)
        yield point.conditions["time_s"], int(point.conditions["arm"]) - 1, known[piece]


class Swing(NamedTuple):
    """Absolute angles (2,) by time, and their derivatives (2,) by input and time."""

    angles: dict
    rates: dict


@cache
def swing(piece, angles, rates, times, fitted, effort, exact):
    """A run from absolute angles and rates; derivatives only if `exact`."""
    c1, I1, I2, d1, d2 = fitted
    scene = (
        fm.SceneBuilder("double pendulum", gravity=(0.0, -G, 0.0))
        .rigid_body("arm 0", mass=1.0, com=(0.0, c1, 0.0), inertia=(I1,) * 3)
        .rigid_body("arm 1", mass=1.0, com=(0.0, CENTRE, 0.0), inertia=(I2,) * 3)
        .revolute("hinge 0", "ground", "arm 0", axis=(0.0, 0.0, 1.0), angle=angles[0], rate=rates[0], damping=d1)
        .revolute(
            "hinge 1", "arm 0", "arm 1", axis=(0.0, 0.0, 1.0), angle=angles[1] - angles[0], rate=rates[1] - rates[0],
            damping=d2, parent_position=(0.0, LENGTH, 0.0),
        )
        .scene()
    )  # fmt: skip
    settings = {"samples": [0.0, *times], "rtol": (1e-6, 1e-9)[effort], "atol": (1e-8, 1e-11)[effort]}
    if not exact:
        run = fm.simulate(scene, times[-1], **settings)
        names = [name for name, _ in run.q_names]
        return Swing(by_time(times, run.q[:, [names.index(name) for name in HINGES]]), {})
    numbers = {name: {path: 1.0} for name, path in FITTED.items()}
    for name, key in (("zero {}", "angle_rad"), (f"rate {{}}, {piece}", "rate_rad_s")):
        first, second = (f"{hinge}.{key}" for hinge in HINGES)  # relative: what turns arm 1 leaves arm 2 where it is
        numbers |= {name.format(1): {first: 1.0, second: -1.0}, name.format(2): {second: 1.0}}
    by = list(dict.fromkeys(path for paths in numbers.values() for path in paths))
    run = fm.sensitivities(scene, times[-1], by, HINGES, **settings)
    changes = {
        name: sum(factor * run.derivatives[:, :, by.index(path)] for path, factor in paths.items())
        for name, paths in numbers.items()
    }
    return Swing(by_time(times, run.values), {name: by_time(times, change) for name, change in changes.items()})


def by_time(times, relative):
    """Sums (2,) along the chain by time, of what is given from t = 0."""
    return dict(zip(times, np.cumsum(relative[1:], axis=1), strict=True))
