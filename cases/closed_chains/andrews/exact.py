"""Andrews' mechanism has one freedom: every angle is a closed form of that of the crank, by triangles whose three sides
are known. Energy gives the rate of the crank, which never stops, and time is a quadrature.

Places and directions are complex numbers: exp(i angle) is the x axis of a body that has turned by the angle.
"""

import numpy as np

A, B, C = -0.06934 - 0.00227j, -0.03635 + 0.03273j, 0.014 + 0.072j  # m, fixed to the ground
START, TORQUE, STIFFNESS, FREE = -0.0617138900142764496, 0.033, 4530.0, 0.07785
BODIES = {  # mass, mass centre, inertia about it
    "K1": (0.04325, 0.00092, 2.194e-6),
    "K2": (0.00365, -0.0115, 4.41e-7),
    "K3": (0.02373, 0.01043 - 0.01874j, 5.255e-6),
    "K4": (0.00706, -0.00579j, 5.667e-7),
    "K5": (0.0705, 0.02308 + 0.00916j, 1.169e-5),
    "K6": (0.00706, 0.00579, 5.667e-7),
    "K7": (0.05498, -0.00449 - 0.01228j, 1.912e-5),
}
MARKERS = {"K1": 0.007, "K2": -0.028, "K3": 0.02 - 0.018j, "K4": 0.0, "K5": 0.02 + 0.01j, "K6": 0.0, "K7": -0.01 - 0.02j}
TURNED, PANELS = 20.0, 200  # the angle up to which the quadrature goes, and its panels of equal steps in the root
NODES, WEIGHTS = np.polynomial.legendre.leggauss(24)
TINY = 1e-9  # a root of the angle at which the mechanism has hardly begun to move, for 0/0


def pair(P, first, Q, second, side):
    """Unit vectors along two bars from P, Q, (place, velocity), to where they meet, with their rates.

    `first` and `second` are the bars' lengths; they meet to the left (`side` 1) or right (-1) of the way from P to Q.
    """
    way = Q[0] - P[0]
    span = np.abs(way)
    along = (span**2 + first**2 - second**2) / (2.0 * span)
    u = way / span * (along + 1j * side * np.sqrt(first**2 - along**2)) / first
    v = (first * u - way) / second
    parting, sine = Q[1] - P[1], (u.conj() * v).imag
    rates = (parting * v.conj()).real / (first * sine), (parting * u.conj()).real / (second * sine)
    return (u, rates[0]), (v, rates[1])


def motion(crank):
    """Of every body the place and velocity of its frame, its direction and its rate, for a crank that turns at 1 rad/s."""
    still, x = np.zeros_like(crank), np.exp(1j * crank)
    F, at_A, at_B = (0.007 * x, 0.007j * x), (A + still, still), (B + still, still)
    rod, arm = pair(F, 0.028, at_B, 0.035, 1)
    E = F[0] + 0.028 * rod[0], F[1] + 0.028j * rod[1] * rod[0]
    lower, bar4 = pair(at_A, 0.04, E, 0.02, 1)
    upper, bar6 = pair(at_A, 0.04, E, 0.02, -1)
    G = at_A[0] + 0.04 * lower[0], 0.04j * lower[1] * lower[0]
    H = at_A[0] + 0.04 * upper[0], 0.04j * upper[1] * upper[0]
    return {
        "K1": (still, still, x, still + 1.0),
        "K2": (*F, -rod[0], rod[1]),
        "K3": (*at_B, 1j * arm[0], arm[1]),
        "K4": (*G, -1j * bar4[0], bar4[1]),
        "K5": (*at_A, *lower),
        "K6": (*H, -bar6[0], bar6[1]),
        "K7": (*at_A, 1j * upper[0], upper[1]),
    }


def point(body, arm):
    """Place and velocity of a point of a body."""
    place, velocity, x, rate = body
    return place + arm * x, velocity + 1j * rate * arm * x


