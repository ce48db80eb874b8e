"""One, two and three arms swinging freely: rigid bodies on damped revolutes, from the first reading of each piece.

The readings are absolute angles, zero upright; the hinges' angles are relative.
"""

from functools import cache

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
    pieces = {}
    for point in points:
        pieces.setdefault(point.conditions["piece"], []).append(point)
    known = {}
    for piece, own in pieces.items():
        c, n = own[0].conditions, int(own[0].conditions["arms"])
        times = tuple(sorted({point.conditions["time_s"] for point in own}))
        start = tuple(c[f"angle{i}"] + inputs["start angle"] for i in range(1, n + 1))
        rates = tuple(c[f"rate{i}"] + inputs[f"start rate {i}"] for i in range(1, n + 1))
        known[piece] = swing(n, start, rates, times, inputs["friction"], inputs["inertia"], effort)
    return [known[p.conditions["piece"]][p.conditions["time_s"]][int(p.conditions["arm"]) - 1] for p in points]


@cache
def swing(n, angles, rates, times, friction, inertia, effort):
    """Absolute angles (n,) by time."""
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
    run = fm.simulate(
        builder.scene(), times[-1], samples=[0.0, *times], rtol=(1e-6, 1e-9)[effort], atol=(1e-8, 1e-11)[effort]
    )
    names = [name for name, _ in run.q_names]
    relative = run.q[1:, [names.index(f"hinge {i}.rotation") for i in range(n)]]
    return dict(zip(times, np.cumsum(relative, axis=1), strict=True))
