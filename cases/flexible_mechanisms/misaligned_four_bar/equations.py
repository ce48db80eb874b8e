"""The three bars as rods of Simo and Reissner, by shooting along the bars and differences in time.

At every step the balance of each bar, n' = m r'' and m' = -r' x n, with n = C (g + tau g') and m = K (k + tau k') in
the axes of the section, is integrated from the driven end A over B and C to D by the Runge-Kutta method. Force and
moment at A and the angles of the pins B and C follow from Newton's method: the bar ends at the pivot D with its axis
along z, and no pin transmits a moment about itself. Nothing here has modes or polynomials, and nothing is shared with
flexmb. Left out are the rotary inertias of the sections, some 1e-3 of an inertia that is itself some 1e-3 of the loads.
"""

import numpy as np

RATE, START, TILT, VISCOSITY = -0.6, 1.0, np.deg2rad(5.0), 1e-4  # rad/s, s, rad, s
YOUNG, SHEAR, DENSITY = 207e9, 207e9 / 2.6, 7800.0
PIVOT = np.array([0.24, 0.0, 0.0])
STEPS = ((2.88, 8e-3), (3.0, 2e-3), (3.44, 4e-4), (3.6, 2e-3), (4.0, 8e-3))  # (until, step), s: short ones in the fold
PIECES = 4  # Runge-Kutta steps along each bar, an even number
X, Z = np.eye(3)[0], np.eye(3)[2]
CROSS = np.array([[0, 0, 0, 0, 0, -1, 0, 1, 0], [0, 0, 1, 0, 0, 0, -1, 0, 0], [0, -1, 0, 1, 0, 0, 0, 0, 0]]) * 1.0
TILTED = np.array([np.sin(TILT), 0.0, np.cos(TILT)])  # pin C in the axes of the coupler, which are the world's at first


class Bar:
    """Length (m), compliances of [stretch, shears] (1/N) and of [twist, curvatures] (1/(N m^2)), mass per length."""

    def __init__(self, length, side, shear, torsion):
        self.length = length
        self.strains = np.array([1.0 / (YOUNG * side**2), 1.0 / shear, 1.0 / shear])
        self.curvatures = np.array([1.0 / torsion, 12.0 / (YOUNG * side**4), 12.0 / (YOUNG * side**4)])
        self.mass = DENSITY * side**2


BARS = (Bar(0.12, 0.016, 16.88e6, 733.5), Bar(0.24, 0.016, 16.88e6, 733.5), Bar(0.12, 0.008, 4.22e6, 45.84))


def exact(times, steps=STEPS):
    """Positions (T, 3) of the markers (m), and the loads (T, 3) of A and C (N, N m), at `times` that the steps meet."""
    found = {name: np.empty((len(times), 3)) for name in ("b", "c", "coupler", "follower")}
    loads = {name: np.empty((len(times), 3)) for name in ("a.force", "a.torque", "c.force", "c.torque")}
    past, guesses, met = Past(), [np.zeros(8)] * 3, 0
    for time in grid(steps, times[-1]):
        past.begin(time)
        here, chain = balanced(past.foresight @ guesses, turned(time), past)
        guesses = [here, *guesses[:2]]
        past.keep(chain)
        if abs(time - times[met]) < 1e-9:
            found["b"][met], found["c"][met] = chain.ends[0][0][0], chain.ends[1][0][0]
            found["coupler"][met], found["follower"][met] = chain.middles[1][0], chain.middles[2][0]
            loads["a.force"][met], loads["a.torque"][met] = -here[:3], -here[3:6]
            loads["c.force"][met], loads["c.torque"][met] = -chain.ends[1][2][0], -chain.ends[1][3][0]
            met += 1
    if met < len(times):
        raise ValueError(f"no step ends at t = {times[met]} s")
    channels = {f"marker:{name}.position": values for name, values in found.items()}
    return channels | {f"load:{name}": values for name, values in loads.items()}


def grid(steps, until):
    """Times from 0 to `until` (s) by the `steps` [(until, step), ...]."""
    begins = (0.0, *(end for end, _ in steps[:-1]))
    spans = [begin + step * np.arange(round((end - begin) / step))
             for begin, (end, step) in zip(begins, steps, strict=True)]  # fmt: skip
    times = np.concatenate([*spans, [steps[-1][0]]])
    return times[times < until + 1e-9]


def turned(time):
    """Angle of the drive (rad): its speed grows as x - sin(2 pi x) / (2 pi) with x = t / START, and stays."""
    x = time / START
    if x > 1.0:
        return RATE * (time - 0.5 * START)
    return RATE * START * (0.5 * x**2 + (np.cos(2.0 * np.pi * x) - 1.0) / (2.0 * np.pi) ** 2)


def balanced(guess, angle, past):
    """The unknowns [force at A, moment at A, angle of B, angle of C] and the chain that they make."""
    steps = np.array([1e-3] * 3 + [1e-4] * 3 + [1e-7] * 2)  # N, N m, rad
    unknowns = guess
    for _ in range(20):
        chain = Chain(unknowns + np.vstack([np.zeros(8), np.diag(steps)]), angle, past)
        slopes = (chain.gaps[1:] - chain.gaps[0]).T / steps
        change = np.linalg.solve(slopes, -chain.gaps[0])
        unknowns = unknowns + change
        if np.all(np.abs(change) < 0.1 * steps):
            return unknowns, Chain(unknowns[None], angle, past)
    raise RuntimeError("Newton's method did not converge")


