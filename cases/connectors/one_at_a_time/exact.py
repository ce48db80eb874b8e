"""Each body by itself: harmonic pieces, a forced oscillator, quadratures of friction, a curve by SciPy.

Friction by a quadrature: with u = log v, dt = -J sqrt(v² + vr²) / level(v) du, which is smooth down to any speed.
"""

import numpy as np
from scipy.integrate import quad, solve_ivp
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

HUB, WHEEL, SPIN, TURNTABLE = 0.12, 0.04, 12.0, -1.0  # kg m², rad/s
BRAKE = 0.15, 0.3, 0.8, 0.1  # sliding, static, Stribeck's rate, smoothing
BEARING = 0.25, 0.4, 1.5, 0.2


def pieces(times, x, v, bounds, springs):
    """x and v at the times: between `bounds` acceleration -w² (x - centre), with (w, centre) of each range."""
    found, start = np.empty((len(times), 2)), 0.0
    for _ in range(1000):
        i = int(np.searchsorted(bounds, x, side="left" if v < 0.0 else "right"))
        w, centre = springs[i]
        leave = min((cross(x, v, w, centre, b, side) for b, side in edges(bounds, i)), default=np.inf)
        here = (times >= start) & (times <= start + leave)
        found[here] = np.column_stack(moved(x, v, w, centre, times[here] - start))
        if start + leave >= times[-1]:
            return found.T
        (x, v), start = moved(x, v, w, centre, leave), start + leave
        x = min(bounds, key=lambda b: abs(b - x))
    raise RuntimeError("more than a thousand contacts")


def edges(bounds, i):
    """The ends of range i, with the sign of the rate with which each is left."""
    return [(bounds[j], side) for j, side in ((i - 1, -1.0), (i, 1.0)) if 0 <= j < len(bounds)]


def moved(x, v, w, centre, t):
    if w == 0.0:
        return x + v * t, v + 0.0 * t
    c, s = np.cos(w * t), np.sin(w * t)
    return centre + (x - centre) * c + v / w * s, v * c - w * (x - centre) * s


def cross(x, v, w, centre, bound, side):
    """When the bound is passed with a rate of this sign."""
    if w == 0.0:
        return (bound - x) / v if side * v > 0.0 else np.inf
    size, phase = np.hypot(x - centre, v / w), np.arctan2(v / w, x - centre)
    reach = (bound - centre) / size
    if abs(reach) > 1.0:
        return np.inf
    turn = phase - side * np.arccos(reach)  # x falls after the phase, and rises before it
    turn %= 2.0 * np.pi
    return turn / w if turn > 1e-9 else turn / w + 2.0 * np.pi / w


def trolley(times):
    return pieces(times, 0.0, 1.5, np.array([-0.2, 0.3]), [(30.0, -0.2), (0.0, 0.0), (20.0, 0.3)])


def flap(times):
    w, inner, outer = np.sqrt(2.0 / 0.05), -0.1, np.sqrt(62.0 / 0.05)
    lower, upper = (2.0 * inner + 60.0 * -0.3) / 62.0, (2.0 * inner + 60.0 * 0.4) / 62.0
    return pieces(times, 0.1, 3.0, np.array([-0.3, 0.4]), [(outer, lower), (w, inner), (outer, upper)])


def ram(times):
    """x'' + 4 x' + 100 (x - 0.2) = (30 sin(7 t + 0.4) - 20) / 1.5."""
    rest = 0.2 - 20.0 / 150.0
    forced = 20.0 * np.exp(0.4j) / (100.0 - 49.0 + 28.0j)  # times exp(7 i t), the imaginary part
    root = -2.0 + 1j * np.sqrt(96.0)
    x0, v0 = 0.5 - rest - forced.imag, -0.2 - (7j * forced).imag
    free = x0 - 1j * (v0 - root.real * x0) / root.imag  # times exp(root t), the real part
    wave, decay = forced * np.exp(7j * times), free * np.exp(root * times)
    return rest + wave.imag + decay.real, (7j * wave).imag + (root * decay).real


def level(v, friction):
    sliding, static, stribeck, smoothing = friction
    return (sliding + (static - sliding) / (1.0 + (v / stribeck) ** 2)) / np.hypot(v, smoothing)


