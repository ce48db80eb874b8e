"""The GARTEUR SM-AG19 test structure: free-free frequencies of a tree of beams and rigid parts.

Axes: x forward, y to the left, z up. The joint of wing and fuselage is rigid, and so are the drums.
"""

from functools import cache
from math import cos, pi, radians, sin

import numpy as np

import flexmb as fm

NU, LAYER_DENSITY = 0.31, 1000.0
LAYER_WIDTH, LAYER_THICKNESS = 0.0762, 0.0011  # of the plate, and of the viscoelastic strip below it
CORE, ROOT = 0.1, 0.025  # pieces of fuselage and wing that are rigid


def predict(points, inputs, effort):
    """Frequencies (Hz) in rising order."""
    own = tuple(inputs[name] for name in ("modulus", "density", "wing thickness", "share of the layer"))
    return [
        frequencies(int(point.conditions["configuration"]), *own, effort)[int(point.conditions["mode"]) - 1]
        for point in points
    ]


def section(along_y, along_z, E, rho):
    """Numbers of a rectangular section with sides along y and z (m)."""
    A, Iy, Iz, G = along_y * along_z, along_y * along_z**3 / 12, along_z * along_y**3 / 12, E / (2 * (1 + NU))
    short, long = min(along_y, along_z), max(along_y, along_z)
    J = long * short**3 * (1 / 3 - 0.21 * short / long * (1 - short**4 / (12 * long**4)))
    return {
        "EA_N": E * A, "EIy_Nm2": E * Iy, "EIz_Nm2": E * Iz, "GJ_Nm2": G * J, "mass_per_length_kg_m": rho * A,
        "rotary_y_kg_m": rho * Iy, "rotary_z_kg_m": rho * Iz,
    }  # fmt: skip


def box(mass, a, b, c):
    """Inertia of a box of sides a, b, c."""
    return np.diag([mass * (b**2 + c**2), mass * (a**2 + c**2), mass * (a**2 + b**2)]) / 12


def about(axis, degrees):
    """The quaternion of a turn."""
    half = radians(degrees) / 2
    return (cos(half), *(sin(half) * np.array(axis, float)))


def on_fin(side):
    """Axes of half of the tailplane in those of the fin, whose x points up: its x outwards, its z up."""
    R = np.column_stack([[0.0, side, 0.0], [0.0, 0.0, side], [1.0, 0.0, 0.0]])
    w = 0.5 * np.sqrt(max(1.0 + np.trace(R), 0.0))
    if w > 1e-3:
        return (w, *(np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / (4 * w)))
    return (0.0, *np.linalg.eigh(R)[1][:, -1])


@cache
def frequencies(configuration, modulus, density, thickness, share, effort):
    """Rising elastic frequencies (Hz) of the replica (0), the original (1), and with 0.724 kg at the left tip (2)."""
    more = 4 * effort
    wing = section(0.1, thickness, modulus, density)
    inner = dict(wing)
    left, right = ((0.0, 0.0), (0.15, 0.15), (0.724, 0.15))[configuration]
    if configuration:  # the plate on its viscoelastic strip: its mass, and a share of the stiffness of a bonded one
        inner["mass_per_length_kg_m"] += LAYER_WIDTH * LAYER_THICKNESS * (density + LAYER_DENSITY)
        plate = modulus * LAYER_WIDTH * LAYER_THICKNESS
        arm = thickness / 2 + 1.5 * LAYER_THICKNESS
        inner["EIy_Nm2"] += share * plate * wing["EA_N"] / (plate + wing["EA_N"]) * arm**2
    fuselage = fm.BeamStation(x_m=0.0, **section(0.05, 0.15, modulus, density))
    ends = ((0.0, inner), (0.85 - ROOT, inner), (0.8501 - ROOT, wing), (1.0 - ROOT, wing))
    b = fm.SceneBuilder("GARTEUR SM-AG19", allow=("many_elements",))
    mass = density * 0.15 * 0.05 * CORE
    b.rigid_body("core", mass=mass, inertia=box(mass, CORE, 0.05, 0.15)).free("free", "ground", "core")
    modes = fm.Modes(count=8 + more)
    b.beam("front", length=0.6 - CORE / 2, elements=6, section=fuselage, modes=modes, level="linear")
    b.weld("to front", "core", "front", parent_position=(CORE / 2, 0, 0))
    b.beam(
        "rear", length=0.9 - CORE / 2, elements=8, section=fuselage, modes=modes, level="linear",
        nodes=[fm.BeamNode(name="fin", x_m=0.8 - CORE / 2)],
    )  # fmt: skip
    b.weld("to rear", "core", "rear", parent_position=(-CORE / 2, 0, 0), parent_quaternion=about((0, 0, 1), 180))
    for side, sign, tip in (("left", 1, left), ("right", -1, right)):
        b.beam(
            side, length=1.0 - ROOT, elements=16, section=[fm.BeamStation(x_m=x, **numbers) for x, numbers in ends],
            modes=fm.Modes(count=12 + more), level="linear", nodes=[fm.BeamNode(name="drum", x_m=0.95 - ROOT)],
        )  # fmt: skip
        b.weld(
            f"wing {side}", "core", side, parent_position=(0, sign * ROOT, 0.0805),
            parent_quaternion=about((0, 0, 1), 90 * sign),
        )  # fmt: skip
        drum = density * 0.4 * 0.1 * 0.01
        b.rigid_body(f"drum {side}", mass=drum, inertia=box(drum, 0.4, 0.1, 0.01))
        b.weld(
            f"to drum {side}", side, f"drum {side}", parent_node="drum", parent_position=(0, 0, 0.0105),
            parent_quaternion=about((0, 0, 1), -90 * sign),
        )  # fmt: skip
        if tip:
            b.rigid_body(f"mass {side}", mass=tip, inertia=np.eye(3) * 1e-5)
            b.weld(
                f"to mass {side}", f"drum {side}", f"mass {side}",
                parent_position=(0.18, 0.03 if side == "right" else -0.03, 0.005),
            )  # fmt: skip
    thin = fm.BeamStation(x_m=0.0, **section(0.01, 0.1, modulus, density))
    b.beam("fin", length=0.305, elements=6, section=thin, modes=modes, level="linear")
    b.weld(
        "to fin",
        "rear",
        "fin",
        parent_node="fin",
        parent_position=(0, 0, 0.075),
        parent_quaternion=about((0, 1, 0), -90),
    )
    flat = fm.BeamStation(x_m=0.0, **section(0.1, 0.01, modulus, density))
    for side, sign in (("left", 1), ("right", -1)):
        b.beam(f"tail {side}", length=0.2, elements=4, section=flat, modes=fm.Modes(count=6), level="linear")
        b.weld(f"to tail {side}", "fin", f"tail {side}", parent_node="tip", parent_quaternion=on_fin(sign))
    omega = np.sort(np.abs(np.array(fm.linearize(fm.compile(b.scene())).eigenvalues).imag))
    return (omega[omega > pi] / (2 * pi))[::2]  # eigenvalues come in pairs; six are of the motion as a rigid body
