"""A block on a belt: x'' = (F - k x)/m with F = Fc while it slips back or is caught up, x' = v while it sticks.

It starts at rest at x = 0 and is pulled by Fc until it has the speed of the belt. From then on it sticks while
k x <= Fs, and slips from x = Fs/k, until it has the speed of the belt again at x = (2 Fc - Fs)/k.
"""

import numpy as np

MASS, STIFFNESS, SLIDING, STATIC, SPEED = 1.0, 100.0, 4.0, 6.0, 0.3
RATE, CENTRE = np.sqrt(STIFFNESS / MASS), SLIDING / STIFFNESS


def phases(end):
    """(start, end, x, whether it sticks) of one phase after another."""
    caught = np.arcsin(SPEED / (CENTRE * RATE)) / RATE
    yield 0.0, caught, 0.0, False
    start, x = caught, CENTRE * (1.0 - np.cos(RATE * caught))
    beyond = STATIC / STIFFNESS - CENTRE
    slipping = 2.0 / RATE * (np.pi - np.arctan2(beyond * RATE, SPEED))
    while start < end:
        slips = start + (CENTRE + beyond - x) / SPEED
        yield start, slips, x, True
        yield slips, slips + slipping, CENTRE + beyond, False
        start, x = slips + slipping, CENTRE - beyond


def exact(times):
    x, v, friction = (np.zeros(len(times)) for _ in range(3))
    for start, end, at, sticks in phases(times[-1]):
        here, s = (times >= start) & (times < end), times - start
        speed = 0.0 if start == 0.0 else SPEED
        c, d = np.cos(RATE * s), np.sin(RATE * s)
        x[here] = (at + SPEED * s if sticks else CENTRE + (at - CENTRE) * c + speed / RATE * d)[here]
        v[here] = (np.full(len(times), SPEED) if sticks else speed * c - RATE * (at - CENTRE) * d)[here]
        friction[here] = (STIFFNESS * x if sticks else np.full(len(times), SLIDING))[here]
    zero = np.zeros(len(times))
    kinetic, spring = 0.5 * MASS * v**2 + 0.5 * 3.0 * SPEED**2, 0.5 * STIFFNESS * x**2
    return {
        "marker:block.position": np.column_stack([x, zero, zero]),
        "marker:block.velocity": np.column_stack([v, zero, zero]),
        "hinge_force:dry": friction[:, None],
        "drive:drive": friction[:, None],
        "connector:spring.force": np.column_stack([-STIFFNESS * x, zero, zero]),
        "energy.kinetic": kinetic[:, None],
        "energy.spring": spring[:, None],
    }
