"""Closed form: a bar that twists, clamped at one end and with a disc at the other, under a sine torque on the disc.

The twist is theta(x, t) = sum_n sin(b_n x/L) h_n (sin(W t) - (W/omega_n) sin(omega_n t)) / (omega_n^2 - W^2) with
b tan(b) = rho J_p L / J, omega_n = (b_n/L) sqrt(GJ/(rho J_p)) and h_n = T sin(b_n) / generalised inertia of mode n.
"""

import numpy as np
from scipy.optimize import brentq

LENGTH, STIFFNESS, INERTIA = 2.0, 8.0, 0.04  # m, N m^2, kg m: the section's moments 0.02 about both axes add up
DISC = 0.08  # kg m^2
TORQUE, DRIVE = 0.004, 9.0  # N m, rad/s
MODES = 4000  # amplitudes of the twist fall with the fourth power of the number, those of its rate with the third


def exact(times):
    """Orientation (T, 4) and angular velocity (T, 3) of disc and middle (rad/s), and the strain energy (T, 1) (J)."""
    root = _roots()
    omega = root / LENGTH * np.sqrt(STIFFNESS / INERTIA)
    inertia = INERTIA * LENGTH * (0.5 - np.sin(2.0 * root) / (4.0 * root)) + DISC * np.sin(root) ** 2
    amplitude = TORQUE * np.sin(root) / inertia / (omega**2 - DRIVE**2)
    ringing = np.outer(times, omega)
    twist = np.sin(DRIVE * np.asarray(times))[:, None] - DRIVE / omega * np.sin(ringing)
    rate = DRIVE * (np.cos(DRIVE * np.asarray(times))[:, None] - np.cos(ringing))
    channels = {}
    for name, place in {"disc": 1.0, "middle": 0.5}.items():
        shape = np.sin(root * place) * amplitude
        angle, zero = twist @ shape, np.zeros(len(times))
        channels[f"marker:{name}.orientation"] = np.column_stack([np.cos(angle / 2), np.sin(angle / 2), zero, zero])
        channels[f"marker:{name}.angular_velocity"] = np.column_stack([rate @ shape, zero, zero])
    channels["energy.strain"] = 0.5 * (twist * amplitude * omega) ** 2 @ inertia[:, None]
    return channels


def _roots():
    """b_n, where b sin(b) = (inertia of the bar / inertia of the disc) cos(b): one after every multiple of pi."""
    ratio = INERTIA * LENGTH / DISC
    starts = np.arange(MODES) * np.pi
    return np.array([brentq(lambda b: b * np.sin(b) - ratio * np.cos(b), s + 1e-9, s + 0.5 * np.pi) for s in starts])
