"""Crank, rod and collar: the measured angle of the crank is prescribed, the collar's speed is predicted.

Only kinematics: the masses do not matter. A table of the record's angles drives the crank, a quintic spline in time.
"""

from math import asin, cos, radians, sin

import flexmb as fm


def predict(points, inputs, effort):
    """Speeds (mm/s) of the collar."""
    records = {}
    for i, point in enumerate(points):
        records.setdefault(point.series, []).append(i)
    values = [0.0] * len(points)
    for rows in records.values():
        own = [points[i].conditions for i in rows]
        zero = 360.0 * (own[0]["wheel_angle_deg"] // 360.0)
        times = [c["time_s"] - own[0]["time_s"] for c in own]
        angles = [radians(c["wheel_angle_deg"] - zero + inputs["zero of the angle"]) for c in own]
        lengths = (inputs["crank"], inputs["offset"], inputs["rod"])
        for i, speed in zip(rows, collar_speeds(times, angles, lengths, effort), strict=True):
            values[i] = 1e3 * speed
    return values


def collar_speeds(times, angles, lengths, effort):
    """(T,) m/s."""
    r, d, l = (1e-3 * length for length in lengths)
    pin = (r * sin(angles[0]), r * cos(angles[0]))
    lean = asin((d - pin[0]) / l)
    scene = (
        fm.SceneBuilder("slider-crank")
        .rigid_body("disc", mass=1.0, inertia=(0.01,) * 3, nodes={"pin": (0.0, r, 0.0)})
        .rigid_body("rod", mass=0.05, com=(0.0, -l / 2, 0.0), inertia=(3e-4,) * 3, nodes={"end": (0.0, -l, 0.0)})
        .rigid_body("collar", mass=0.05, inertia=(1e-5,) * 3)
        .revolute(
            "axle", "ground", "disc", axis=(0.0, 0.0, -1.0),
            prescribed=fm.Table(times_s=tuple(times), values=tuple(angles)),
        )
        .revolute("pin", "disc", "rod", axis=(0.0, 0.0, 1.0), parent_node="pin", angle=lean + angles[0])
        .prismatic(
            "bar", "ground", "collar", axis=(0.0, 1.0, 0.0), parent_position=(d, 0.0, 0.0),
            position=pin[1] - l * cos(lean),
        )
        .closure("joint", "revolute", "rod", "collar", node_a="end")
        .scene()
    )  # fmt: skip
    run = fm.simulate(scene, times[-1], samples=times, rtol=(1e-5, 1e-8)[effort], atol=(1e-7, 1e-10)[effort])
    return run.u[:, [name for name, _ in run.u_names].index("bar.translation.rate")]
