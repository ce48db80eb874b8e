"""Bennett's linkage: half the angles of neighbouring joints have tangents whose product is constant.

tan(first/2) tan(second/2) = sin((a + b)/2) / sin((b - a)/2), a and b being the twists of the bars; opposite angles are
each other's negatives. Energy gives the rate of the first angle, which never stops; time is a quadrature over one
turn, of a periodic function, hence by its Fourier series.
"""

import numpy as np
from scipy.spatial.transform import Rotation

LONG, SHORT = 0.8, 0.5  # m
TWIST_LONG = np.radians(70.0)
TWIST_SHORT = np.arcsin(SHORT / LONG * np.sin(TWIST_LONG))
RATIO = np.sin(0.5 * (TWIST_LONG + TWIST_SHORT)) / np.sin(0.5 * (TWIST_SHORT - TWIST_LONG))
START, RATE = 0.7, 4.0
GRAVITY = np.array([0.0, -3.0, -9.0])
BARS = ((LONG, TWIST_LONG), (SHORT, TWIST_SHORT), (LONG, TWIST_LONG))
BODIES = (  # bar, mass, mass centre, inertia about it; the coupler has two halves
    (0, 0.8, [0.4, 0.02, 0.0], [0.0008, 0.043, 0.043]),
    (1, 0.2, [0.12, 0.0, 0.03], [0.0002, 0.001, 0.001]),
    (1, 0.3, [0.37, 0.0, -0.02], [0.0003, 0.0016, 0.0016]),
    (2, 1.2, [0.35, -0.03, 0.01], [0.0012, 0.065, 0.064]),
)
MARKERS = {"coupler": (1, [SHORT, 0.0, 0.0]), "rocker": (2, [0.4, 0.1, 0.0])}  # bar, point of it
NODES = 512


def angles(first):
    """Angles of the three joints of the tree, and their derivatives by the first."""
    cos, sin = np.cos(0.5 * first), np.sin(0.5 * first)
    second, slope = 2.0 * np.arctan2(RATIO * cos, sin), -RATIO / (sin**2 + (RATIO * cos) ** 2)
    one = np.ones_like(first)
    return (first, second, -first), (one, slope, -one)


def bars(first):
    """Of every bar where it begins, its rotation, and its velocities (angular, of the beginning) for a unit rate."""
    R, place = Rotation.identity(len(first)), np.zeros((len(first), 3))
    omega, velocity = np.zeros_like(place), np.zeros_like(place)
    found = []
    for angle, rate, (length, twist) in zip(*angles(first), BARS, strict=True):
        R = R * Rotation.from_rotvec(angle[:, None] * [0.0, 0.0, 1.0])
        omega = omega + rate[:, None] * R.apply([0.0, 0.0, 1.0])
        found.append((place, R, omega, velocity))
        link = R.apply([length, 0.0, 0.0])
        place, velocity = place + link, velocity + np.cross(omega, link)
        R = R * Rotation.from_euler("x", twist)
    return found


def energies(first):
    """Kinetic energy for unit rate of the first angle, and that of gravity."""
    kinetic, weight = np.zeros_like(first), np.zeros_like(first)
    chain = bars(first)
    for bar, mass, com, inertia in BODIES:
        place, R, omega, velocity = chain[bar]
        arm = R.apply(com)
        v, turning = velocity + np.cross(omega, arm), R.inv().apply(omega)
        kinetic += 0.5 * mass * np.sum(v**2, axis=1) + 0.5 * turning**2 @ inertia
        weight -= mass * (place + arm) @ GRAVITY
    return kinetic, weight


def turn():
    """Total energy, and the terms of t(first) = mean first + sum of Re(term_n exp(i n first)), but for a constant."""
    kinetic, weight = energies(np.array([START]))
    total = float(kinetic[0] * RATE**2 + weight[0])
    grid = np.arange(NODES) * 2.0 * np.pi / NODES
    kinetic, weight = energies(grid)
    waves = np.fft.rfft(np.sqrt(kinetic / (total - weight))) / NODES  # dt by the angle
    n = np.arange(1, NODES // 2)
    return total, waves[0].real, n, 2.0 * waves[1 : NODES // 2]


def exact(times):
    """Motion of points of two bars, and energies, at `times` (s), World axes, SI."""
    total, mean, n, waves = turn()

    def passed(first):
        return mean * first + (np.exp(1j * np.outer(first, n)) @ (waves / (1j * n))).real

    wanted, first = times + passed(np.array([START])), START + times / mean
    for _ in range(60):
        slope = mean + (np.exp(1j * np.outer(first, n)) @ waves).real
        first = first - (passed(first) - wanted) / slope
    kinetic, weight = energies(first)
    rate = np.sqrt((total - weight) / kinetic)
    found = {
        "energy.kinetic": (total - weight)[:, None],
        "energy.gravity": weight[:, None],
        "energy.total": np.full((len(times), 1), total),
    }
    for name, (body, point) in MARKERS.items():
        place, R, omega, velocity = bars(first)[body]
        arm = R.apply(point)
        found[f"marker:{name}.position"] = place + arm
        found[f"marker:{name}.velocity"] = rate[:, None] * (velocity + np.cross(omega, arm))
        found[f"marker:{name}.angular_velocity"] = rate[:, None] * omega
        found[f"marker:{name}.orientation"] = R.as_quat()[:, [3, 0, 1, 2]]
    return found
