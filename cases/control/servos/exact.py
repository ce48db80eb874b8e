"""Both servos by matrix exponentials and closed forms, from sample to sample and from stroke to stroke.

Between instants the table turns under a constant torque, and the pointer with its continuous controllers is linear.
Instants are counted in milliseconds, as they fall on whole ones.
"""

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

MOUNTING = Rotation.from_quat([0.6, 0.0, 0.0, 0.8])
TABLE, POINTER = 0.79 + 1.0 * 0.1**2, 0.495 + 2.0 * 0.05**2  # kg m2 about the axes
DAMPING, GREASED, GREASED_MS = 0.1, 0.4, 1370
RIM, TIP, PLACE = 0.5, 0.8, np.array([2.0, 0.0, 0.0])

KP, KI, KD, FILTER, PERIOD, LIMIT = 4.0, 2.0, 0.6, 0.2, 0.1, 0.9
POINTS, GAINS, BRAKE = (0.0, 0.4, 0.8), (0.2, 0.9, 1.2), 0.3

STIFFNESS, SETPOINT, STOP, RESTITUTION, LATCHED_MS = 3.0, 0.4, 0.45, 0.6, 3000
HP, HI, HD, HF, LAG, DRAG = 6.0, 3.0, 0.5, 0.05, 5.0, 0.8


def course(t):
    x = min(max((t - 0.3) / 1.0, 0.0), 1.0)
    return 0.6 * x**4 * (35.0 - 84.0 * x + 70.0 * x**2 - 20.0 * x**3)


def turned(angle, rate, torque, damping, span):
    """The table after `span` (s) of a constant torque."""
    decay, final = np.exp(-damping * span / TABLE), torque / damping
    return angle + final * span + (rate - final) * TABLE / damping * (1.0 - decay), final + (rate - final) * decay


def table(times):
    """Angle and rate; controllers act at whole milliseconds, in the order of the scene, what waits is applied first."""
    stamps = np.floor(1e3 * times + 1e-6).astype(int)
    angle, rate, now, damping = 0.2, 0.5, 0, DAMPING
    filtered, smooth, scheduled, waiting_brake, brake = 0.0, 0.0, 0.0, 0.0, 0.0
    integral, before, aim, waiting_aim = 0.0, course(0.0) - angle, 0.0, 0.0
    found = []
    for ms in range(stamps[-1] + 1):
        if ms > now:
            angle, rate = turned(angle, rate, aim - brake, damping, 1e-3)
            now = ms
        damping = DAMPING if now < GREASED_MS else GREASED
        if ms % 100 == 30:
            aim = waiting_aim
        if ms > 0 and ms % 50 == 0:
            scheduled = waiting_brake
        if ms % 50 == 20:
            smooth = filtered + 0.1 * rate
            filtered = 0.6 * filtered + 0.4 * rate
            waiting_brake = np.interp(angle, POINTS, GAINS) * smooth
        if ms % 50 == 40:
            brake = min(max(scheduled, -BRAKE), BRAKE)
        if ms % 100 == 0:
            error = course(1e-3 * ms) - angle
            asked = KP * error + integral + KD * (error - before) / FILTER
            waiting_aim = min(max(asked, -LIMIT), LIMIT)
            integral += PERIOD * (KI * error + (waiting_aim - asked) / (KP / KI))
            before = error + np.exp(-PERIOD / FILTER) * (before - error)
        while len(found) < len(times) and ms == stamps[len(found)]:
            found.append(turned(angle, rate, aim - brake, damping, times[len(found)] - 1e-3 * ms))
    return np.array(found).T


def loop():
    """Rates of [angle, rate, lag, integral, filtered error, 1] of the pointer."""
    error = np.array([-1.0, 0.0, 0.0, 0.0, 0.0, SETPOINT])
    slope = (error - np.eye(6)[4]) / HF
    torque = HP * error + np.eye(6)[3] + HD * slope - DRAG * np.eye(6)[2] - STIFFNESS * np.eye(6)[0]
    lag = LAG * (np.eye(6)[1] - np.eye(6)[2])
    return np.array([np.eye(6)[1], torque / POINTER, lag, HI * error, slope, np.zeros(6)])


def pointer(times):
    """Angle and rate: strokes are where the exponential comes to the stop from below."""
    A, end = loop(), 1e-3 * LATCHED_MS
    start, state = 0.0, np.array([0.3, 1.0, 0.0, 0.0, SETPOINT - 0.3, 1.0])
    pieces = []
    while start < end:
        def gap(span, state=state):
            return (expm(A * span) @ state)[0] - STOP

        grid = np.arange(1e-4, end - start, 1e-3)
        gaps = np.array([gap(span) for span in grid])
        up = np.flatnonzero((gaps[:-1] < 0.0) & (gaps[1:] >= 0.0))
        stroke = brentq(gap, grid[up[0]], grid[up[0] + 1], xtol=1e-16, rtol=1e-15) if len(up) else end - start
        pieces.append((start, state))
        state = expm(A * stroke) @ state
        start = start + stroke if len(up) else end
        if len(up):
            state[0], state[1] = STOP, -RESTITUTION * state[1]
    pieces.append((end, np.array([state[0], 0.0])))
    found = []
    for t in times:
        begun, state = [piece for piece in pieces if piece[0] <= t][-1]
        found.append(state[:2] if begun == end else (expm(A * (t - begun)) @ state)[:2])
    return np.array(found).T


def exact(times):
    """Motion of rim and tip, energies, and the work of motors, brakes and impulses, at `times` (s), World axes, SI."""
    channels, energy = {}, {}
    motions = {"rim": (table(times), RIM, 0.0 * PLACE), "tip": (pointer(times), TIP, PLACE)}
    for name, ((angle, rate), radius, place) in motions.items():
        along = np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
        across = np.column_stack([-np.sin(angle), np.cos(angle), 0.0 * angle])
        channels[f"marker:{name}.position"] = place + MOUNTING.apply(radius * along)
        channels[f"marker:{name}.velocity"] = MOUNTING.apply(radius * rate[:, None] * across)
        channels[f"marker:{name}.angular_velocity"] = rate[:, None] * MOUNTING.apply([0.0, 0.0, 1.0])
    rates = [motion[0][1] for motion in motions.values()]
    energy["kinetic"] = 0.5 * TABLE * rates[0] ** 2 + 0.5 * POINTER * rates[1] ** 2
    energy["spring"] = 0.5 * STIFFNESS * motions["tip"][0][0] ** 2
    total = energy["kinetic"] + energy["spring"]
    return channels | {f"energy.{kind}": values for kind, values in energy.items()} | {"work": total - total[0]}