def energies(bodies):
    """Kinetic for a unit rate of the crank, that of the spring, and the pull of the spring on K3."""
    kinetic = 0.0
    for name, (mass, centre, inertia) in BODIES.items():
        kinetic = kinetic + 0.5 * mass * np.abs(point(bodies[name], centre)[1]) ** 2 + 0.5 * inertia * bodies[name][3] ** 2
    way = point(bodies["K3"], MARKERS["K3"])[0] - C
    beyond = np.abs(way) - FREE
    return kinetic, 0.5 * STIFFNESS * beyond**2, -STIFFNESS * beyond * way / np.abs(way)


def raised(angle):
    """What the spring has stored while the crank turned by `angle`; at its first turn by quadrature, against rounding."""
    _, stored, _ = energies(motion(START + angle))
    _, first, _ = energies(motion(np.array([START])))
    parts = angle[..., None] * 0.5 * (1.0 + NODES)
    bodies = motion(START + parts)
    _, _, pull = energies(bodies)
    slope = -(pull * point(bodies["K3"], MARKERS["K3"])[1].conj()).real
    return np.where(angle < 0.5, 0.5 * angle * (slope @ WEIGHTS), stored - first)


def slowness(root):
    """dt by the root of the angle from the start: it is finite where the mechanism is at rest."""
    kinetic, _, _ = energies(motion(START + root**2))
    return 2.0 * root * np.sqrt(kinetic / (TORQUE * root**2 - raised(root**2)))


def panels():
    """Where the panels end, as roots of the angle from the start, and when that is reached."""
    ends = np.sqrt(TURNED) * np.linspace(0.0, 1.0, PANELS + 1)
    half = 0.5 * (ends[1] - ends[0])
    return ends, np.concatenate([[0.0], np.cumsum(half * slowness((ends[:-1] + half)[:, None] + half * NODES) @ WEIGHTS)])


def turned(times):
    """The crank's angle from the start at `times` (s), by Newton's method for its root."""
    ends, reached = panels()
    if not np.all((0.0 <= times) & (times <= reached[-1])):
        raise ValueError(f"times must lie between 0 and {reached[-1]:.4f} s, when the crank has turned by {TURNED} rad")
    panel = np.clip(np.searchsorted(reached, times, side="right") - 1, 0, PANELS - 1)
    begin, rest = ends[panel], times - reached[panel]
    root = np.interp(times, reached, ends)
    for _ in range(8):
        half = 0.5 * (root - begin)
        late = half * (slowness(np.maximum((begin + half)[:, None] + half[:, None] * NODES, TINY)) @ WEIGHTS) - rest
        root = root - late / slowness(np.maximum(root, TINY))
    return root**2


def spatial(values):
    """A vector of the plane in World axes."""
    return np.column_stack([values.real, values.imag, np.zeros_like(values.real)])


def exact(times):
    """Motion of all bodies, the spring's load and energies at `times` (s), World axes, SI."""
    times = np.asarray(times, dtype=float)
    angle = turned(times)
    bodies = motion(START + angle)
    kinetic, spring, pull = energies(bodies)
    work = TORQUE * angle
    rate = np.sqrt((work - raised(angle)) / kinetic)
    found = {
        "energy.kinetic": (rate**2 * kinetic)[:, None],
        "energy.spring": spring[:, None],
        "energy.total": (spring + rate**2 * kinetic)[:, None],
        "work": work[:, None],
        "connector:spring.force": spatial(pull),
    }
    for name, arm in MARKERS.items():
        place, velocity = point(bodies[name], arm)
        half = 0.5 * np.unwrap(np.angle(bodies[name][2]))
        still = np.zeros_like(half)
        found[f"marker:{name}.position"] = spatial(place)
        found[f"marker:{name}.velocity"] = spatial(rate * velocity)
        found[f"marker:{name}.angular_velocity"] = np.column_stack([still, still, rate * bodies[name][3]])
        found[f"marker:{name}.orientation"] = np.column_stack([np.cos(half), still, still, np.sin(half)])
    return found
