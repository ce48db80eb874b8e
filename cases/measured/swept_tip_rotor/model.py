"""A rotating strip with a swept tip: two beams of level "exact" welded at the sweep, frequencies by `fm.campbell`."""

from functools import cache
from math import cos, pi, radians, sin

import numpy as np

import flexmb as fm

INCH, POUND = 0.0254, 4.4482216152605
LENGTH, TIP, WIDTH = 31.5 * INCH, 6.0 * INCH, 1.0 * INCH
TWIST = 65.852  # (Iy + Iz) over the torsion constant, as both sources have it
PLACE = {"1F": 0, "3F": 3, "1T/5B": 4, "5B/1T": 5}  # in the order of frequencies


def predict(points, inputs, effort):
    """Frequencies (Hz)."""
    own = tuple(inputs[name] for name in ("thickness", "modulus", "root"))
    values = []
    for point in points:
        rpm, sweep = point.conditions["speed_rpm"], point.conditions["sweep_deg"]
        place = PLACE.get(point.series)
        if point.series == "2F":  # it changes places with the first one in the plane above some 650 rpm
            place = 1 if rpm < 750.0 else 2
        if point.series == "4B/1T":
            place = 6 if sweep < 20.0 else 7
        values.append(frequencies(sweep, *own, effort)[rpm][place])
    return values


@cache
def frequencies(sweep_deg, thickness, modulus, root, effort):
    """Rising frequencies (Hz) by speed in revolutions a minute."""
    E, h, b = modulus * POUND / INCH**2, thickness * INCH, WIDTH
    G, rho = E / (2.0 * 1.325), 2.51e-4 * POUND / INCH**4
    A, Iy, Iz = b * h, b * h**3 / 12.0, h * b**3 / 12.0
    station = fm.BeamStation(
        x_m=0.0, EA_N=E * A, EIy_Nm2=E * Iy, EIz_Nm2=E * Iz, GJ_Nm2=G * (Iy + Iz) / TWIST,
        mass_per_length_kg_m=rho * A, rotary_y_kg_m=rho * Iy, rotary_z_kg_m=rho * Iz,
    )  # fmt: skip
    families, half = ("bending_y", "bending_z", "torsion"), -0.5 * radians(sweep_deg)
    scene = (
        fm.SceneBuilder("swept tip")
        .rigid_body("hub", mass=1.0, inertia=(0.01, 0.01, 0.01))
        .beam(
            "base", length=LENGTH, elements=12, section=station, level="exact",
            modes=fm.Modes(count=6 + effort, families=families),
        )
        .beam(
            "tip", length=TIP, elements=6, section=station, level="exact",
            modes=fm.Modes(count=2 + effort, families=families),
        )
        .revolute("spin", "ground", "hub", axis=(0.0, 0.0, 1.0))
        .weld("root", "hub", "base", parent_position=(root * INCH, 0.0, 0.0))
        .weld("sweep", "base", "tip", parent_node="tip", parent_quaternion=(cos(half), 0.0, 0.0, sin(half)))
        .scene()
    )  # fmt: skip
    speeds = (0.0, 500.0, 750.0)
    rows = np.sort(np.array(fm.campbell(scene, "spin", [rpm * pi / 30.0 for rpm in speeds]).frequencies_hz), axis=1)
    return {rpm: row[row > 0.3] for rpm, row in zip(speeds, rows, strict=True)}
