"""Two bodies that spin about their common axis, and move apart along it: a quarter of a swing of their reduced mass."""

import numpy as np

STAGE, STAGE_CENTRE, STAGE_INERTIA = 300.0, -0.4, 60.0
SATELLITE, SATELLITE_CENTRE, SATELLITE_INERTIA = 80.0, 0.3, 9.0
STIFFNESS, LENGTH, FREE = 2e4, 0.3, 0.4
RING, RELEASE, SPIN, SPEED = 1.2, 0.54, 0.6, 0.5
ORIGIN = np.array([0.1, -0.2, 0.3])
ALONG, Y, Z = np.array([0.28, 0.0, -0.96]), np.array([0.0, 1.0, 0.0]), np.array([0.96, 0.0, 0.28])
ANTENNA, CAMERA = np.array([-0.8, 0.6, 0.3]), np.array([0.5, -0.3, 0.4])


def exact(times):
    """Motion of both bodies, load of the clamp and the spring, energy and momentum at `times` (s), World axes, SI."""
    mass = STAGE + SATELLITE
    reduced = STAGE * SATELLITE / mass
    rate, stroke = np.sqrt(STIFFNESS / reduced), FREE - LENGTH
    is_free = times >= RELEASE - 1e-12
    passed = np.where(is_free, times - RELEASE, 0.0)
    pushed, out = np.minimum(passed, 0.5 * np.pi / rate), np.maximum(passed - 0.5 * np.pi / rate, 0.0)
    apart = stroke * (1.0 - np.cos(rate * pushed)) + stroke * rate * out
    speed = stroke * rate * np.sin(rate * pushed)
    force = STIFFNESS * stroke * np.cos(rate * pushed) * (out == 0.0)
    angle = SPIN * times
    y = np.cos(angle)[:, None] * Y + np.sin(angle)[:, None] * Z
    z = -np.sin(angle)[:, None] * Y + np.cos(angle)[:, None] * Z
    found = {}
    centre = STAGE * STAGE_CENTRE + SATELLITE * (RING + SATELLITE_CENTRE)
    for name, place, part, start in (
        ("antenna", ANTENNA, -SATELLITE / mass, 0.0), ("camera", CAMERA, STAGE / mass, RING),
        ("seat", np.array([0.9, 0.0, 0.0]), -SATELLITE / mass, 0.0), ("ring", np.zeros(3), STAGE / mass, RING),
    ):  # fmt: skip
        axial = start + place[0] + SPEED * times + part * apart
        arm = place[1] * y + place[2] * z
        found[f"marker:{name}.position"] = ORIGIN + axial[:, None] * ALONG + arm
        across = SPIN * np.cross(ALONG, arm)
        found[f"marker:{name}.velocity"] = (SPEED + part * speed)[:, None] * ALONG + across
        found[f"marker:{name}.angular_velocity"] = np.tile(SPIN * ALONG, (len(times), 1))
    spins = (STAGE_INERTIA + SATELLITE_INERTIA) * SPIN
    whole = mass * SPEED * ALONG
    return found | {
        "load:clamp.force": np.where(is_free, 0.0, -STIFFNESS * stroke)[:, None] * ALONG,
        "connector:spring.force": force[:, None] * ALONG,
        "energy.kinetic": 0.5 * (spins * SPIN + mass * SPEED**2 + reduced * speed**2),
        "energy.spring": 0.5 * force**2 / STIFFNESS,
        "momentum.linear": np.tile(whole, (len(times), 1)),
        "momentum.angular": np.tile(spins * ALONG + np.cross(ORIGIN + centre / mass * ALONG, whole), (len(times), 1)),
    }
