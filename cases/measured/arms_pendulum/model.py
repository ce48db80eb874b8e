"""One, two and three arms swinging freely: rigid bodies on damped revolutes, from the first reading of each piece.

The readings are absolute angles, zero upright; the hinges' angles are relative.
"""

from functools import cache
from typing import NamedTuple

import numpy as np

import flexmb as fm

# Identified by the authors from other pieces: masses (kg), places of mass centres (m), lengths (m), inertias (kg m2),
# viscous frictions (Nms), gravity (m/s2).
ARMS = {
    1: ((0.1477549,), (0.14758457,), (), (1.0912e-4,), (2.2394e-4,), 9.8100131),
    2: (
        (0.0938439700, 0.137595970), (0.108565210, 0.116779020), (0.172719200,), (4.37530e-4, 1.26883e-3),
        (2.37140e-4, 1.0e-5), 9.80858023,
    ),
    3: (
        (0.258172, 0.27942778, 0.11862423), (0.15999993, 0.20293921, 0.18370874), (0.17279974, 0.2287),
        (1.0004e-4, 3.1416e-4, 1.6874e-4), (1.4771e-3, 2.5958e-4, 1.0e-5), 9.80834384,
    ),
}  # fmt: skip


def predict(points, inputs, effort):
    """Absolute angles (rad)."""
    return [swung.angles[time][arm] for time, arm, swung in runs(points, inputs, effort)]


def derivatives(points, inputs, effort):
    """Of the angles by all inputs."""
    found = list(runs(points, inputs, effort, exact=True))
    return {name: [swung.rates[name][time][arm] for time, arm, swung in found] for name in inputs}


def runs(points, inputs, effort, exact=False):
    """For each point its time, the number of its arm, and the run of its piece."""
    times, known = {}, {}
    for point in points:
        times.setdefault(point.conditions["piece"], set()).add(point.conditions["time_s"])
    for point in points:
        c = point.conditions
        if c["piece"] not in known:
            n = int(c["arms"])
            start = tuple(c[f"angle{i}"] + inputs["start angle"] for i in range(1, n + 1))
            rates = tuple(c[f"rate{i}"] + inputs[f"start rate {i}"] for i in range(1, n + 1))
            factors = (inputs["friction"], inputs["inertia"])
            known[c["piece"]] = swing(n, start, rates, tuple(sorted(times[c["piece"]])), *factors, effort, exact)
        yield c["time_s"], int(c["arm"]) - 1, known[c["piece"]]


class Swing(NamedTuple):
    """Absolute angles (n,) by time, and their derivatives (n,) by input and time."""

    angles: dict
    rates: dict


@cache
def swing(n, angles, rates, times, friction, inertia, effort, exact):
    """A run from absolute angles and rates; derivatives only if `exact`."""
    masses, centres, lengths, inertias, frictions, g = ARMS[n]
    builder = fm.SceneBuilder("arms", gravity=(0.0, -g, 0.0))
    for i in range(n):
        place = {"parent_position": (0.0, lengths[i - 1], 0.0)} if i else {}
        builder.rigid_body(f"arm {i}", mass=masses[i], com=(0.0, centres[i], 0.0), inertia=(inertia * inertias[i],) * 3)
        builder.revolute(
            f"hinge {i}", f"arm {i - 1}" if i else "ground", f"arm {i}", axis=(0.0, 0.0, 1.0),
            angle=angles[i] - (angles[i - 1] if i else 0.0), rate=rates[i] - (rates[i - 1] if i else 0.0),
            damping=friction * frictions[i], **place,
        )  # fmt: skip
    settings = {"samples": [0.0, *times], "rtol": (1e-6, 1e-9)[effort], "atol": (1e-8, 1e-11)[effort]}
    relative = [f"hinge {i}.rotation" for i in range(n)]
    if not exact:
        run = fm.simulate(builder.scene(), times[-1], **settings)
        names = [name for name, _ in run.q_names]
        return Swing(by_time(times, run.q[:, [names.index(name) for name in relative]]), {})
    numbers = {
        "start angle": {"hinge 0.rotation.angle_rad": 1.0},
        "friction": {f"hinge {i}.rotation.damping_Nms_rad": frictions[i] for i in range(n)},
        "inertia": {f"arm {i}.inertia_kg_m2.2.2": inertias[i] for i in range(n)},
    }
    for i in range(3):  # the rate of an arm is that of its hinge, less in the next one
        numbers[f"start rate {i + 1}"] = {
            f"hinge {k}.rotation.rate_rad_s": sign for k, sign in ((i, 1.0), (i + 1, -1.0)) if k < n and i < n
        }
    by = list(dict.fromkeys(path for paths in numbers.values() for path in paths))
    run = fm.sensitivities(builder.scene(), times[-1], by, relative, **settings)
    by_input = {
        name: sum((factor * run.derivatives[:, :, by.index(path)] for path, factor in paths.items()), 0.0 * run.values)
        for name, paths in numbers.items()
    }
    return Swing(by_time(times, run.values), {name: by_time(times, rates) for name, rates in by_input.items()})


def by_time(times, relative):
    """Sums (n,) along the chain by time, of what is given from t = 0."""
    return dict(zip(times, np.cumsum(relative[1:], axis=1), strict=True))
