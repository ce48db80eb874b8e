"""A damped and driven linear oscillator on an oblique guide."""

import numpy as np
from scipy.spatial.transform import Rotation

MASS, STIFFNESS, DAMPING, REST = 2.0, 50.0, 1.2, 0.1
FORCE, FREQUENCY, PHASE = 3.0, 4.0, 0.3
START, RATE = 0.05, -0.2
GRAVITY, ORIGIN = np.array([0.0, 0.0, -9.81]), np.array([0.1, 0.2, -0.3])
AXIS, COM, MARK = np.array([0.6, 0.0, 0.8]), np.array([0.02, -0.03, 0.01]), np.array([0.1, 0.05, 0.0])
MOUNTING = Rotation.from_rotvec(0.7 * np.array([1.0, -1.0, 0.5]) / 1.5)


def exact(times):
    """Motion of the mark, load of the guide, energies, and the linearised motion at `times` (s), World axes, SI."""
    axis = MOUNTING.apply(AXIS)
    rest = REST + MASS * GRAVITY @ axis / STIFFNESS
    response = FORCE / (STIFFNESS - MASS * FREQUENCY**2 + 1j * DAMPING * FREQUENCY)
    forced = response * np.exp(1j * (FREQUENCY * times + PHASE))  # its imaginary part
    root = -0.5 * DAMPING / MASS + 1j * np.sqrt(STIFFNESS / MASS - (0.5 * DAMPING / MASS) ** 2)
    x, v = START - rest - forced[0].imag, RATE - (1j * FREQUENCY * forced[0]).imag
    free = (x + 1j * (root.real * x - v) / root.imag) * np.exp(root * times)  # its real part
    place = rest + forced.imag + free.real
    speed = (1j * FREQUENCY * forced).imag + (root * free).real
    acceleration = -(FREQUENCY**2) * forced.imag + (root**2 * free).real
    force = MASS * (acceleration[:, None] * axis - GRAVITY)
    return {
        "marker:mark.position": ORIGIN + place[:, None] * axis + MOUNTING.apply(MARK),
        "marker:mark.velocity": speed[:, None] * axis,
        "load:guide.force": force,
        "load:guide.torque": np.cross(MOUNTING.apply(COM), force),
        "energy.kinetic": 0.5 * MASS * speed**2,
        "energy.spring": 0.5 * STIFFNESS * (place - REST) ** 2,
        "derivatives.by_displacement": np.full_like(times, -STIFFNESS / MASS),
        "derivatives.by_speed": np.full_like(times, -DAMPING / MASS),
        "derivatives.by_force": np.full_like(times, 1.0 / MASS),
        "frequencies": np.full_like(times, root.imag),
    }
