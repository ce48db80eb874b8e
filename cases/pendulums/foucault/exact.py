"""A mass on isotropic springs that turn with a table: linear in World, m z'' = -k (z - c exp(i W t)), z = x + i y."""

import numpy as np

MASS, STIFFNESS, TURNING, CENTRE, HEIGHT, RELEASE = 1.5, 6.0, 0.5, 0.4 + 0.1j, 0.2, 0.3
MARKER = 0.05


def exact(times):
    """Motion of the marker on the bob, and the table's drive, at `times` (s), World axes, SI."""
    w, turned = np.sqrt(STIFFNESS / MASS), np.exp(1j * TURNING * times)
    carried = CENTRE * w**2 / (w**2 - TURNING**2)  # what follows the table
    start, speed = CENTRE + RELEASE - carried, 1j * TURNING * (CENTRE + RELEASE - carried)
    z = carried * turned + start * np.cos(w * times) + speed / w * np.sin(w * times)
    dz = 1j * TURNING * carried * turned - w * start * np.sin(w * times) + speed * np.cos(w * times)
    ddz = -(w**2) * (z - CENTRE * turned)
    offset = MARKER * turned
    return {
        "marker:tip.position": plane(z + offset, HEIGHT),
        "marker:tip.velocity": plane(dz + 1j * TURNING * offset, 0.0),
        "marker:tip.angular_velocity": np.tile([0.0, 0.0, TURNING], (len(times), 1)),
        "drive:turntable": MASS * np.imag(np.conj(z) * ddz),
    }


def plane(z, height):
    return np.stack([z.real, z.imag, np.full(len(z), height)], axis=1)
