"""Bricard's mechanism: two angles of its six joints in turn, theta and phi with cos(theta/2) cos(phi/2) = 1/2.

By this sides and hypotenuse of a spherical triangle with a right angle are theta/2, phi/2 and 60 degrees. With its
angle psi, tan(theta/2) = sqrt(3) cos(psi) and sin(phi/2) = sin(psi) sqrt(3)/2, and psi is the one coordinate. Energy
gives its rate; time is a quadrature over half a swing, of a periodic function, hence by its Fourier series.
"""

import numpy as np
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

MASS, GRAVITY = 1.0, 9.81
LINKS = np.array([[1.0, 0, 0], [0, -1.0, 0], [0, 0, 1.0], [-1.0, 0, 0], [0, 1.0, 0]])
AXES = np.array([[0, -1.0, 0], [0, 0, -1.0], [-1.0, 0, 0], [0, -1.0, 0], [0, 0, -1.0]])
ACROSS, ALONG = 1.0 / 12.0, 0.0  # moments of inertia of a bar
START = np.arccos(np.sqrt(1.0 / 3.0))  # theta = phi = 90 degrees
NODES = 256


def angles(psi):
    """theta and phi less their values at the start, and their derivatives by psi, (2, n) each."""
    root = np.sqrt(3.0)
    half = np.array([np.arctan(root * np.cos(psi)), np.arcsin(0.5 * root * np.sin(psi))])
    rates = np.array([-root * np.sin(psi) / (1.0 + 3.0 * np.cos(psi) ** 2), 0.5 * root * np.cos(psi) / np.cos(half[1])])
    return 2.0 * half - 0.5 * np.pi, 2.0 * rates


def bars(psi):
    """Of every bar where it begins, its rotation, and its velocities (angular, of the beginning) by psi."""
    turn, rate = angles(psi)
    R, place = Rotation.identity(len(psi)), np.zeros((len(psi), 3))
    omega, velocity = np.zeros_like(place), np.zeros_like(place)
    found = []
    for k, (axis, link) in enumerate(zip(AXES, LINKS, strict=True)):
        R = R * Rotation.from_rotvec(turn[k % 2][:, None] * axis)
        omega = omega + rate[k % 2][:, None] * R.apply(axis)
        found.append((place, R, omega, velocity))
        place, velocity = place + R.apply(link), velocity + np.cross(omega, R.apply(link))
    return found


def energies(psi):
    """Kinetic energy for unit rate of psi, and that of gravity."""
    kinetic, height = np.zeros_like(psi), np.zeros_like(psi)
    for link, (place, R, omega, velocity) in zip(LINKS, bars(psi), strict=True):
        arm = 0.5 * R.apply(link)
        v, along = velocity + np.cross(omega, arm), np.sum(omega * R.apply(link), axis=1)
        turning = ACROSS * (np.sum(omega**2, axis=1) - along**2) + ALONG * along**2
        kinetic += 0.5 * MASS * np.sum(v**2, axis=1) + 0.5 * turning
        height += (place + arm)[:, 1]
    return kinetic, MASS * GRAVITY * height


def gravity(psi):
    return float(energies(np.array([psi]))[1][0])


def swing():
    """Middle and amplitude of psi = middle - amplitude cos(u); mean, n and b_n of t(u) = mean u + sum b_n sin(n u)."""
    total = gravity(START)
    downhill = np.sign(gravity(START - 1e-3) - gravity(START + 1e-3))
    grid = START + downhill * np.linspace(1e-3, 2.0 * np.pi, 2000)
    level = energies(grid)[1] - total
    first = int(np.argmax(level > 0.0))
    end = brentq(lambda psi: gravity(psi) - total, grid[first - 1], grid[first], xtol=1e-15, rtol=1e-15)
    middle, amplitude = 0.5 * (START + end), 0.5 * (end - START)
    u = (np.arange(NODES) + 0.5) * np.pi / NODES
    kinetic, weight = energies(middle - amplitude * np.cos(u))
    rate = np.sqrt(kinetic / (total - weight)) * abs(amplitude) * np.sin(u)  # dt/du, even in u
    n = np.arange(1, NODES // 2)
    mean, terms = np.mean(rate), 2.0 * np.cos(np.outer(n, u)) @ rate / NODES / n
    return middle, amplitude, mean, n, terms


def exact(times):
    """Motion of two corners of the chain, and energies, at `times` (s), World axes, SI."""
    middle, amplitude, mean, n, terms = swing()
    u = times / mean
    for _ in range(50):
        waves = np.outer(u, n)
        u = u - (mean * u + np.sin(waves) @ terms - times) / (mean + np.cos(waves) @ (n * terms))
    psi = middle - amplitude * np.cos(u)
    rate = amplitude * np.sin(u) / (mean + np.cos(np.outer(u, n)) @ (n * terms))
    kinetic, weight = energies(psi)
    chain = bars(psi)
    found = {
        "energy.kinetic": (kinetic * rate**2)[:, None],
        "energy.gravity": weight[:, None],
        "energy.total": np.full((len(times), 1), gravity(START)),
    }
    for name, body in (("P2", 1), ("P3", 2)):
        place, R, omega, velocity = chain[body]
        end = R.apply(LINKS[body])
        found[f"marker:{name}.position"] = place + end
        found[f"marker:{name}.velocity"] = rate[:, None] * (velocity + np.cross(omega, end))
        found[f"marker:{name}.angular_velocity"] = rate[:, None] * omega
        found[f"marker:{name}.orientation"] = R.as_quat()[:, [3, 0, 1, 2]]
    return found
