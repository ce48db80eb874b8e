"""The governor by Lagrange's equations in two coordinates, the lean of both arms and the height of the slider.

Nothing brakes the shaft, so that its momentum is constant and gives its rate: w = H / I(lean). The arms are rods of 1 m
with a ball at the end. The equations are stiff; SciPy integrates them by its implicit Runge-Kutta method of order 5.
"""

import numpy as np
from scipy.integrate import solve_ivp

G, STIFFNESS, DAMPING, FREE = 9.81, 8e5, 4e4, 0.5
OFFSET, TOP, MIDDLE = 0.05, 1.0, 0.5  # m: of the arms' hinges from the axis, their height, and where the springs hold
ROD, BALL, SLIDER, THIN, WIDE = 0.3, 5.0, 3.0, 0.01, 0.1  # kg, and the sides of the sections, m
MASS, FIRST = ROD + BALL, 0.5 * ROD + BALL  # of one arm, and its first and second moments about its hinge
SECOND, ACROSS = ROD / 3.0 + BALL, ROD * THIN**2 / 12.0
START = np.array([np.pi / 6.0, 0.5, 0.0, 0.0, 0.0])  # lean below the horizontal, height, their rates, turn of the shaft
SPIN = 2.0 * np.pi


def about_axis(lean):
    """Moment of inertia of everything about the shaft, and its derivative by the lean."""
    cos, sin = np.cos(lean), np.sin(lean)
    arm = MASS * OFFSET**2 + 2.0 * OFFSET * FIRST * cos + SECOND * cos**2 + ACROSS * (cos**2 + 2.0 * sin**2)
    slope = -2.0 * OFFSET * FIRST * sin - 2.0 * SECOND * sin * cos + 2.0 * ACROSS * sin * cos
    return ROD * THIN**2 / 6.0 + SLIDER * WIDE**2 / 6.0 + 2.0 * arm, 2.0 * slope


MOMENTUM = about_axis(START[0])[0] * SPIN


def coupler(lean, height, lean_rate, height_rate):
    """Of one spring: tension, extension, and how its length changes with lean and height."""
    way = np.array([MIDDLE * np.cos(lean), TOP - MIDDLE * np.sin(lean) - height])
    length = np.sqrt(way[0] ** 2 + way[1] ** 2)
    n = way / length
    by_lean, by_height = -MIDDLE * (n[0] * np.sin(lean) + n[1] * np.cos(lean)), -n[1]
    tension = STIFFNESS * (length - FREE) + DAMPING * (by_lean * lean_rate + by_height * height_rate)
    return tension, length - FREE, by_lean, by_height


def rates(t, y):
    """Of lean, height, their rates and the turn of the shaft: for each arm, a half of what the shaft's inertia demands."""
    lean, height, lean_rate, height_rate, _ = y
    inertia, change = about_axis(lean)
    tension, _, by_lean, by_height = coupler(lean, height, lean_rate, height_rate)
    spin = MOMENTUM / inertia
    swing = (0.25 * spin**2 * change + FIRST * G * np.cos(lean) - tension * by_lean) / (SECOND + ACROSS)
    return np.array([lean_rate, height_rate, swing, -2.0 * tension * by_height / SLIDER - G, spin])


def slopes(t, y):
    """The Jacobian of `rates`, by complex steps."""
    return np.column_stack([rates(t, y + 1e-30j * direction).imag for direction in np.eye(5)]) / 1e-30


def around(turn, radius, z):
    """A vector of the turning plane, World axes."""
    return np.column_stack([radius * np.cos(turn), radius * np.sin(turn), z])


def states(times):
    """Lean, height, their rates and the turn of the shaft (T, 5)."""
    run = solve_ivp(rates, (0.0, max(times[-1], 1e-9)), START, "Radau", times, jac=slopes, rtol=1e-10, atol=1e-12)
    if not run.success:
        raise ArithmeticError(run.message)
    return run.y.T


def energies(lean, height, lean_rate, height_rate):
    """Kinetic, of gravity, of both springs; and the rate of the shaft."""
    inertia, _ = about_axis(lean)
    spin = MOMENTUM / inertia
    kinetic = 0.5 * inertia * spin**2 + (SECOND + ACROSS) * lean_rate**2 + 0.5 * SLIDER * height_rate**2
    weight = G * (SLIDER * height + 2.0 * (MASS * TOP - FIRST * np.sin(lean)) + 0.5 * ROD)
    return kinetic, weight, STIFFNESS * coupler(lean, height, lean_rate, height_rate)[1] ** 2, spin


def exact(times):
    """Motion of slider and balls, momentum and energies at `times` (s), World axes, SI."""
    times = np.asarray(times, dtype=float)
    lean, height, lean_rate, height_rate, turn = states(times).T
    kinetic, weight, spring, spin = energies(lean, height, lean_rate, height_rate)
    half, zero = 0.5 * turn, np.zeros_like(lean)
    found = {
        "energy.kinetic": kinetic[:, None],
        "energy.gravity": weight[:, None],
        "energy.spring": spring[:, None],
        "energy.total": (kinetic + weight + spring)[:, None],
        "momentum.angular": np.column_stack([zero, zero, np.full_like(lean, MOMENTUM)]),
        "marker:slider.position": np.column_stack([zero, zero, height]),
        "marker:slider.velocity": np.column_stack([zero, zero, height_rate]),
        "marker:slider.angular_velocity": np.column_stack([zero, zero, spin]),
        "marker:slider.orientation": np.column_stack([np.cos(half), zero, zero, np.sin(half)]),
    }
    radius, out = OFFSET + np.cos(lean), -np.sin(lean) * lean_rate
    for name, side in (("right", 0.0), ("left", np.pi)):
        at = turn + side
        along = around(at + 0.5 * np.pi, radius * spin, zero)
        found[f"marker:{name} ball.position"] = around(at, radius, TOP - np.sin(lean))
        found[f"marker:{name} ball.velocity"] = along + around(at, out, -np.cos(lean) * lean_rate)
        found[f"marker:{name} ball.angular_velocity"] = around(at + 0.5 * np.pi, lean_rate, spin)
    return found
