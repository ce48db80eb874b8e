"""The hoist has one freedom, the angle phi of the drum, and is linear: a driven oscillator with damping.

J phi'' + c phi' + k (phi - phi0) = -4 A sin(w t + p), as the motor turns four times as far the other way, with
J = I_drum + 16 I_rotor + r^2 (m1 + m2). The loads of gears and ropes follow from the bodies' own equations.
"""

import numpy as np

ROTOR, DRUM, LOAD, COUNTER = 0.02, 0.35, 12.0, 9.0  # kg m^2, kg m^2, kg, kg
RADIUS, GEAR, GRAVITY = 0.3, -4.0, 9.81  # m; turns of the motor per turn of the drum
STIFFNESS, DAMPING, REST, OFFSET = 400.0, 15.0, 0.05, 0.1
TORQUE, FREQUENCY, PHASE = 3.0, 5.0, 0.6
START, RATE = 0.0, 0.5  # of the drum
HEIGHT = 0.5  # m, of both weights where their coordinates are zero; the load's mass centre hangs lower
HANGS, AXLE = 0.1, 2.0


def angle(t):
    """phi, its rate and acceleration."""
    J = DRUM + GEAR**2 * ROTOR + RADIUS**2 * (LOAD + COUNTER)
    c, k = RADIUS**2 * DAMPING, RADIUS**2 * STIFFNESS
    # right rope: x = OFFSET - r phi, so that the spring turns the drum by r k_s (x - REST)
    rest = ((COUNTER - LOAD) * GRAVITY * RADIUS + RADIUS * STIFFNESS * (OFFSET - REST)) / k
    forced = GEAR * TORQUE * np.exp(1j * PHASE) / (k - J * FREQUENCY**2 + 1j * c * FREQUENCY)
    swing = forced * np.exp(1j * FREQUENCY * t)
    s = (-c + np.sqrt(complex(c * c - 4.0 * J * k))) / (2.0 * J)  # an underdamped pair
    place, rate = START - rest - forced.imag, RATE - (1j * FREQUENCY * forced).imag
    a = place - 1j * (rate - s.real * place) / s.imag  # Re(a exp(s t)) starts at `place` with `rate`
    free = a * np.exp(s * t)
    return (
        rest + swing.imag + free.real,
        (1j * FREQUENCY * swing).imag + (s * free).real,
        (-(FREQUENCY**2) * swing).imag + (s * s * free).real,
    )


def exact(times):
    """Motion, loads of the couplings and energies at `times` (s), World axes, SI."""
    t = np.asarray(times, dtype=float)
    phi, rate, acceleration = angle(t)
    still = np.zeros_like(t)
    x, v = OFFSET - RADIUS * phi, -RADIUS * rate
    left = LOAD * (RADIUS * acceleration + GRAVITY)
    right = COUNTER * (GRAVITY - RADIUS * acceleration) + STIFFNESS * (x - REST) + DAMPING * v
    gears = DRUM * acceleration + RADIUS * (left - right)
    kinetic = 0.5 * (DRUM + GEAR**2 * ROTOR + RADIUS**2 * (LOAD + COUNTER)) * rate**2
    spring = 0.5 * STIFFNESS * (x - REST) ** 2
    heights = 1.5 * AXLE + 8.0 * AXLE + LOAD * (HEIGHT - HANGS + RADIUS * phi) + COUNTER * (HEIGHT + x)
    gravity = GRAVITY * heights
    total = kinetic + spring + gravity
    found = {
        "energy.kinetic": kinetic, "energy.spring": spring, "energy.gravity": gravity, "energy.total": total,
        "work": total - total[0],
    }  # fmt: skip
    found = {name: values[:, None] for name, values in found.items()}
    rows = np.column_stack
    found |= {
        "load:gears.torque": rows([still, gears, still]),
        "load:left rope.force": rows([still, still, left]),
        "load:right rope.force": rows([still, still, right]),
        "marker:load.position": rows([still - 0.3, still, HEIGHT + RADIUS * phi]),
        "marker:load.velocity": rows([still, still, RADIUS * rate]),
        "marker:counterweight.position": rows([still + 0.3, still, HEIGHT + x]),
        "marker:counterweight.velocity": rows([still, still, v]),
        "marker:rim.position": rows([0.3 * np.cos(phi), still, AXLE - 0.3 * np.sin(phi)]),
        "marker:rim.velocity": rate[:, None] * rows([-0.3 * np.sin(phi), still, -0.3 * np.cos(phi)]),
        "marker:rim.angular_velocity": rows([still, rate, still]),
        "marker:rim.orientation": rows([np.cos(0.5 * phi), still, np.sin(0.5 * phi), still]),
    }
    return found