class Chain:
    """The bars from A to D for unknowns (B, 8): ends, middles and gaps (B, 8), and what differences in time need."""

    def __init__(self, unknowns, angle, past):
        self.past, self.calls, self.middles = past, [], []
        count, upward = len(unknowns), turn(Z, np.full(1, angle + 0.5 * np.pi))
        right = turn(Z, np.full(1, -0.5 * np.pi))  # from bar to bar at the start
        crank, coupler, follower = BARS
        start = (np.zeros((count, 3)), np.broadcast_to(upward, (count, 3, 3)), unknowns[:, :3], unknowns[:, 3:6])
        at_b = self.along(crank, start)
        at_c = self.along(coupler, turned_by(at_b, right @ turn(Z, unknowns[:, 6])))
        at_d = self.along(follower, turned_by(at_c, turn(TILTED, unknowns[:, 7]) @ right))
        self.ends = (at_b, at_c, at_d)
        pinned = zip(self.ends, (Z, TILTED, Z), strict=True)
        about = [np.sum(moment * (axes @ pin), axis=1) for (_, axes, _, moment), pin in pinned]
        self.gaps = np.column_stack([1e4 * (at_d[0] - PIVOT), 1e3 * at_d[1][:, :2, 2], *about])

    def along(self, bar, state):
        h = bar.length / PIECES
        for piece in range(PIECES):
            first = self.slopes(bar, state)
            second = self.slopes(bar, moved(state, first, 0.5 * h))
            third = self.slopes(bar, moved(state, second, 0.5 * h))
            fourth = self.slopes(bar, moved(state, third, h))
            mean = [(a + 2.0 * b + 2.0 * c + d) / 6.0 for a, b, c, d in zip(first, second, third, fourth, strict=True)]
            state = moved(state, mean, h)
            if piece == PIECES // 2 - 1:
                self.middles.append(state[0])
        return state

    def slopes(self, bar, state):
        """Derivatives along the bar of position, axes of the section, force and moment."""
        place, axes, force, moment = state
        strains = self.past.strained(len(self.calls), 0, bar.strains * (force[:, None] @ axes)[:, 0])
        curvatures = self.past.strained(len(self.calls), 1, bar.curvatures * (moment[:, None] @ axes)[:, 0])
        tangent = (axes @ (X + strains)[..., None])[..., 0]
        inertia = bar.mass * self.past.acceleration(len(self.calls), place)
        self.calls.append((strains[0], curvatures[0], place[0]))
        return tangent, axes @ cross_matrix(curvatures), inertia, (cross_matrix(force) @ tangent[..., None])[..., 0]


class Past:
    """Strains, curvatures and places of the last three steps at each evaluation along the bars; at rest at first.

    Rates come from the parabola through the last three values, accelerations from the cubic through four, both at their
    last time: with equal steps the second backward difference and that of Houbolt.
    """

    def __init__(self):
        self.times, self.steps = None, []

    def begin(self, time):
        """The differences for the step to `time` (s), and the weights that extrapolate the last three values to it."""
        if self.times is None:
            self.times = time - 1e-3 * np.arange(1.0, 4.0)
        nodes = np.concatenate([[time], self.times]) - time
        self.first, self.second = weights(nodes[:3], 1), weights(nodes, 2)
        self.foresight = weights(nodes[1:], 0)
        self.times = np.concatenate([[time], self.times[:2]])

    def keep(self, chain):
        self.steps = [chain.calls, *self.steps[:2]] if self.steps else [chain.calls] * 3

    def strained(self, call, kind, loaded):
        """The strain g of g + tau g' = `loaded`."""
        if not self.steps:
            return loaded
        now, one, two = VISCOSITY * self.first
        return (loaded - one * self.steps[0][call][kind] - two * self.steps[1][call][kind]) / (1.0 + now)

    def acceleration(self, call, place):
        if not self.steps:
            return np.zeros_like(place)
        now, *before = self.second
        return now * place + sum(weight * calls[call][2] for weight, calls in zip(before, self.steps, strict=True))


def weights(nodes, derivative):
    """Weights (n) of values at `nodes` (n) for the derivative, at 0, of the polynomial through them."""
    powers = np.vander(nodes / np.abs(nodes).max(), increasing=True).T
    wanted = np.zeros(len(nodes))
    wanted[derivative] = (1.0, 1.0, 2.0)[derivative] / np.abs(nodes).max() ** derivative
    return np.linalg.solve(powers, wanted)


def moved(state, slopes, h):
    return tuple(a + h * b for a, b in zip(state, slopes, strict=True))


def turned_by(state, rotations):
    place, axes, force, moment = state
    return place, axes @ rotations, force, moment


def turn(axis, angles):
    """Rotation matrices (B, 3, 3) by `angles` about a unit `axis`."""
    skew = cross_matrix(axis[None])
    angles = angles[:, None, None]
    return np.eye(3) + np.sin(angles) * skew + (1.0 - np.cos(angles)) * skew @ skew


def cross_matrix(vectors):
    return np.reshape(vectors @ CROSS, (len(vectors), 3, 3))
