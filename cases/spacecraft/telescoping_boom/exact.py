"""Closed form: a hub spins about a fixed axis and drives out a mast; the angular momentum stays what it was.

With the mast's mass centre at s from the axis, psi' = H / (J + m s^2), and the drive pushes with m (s'' - s psi'^2).
The angle is an integral over time, taken by Gauss's rule between every two samples.
"""

import numpy as np

INERTIA, MASS, REACH = 16.0, 12.0, 1.0  # hub and mast about their centres (kg m^2), mast (kg), half its length (m)
START, GROWTH, TRAVEL = 0.5, 5.0, 2.0  # s, s, m
MOMENTUM = INERTIA * 1.5  # kg m^2/s: the mast starts with its centre on the axis


def exact(times):
    """Positions (T, 3) of hub and tip (m), the drive (T, 1) (N), angular momentum (T, 3) and kinetic energy (T, 1)."""
    times = np.asarray(times)
    way, rate, acceleration = slide(times)
    spin = spinning(times)
    angle = np.concatenate([[0.0], np.cumsum([turned(a, b) for a, b in zip(times[:-1], times[1:], strict=True)])])
    along = np.column_stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)])
    zero = np.zeros_like(times)
    return {
        "marker:hub.position": 0.5 * along,
        "marker:tip.position": (way + REACH)[:, None] * along,
        "drive:slide": (MASS * (acceleration - way * spin**2))[:, None],
        "momentum.angular": np.column_stack([zero, zero, zero + MOMENTUM]),
        "energy.kinetic": (0.5 * MOMENTUM * spin + 0.5 * MASS * rate**2)[:, None],
    }


def slide(times):
    """s, s' and s'' of the septic blend from 0 to the end of the travel."""
    x = np.clip((times - START) / GROWTH, 0.0, 1.0)
    blend = np.polynomial.Polynomial([0.0, 0.0, 0.0, 0.0, 35.0, -84.0, 70.0, -20.0]) * TRAVEL
    return blend(x), blend.deriv()(x) / GROWTH, blend.deriv(2)(x) / GROWTH**2


def spinning(times):
    """psi' (rad/s)."""
    return MOMENTUM / (INERTIA + MASS * slide(times)[0] ** 2)


def turned(start, end):
    """The angle (rad) from `start` to `end` (s), divided where the blend ends: Gauss's rule is for smooth functions."""
    ends = [start, *(t for t in (START, START + GROWTH) if start < t < end), end]
    nodes, weights = np.polynomial.legendre.leggauss(20)
    pieces = zip(ends[:-1], ends[1:], strict=True)
    return sum(0.5 * (b - a) * (weights @ spinning(a + 0.5 * (b - a) * (nodes + 1.0))) for a, b in pieces)