def braked(times, v0, inertia, friction):
    """Angle and rate of what friction alone brakes."""

    def over(weight, u, before):
        value = quad(lambda z: weight(np.exp(z)) * inertia / level(np.exp(z), friction), u, before, epsabs=1e-15)
        return value[0]

    def after(span, u):
        """The logarithm of the rate, `span` after it was u."""
        lower = u - 50.0 * span - 1.0
        return brentq(lambda z: over(lambda v: 1.0, z, u) - span, lower, u, xtol=1e-15, rtol=1e-15)

    u, t, angle, rows = np.log(v0), 0.0, 0.0, []
    for time in times:
        if time > t:
            new = after(time - t, u)
            angle += over(lambda v: v, new, u)
            u, t = new, time
        rows.append((angle, np.exp(u)))
    return np.array(rows).T


def slug(times):
    law = PchipInterpolator([-0.2, -0.1, 0.0, 0.1, 0.2], [-30.0, -6.0, 0.0, 4.0, 20.0])
    done = solve_ivp(
        lambda t, y: [y[1], -law(y[0]) / 0.5], (0.0, times[-1]), [0.15, 0.0], method="DOP853", t_eval=times,
        rtol=1e-13, atol=1e-15, max_step=2e-3,
    )  # fmt: skip
    return (*done.y, -law(done.y[0]))


def along(x, y):
    return np.column_stack([x, np.full_like(x, y), np.zeros_like(x)])


def turned(angle, arm, y):
    return np.column_stack([arm * np.cos(angle), y + arm * np.sin(angle), np.zeros_like(angle)])


def passing(angle, rate, arm):
    return rate[:, None] * np.column_stack([-arm * np.sin(angle), arm * np.cos(angle), np.zeros_like(angle)])


def exact(times):
    x, v = trolley(times)
    piston, piston_rate = ram(times)
    angle, swing = flap(times)
    drum_angle, drum_rate = braked(times, 4.0, 0.08, BRAKE)
    spin_angle, spin = braked(times, SPIN, 1.0 / (1.0 / HUB + 1.0 / WHEEL), BEARING)
    momentum = HUB * TURNTABLE + WHEEL * (TURNTABLE + SPIN)
    hub, hub_rate = ((momentum * each - WHEEL * by) / (HUB + WHEEL) for each, by in ((times, spin_angle), (1.0, spin)))
    place, speed, leaf = slug(times)
    push = 30.0 * np.sin(7.0 * times + 0.4)
    tension = 20.0 + 150.0 * (piston - 0.2) + 6.0 * piston_rate - push
    deep = np.maximum(angle - 0.4, 0.0) + np.minimum(angle + 0.3, 0.0)
    none = np.zeros_like(times)
    return {
        "marker:trolley.position": along(x, 0.0),
        "marker:trolley.velocity": along(v, 0.0),
        "marker:ram.position": along(piston, 1.0),
        "marker:ram.velocity": along(piston_rate, 0.0),
        "marker:flap.position": turned(angle, 0.2, 2.0),
        "marker:flap.velocity": passing(angle, swing, 0.2),
        "marker:drum.position": turned(drum_angle, 0.2, 3.0),
        "marker:drum.velocity": passing(drum_angle, drum_rate, 0.2),
        "marker:hub.position": turned(hub, 0.3, 4.0),
        "marker:hub.velocity": passing(hub, hub_rate, 0.3),
        "marker:slug.position": along(place, 5.0),
        "marker:slug.velocity": along(speed, 0.0),
        "connector:cable.force": np.column_stack([-800.0 * np.maximum(x - 0.3, 0.0), none, none]),
        "connector:buffer.force": np.column_stack([-1800.0 * np.minimum(x + 0.2, 0.0), none, none]),
        "connector:cylinder.force": np.column_stack([-tension, none, none]),
        "hinge_force:stops": (-2.0 * (angle + 0.1) - 60.0 * deep)[:, None],
        "hinge_force:brake": (-drum_rate * level(drum_rate, BRAKE))[:, None],
        "hinge_force:bearing": (-spin * level(spin, BEARING))[:, None],
        "hinge_force:leaf": leaf[:, None],
    }
