"""Clamped composite strips under dead tip weights: equilibria of beams of level "exact" with their 6 x 6 sections.

The load is turned instead of the strip, and the displacement is turned back. The plots show magnitudes.
"""

from functools import cache
from math import cos, radians, sin

import numpy as np

import flexmb as fm

LENGTH, PLACE, G = 0.55, 0.5, 9.80665  # m, m, m/s2
# Stretch, two shears, twist, two curvatures, of laminate theory; inputs of measured.toml replace some.
DIAGONAL = {
    1: (3.7e6, 2.6e5, 2.9e5, 0.183, 0.707, 276.0),
    2: (4.0e6, 2.6e5, 5.5e5, 0.368, 0.522, 298.0),
    3: (3.9e6, 1.1e6, 1.2e5, 1.18, 0.983, 290.0),
}
STRETCH_SHEAR_2 = -2.7e5


def predict(points, inputs, effort):
    """Displacements (m) at 500 mm of the clamp."""
    cases = {}
    for point in points:
        strip = int(point.series.removeprefix("strip "))
        cases.setdefault((strip, point.conditions["roll_deg"]), set()).add(point.conditions["load_g"])
    known = {}
    for (strip, roll), grams in cases.items():
        own = tuple(value for name, value in inputs.items() if name.startswith(f"strip {strip}"))
        known[strip, roll] = displacements(strip, roll, tuple(sorted(grams)), own, effort)
    return [
        known[int(point.series.removeprefix("strip ")), point.conditions["roll_deg"]][point.conditions["load_g"]][
            int(point.conditions["component"]) - 1
        ]
        for point in points
    ]


@cache
def displacements(strip, roll, grams, own, effort):
    """Magnitudes (3,) by load in grams, along one path of equilibria."""
    stiffness = np.diag(DIAGONAL[strip])
    stiffness[3, 3], stiffness[4, 4] = own[:2]
    if strip == 2:
        stiffness[0, 1] = stiffness[1, 0] = STRETCH_SHEAR_2
        stiffness[3, 4] = stiffness[4, 3] = own[2]
    if strip == 3:
        stiffness[0, 3] = stiffness[3, 0] = own[2]
    station = fm.BeamStation(
        x_m=0.0, stiffness=stiffness.tolist(), inertia=np.diag([0.05] * 3 + [2e-6, 1e-6, 1e-6]).tolist()
    )
    count = 4 + effort
    strains = {"bending_y": count, "bending_z": count, "torsion": count, "axial": 2, "shear_y": 2, "shear_z": 2}
    a = radians(roll)
    scene = (
        fm.SceneBuilder("strip")
        .beam(
            "strip", length=LENGTH, elements=11, section=station, level="exact", theory="timoshenko",
            modes=fm.Modes(count=count, polynomials=strains), nodes=[fm.BeamNode(name="seen", x_m=PLACE)],
        )
        .weld("clamp", "ground", "strip")
        .force("weight", "strip", node="tip", direction=(0.0, -sin(a), -cos(a)), function=fm.Constant(value=1e-3))
        .marker("seen", "strip", node="seen")
        .scene()
    )  # fmt: skip
    back = np.array([[1.0, 0.0, 0.0], [0.0, cos(a), -sin(a)], [0.0, sin(a), cos(a)]])
    newtons = [1e-3 * G * load for load in grams]
    path = fm.equilibrium_path(scene, "weight.function.value", [1e-3 * newtons[0], *newtons])
    system = fm.compile(scene)
    moved = {}
    for load, newton in zip(grams, newtons, strict=True):
        state = path.at(newton)[0]
        place = system.evaluate(state.t, state.q, state.u).markers["seen"].position
        moved[load] = np.abs(back @ (place - (PLACE, 0.0, 0.0)))
    return moved
