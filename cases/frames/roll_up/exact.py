"""Closed form at rest: a strip under an end moment M is an arc of curvature M/EI, a full circle at M = 2 pi EI/L.

The moment grows so slowly that the strip passes through these arcs; what its inertia does is the uncertainty.
"""

import numpy as np

LENGTH, STIFFNESS, GROWTH = 1.0, 1.0, 6.0  # m, N m^2, s


def exact(times):
    """Position (T, 3) of tip and middle (m)."""
    x = np.clip(np.asarray(times) / GROWTH, 0.0, 1.0)
    moment = 2.0 * np.pi * STIFFNESS / LENGTH * (35.0 * x**4 - 84.0 * x**5 + 70.0 * x**6 - 20.0 * x**7)
    half = 0.5 * moment / STIFFNESS
    channels = {}
    for name, s in {"tip": LENGTH, "middle": 0.5 * LENGTH}.items():
        chord = s * np.sinc(half * s / np.pi)  # 2 sin(kappa s/2) / kappa, under half the turn of the end
        channels[f"marker:{name}.position"] = np.column_stack(
            [chord * np.cos(half * s), chord * np.sin(half * s), np.zeros_like(chord)]
        )
    return channels
