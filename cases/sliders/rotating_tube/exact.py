"""A sprung mass in a tube that turns uniformly: r'' = (W^2 - k/m) r + k r0/m."""

import numpy as np

MASS, STIFFNESS, REST, TURNING = 0.8, 1.5, 0.2, 2.0
START, RATE, ASIDE, HEIGHT, MARK = 0.1, 0.05, 0.15, 0.1, np.array([0.0, 0.03, 0.02])


def exact(times):
    """Motion of the mark, force in the bore, drive and energy at `times` (s), World axes, SI."""
    growth = np.sqrt(TURNING**2 - STIFFNESS / MASS)
    rest = -STIFFNESS * REST / (MASS * growth**2)
    r = rest + (START - rest) * np.cosh(growth * times) + RATE / growth * np.sinh(growth * times)
    v = growth * (START - rest) * np.sinh(growth * times) + RATE * np.cosh(growth * times)
    a = growth**2 * (r - rest)
    turned = np.exp(1j * TURNING * times)
    z, mark = (r + 1j * ASIDE) * turned, (r + 1j * (ASIDE + MARK[1])) * turned
    dz, dmark = v * turned + 1j * TURNING * z, v * turned + 1j * TURNING * mark
    ddz = a * turned + 2j * TURNING * v * turned - TURNING**2 * z
    inertia = 0.3 + 3.0 * 0.2**2 + 0.003
    return {
        "marker:slug.position": plane(mark, HEIGHT + MARK[2]),
        "marker:slug.velocity": plane(dmark, 0.0),
        "load:bore.force": MASS * plane(ddz, 9.81),
        "drive:motor": MASS * (np.conj(z) * ddz).imag,
        "energy.kinetic": 0.5 * MASS * np.abs(dz) ** 2 + 0.5 * inertia * TURNING**2,
        "energy.spring": 0.5 * STIFFNESS * (r - REST) ** 2,
    }


def plane(z, height):
    return np.stack([z.real, z.imag, np.full(len(z), height)], axis=1)
