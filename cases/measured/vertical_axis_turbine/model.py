"""The Sandia 34 m turbine: tower, two bowed blades of straight pieces, four struts, closed in seven places.

Each blade is a chain of beams of level "exact" from the foot to the top of the tower; its top runs in a bearing.
"""

from functools import cache
from math import pi

import numpy as np

import flexmb as fm

HEIGHT, G, FEET = 41.9, 9.81, 1.257
TOWER = {
    "EA_N": 8.4404e9, "GJ_Nm2": 7.0428e9, "EIy_Nm2": 9.4072e9, "EIz_Nm2": 9.4072e9, "mass_per_length_kg_m": 330.755,
    "rotary_y_kg_m": 368.641, "rotary_z_kg_m": 368.641,
}  # fmt: skip
# Up to a height (m): EA (N), GJ, EI flatwise and lead-lag (Nm2), mass a metre (kg/m), its rotary inertias (kg m).
SECTIONS = (
    (5.8, 3.74563e9, 1.87992e7, 2.24336e7, 4.09242e8, 146.781, 0.879, 15.9),
    (11.1, 2.22783e9, 6.55493e6, 7.35548e6, 1.84227e8, 87.3025, 0.288, 7.188),
    (29.0, 1.76888e9, 4.00804e6, 4.34302e6, 1.09341e8, 69.3173, 0.170, 4.273),
)
HEIGHTS = (
    0, 1.257, 2.095, 4.19, 6.285, 8.38, 10.475, 12.57, 14.665, 16.76, 18.855, 20.95, 23.045, 25.14, 27.235, 29.33,
    31.425, 33.52, 35.615, 37.71, 39.805, 40.643, 41.9,
)  # fmt: skip
RADII = (
    0, 2.26837, 3.63183, 6.76113, 9.55882, 11.8976, 13.7306, 15.1409, 16.1228, 16.7334, 17.0133, 17.0987, 16.9615,
    16.5139, 15.7435, 14.5458, 12.9287, 10.8901, 8.547, 5.93739, 3.05842, 1.87486, 0.0,
)  # fmt: skip
ENDS = (0, 1.257, 3.4, 5.8, 8.4, 11.1, 15.6, 20.05, 24.5, 29.0, 31.8, 34.7, 37.7, 40.643, 41.9)  # of the pieces
BENDING = ("bending_y", "bending_z", "torsion")


def predict(points, inputs, effort):
    """Mean frequency (Hz) of the first flatwise pair, of which the readings are one or the other."""
    speeds = tuple(sorted({point.conditions["speed_rpm"] for point in points}))
    known = first_pair(inputs["flatwise stiffness"], inputs["mass"], speeds, effort)
    return [known[point.conditions["speed_rpm"]] for point in points]


def station(z, stiffness, mass):
    """The section at a height."""
    z = min(z, HEIGHT - z) if z > 34.7 or z < 11.1 else z
    row = next((row for row in SECTIONS if z < row[0]), SECTIONS[-1])
    _, EA, GJ, flat, lag, m, rotary_flat, rotary_lag = row
    return fm.BeamStation(
        x_m=0.0, EA_N=EA, GJ_Nm2=GJ, EIy_Nm2=stiffness * flat, EIz_Nm2=lag, mass_per_length_kg_m=mass * m,
        rotary_y_kg_m=mass * rotary_flat, rotary_z_kg_m=mass * rotary_lag,
    )  # fmt: skip


def quaternion(R):
    """The quaternion of a rotation by less than half a turn."""
    w = np.sqrt(max(0.0, 1.0 + np.trace(R))) / 2
    q = np.array([w, *(np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / (4 * w))])
    return q / np.linalg.norm(q)


@cache
def first_pair(stiffness, mass, speeds, effort):
    """By speed (rpm), Hz."""
    path = fm.campbell(turbine(stiffness, mass, 1 + effort), "spin", [rpm * pi / 30 for rpm in speeds])
    return {
        rpm: float(np.mean(np.sort(row[row > 0.05])[:2]))
        for rpm, row in zip(speeds, np.array(path.frequencies_hz), strict=True)
    }


def turbine(stiffness, mass, count):
    """The scene; `count` polynomials of each curvature in each piece."""
    modes = fm.Modes(count=count, families=BENDING)
    z = np.array(ENDS)
    b = fm.SceneBuilder(
        "vertical-axis turbine",
        gravity=(0, 0, -G),
        allow=("many_elements", "thick_section", "wave_speed", "shear_stiffness"),
    )
    b.rigid_body("base", mass=10.0, inertia=(1.0,) * 3).revolute("spin", "ground", "base", axis=(0, 0, 1))
    up = np.array([[0, 0, -1.0], [0, 1, 0], [1, 0, 0]])  # the tower's x points up
    b.beam(
        "tower", length=HEIGHT, elements=12, section=fm.BeamStation(x_m=0.0, **TOWER), level="exact",
        modes=fm.Modes(count=4 + count, families=BENDING), nodes={"low": FEET, "high": HEIGHT - FEET},
    )  # fmt: skip
    b.weld("foot", "base", "tower", parent_quaternion=quaternion(up))
    b.closure(
        "bearing", "revolute", "ground", "tower", node_b="tip", position_a=(0, 0, HEIGHT),
        quaternion_b=quaternion(up.T), axis=(0, 0, 1),
    )  # fmt: skip
    for side, sign in (("left", -1.0), ("right", 1.0)):
        p = np.column_stack([sign * np.interp(z, HEIGHTS, RADII), 0 * z, z])
        frames, name = [], ""
        for i, (here, there) in enumerate(zip(p[:-1], p[1:], strict=True)):
            length = np.linalg.norm(there - here)
            along = (there - here) / length
            frames.append(np.column_stack([along, [0, 1, 0], np.cross(along, [0, 1, 0])]))
            before, name = name, f"{side} {i}"
            own = station(0.5 * (here[2] + there[2]), stiffness, mass)
            b.beam(name, length=length, elements=3, section=own, level="exact", modes=modes)
            if before:
                b.weld(
                    f"to {name}",
                    before,
                    name,
                    parent_node="tip",
                    parent_quaternion=quaternion(frames[-2].T @ frames[-1]),
                )
            else:
                b.weld(f"to {name}", "base", name, parent_quaternion=quaternion(frames[0]))
        for node, height in (("low", FEET), ("high", HEIGHT - FEET)):
            i = int(np.argmin(abs(z - height))) - 1  # the piece that ends at the strut
            out = np.array([sign, 0.0, 0.0])
            frame, strut = np.column_stack([out, [0, 1, 0], np.cross(out, [0, 1, 0])]), f"strut {side} {node}"
            own = station(0.5, stiffness, mass)
            b.beam(strut, length=abs(p[i + 1][0]), elements=3, section=own, level="exact", modes=modes)
            b.weld(f"to {strut}", "tower", strut, parent_node=node, parent_quaternion=quaternion(up.T @ frame))
            b.closure(
                f"end of {strut}", "weld", strut, f"{side} {i}", node_a="tip", node_b="tip",
                quaternion_a=quaternion(frame.T @ frames[i]),
            )  # fmt: skip
        b.closure(
            f"top {side}", "weld", "tower", name, node_a="tip", node_b="tip", quaternion_a=quaternion(up.T @ frames[-1])
        )
    return b.scene()
