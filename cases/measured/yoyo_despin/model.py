"""Yo-yo despin with radial release: cords unwind without slip from the rim, swing out about their roots, and leave.

While it unwinds a cord is a reel that turns about the hub's axis and a slide along the tangent, coupled by the radius.
Then balls swing on massless rods hinged at the rim until they are radial. The hub keeps its speed when they leave.
"""

from functools import cache
from math import cos, pi, sin

import flexmb as fm

INCH, RPM = 0.0254, pi / 30.0
RADIUS = {"rig A": 4.25 * INCH, "rig B": 3.0 * INCH}
BALL = {"rig A": 0.125, "rig B": 0.054}  # kg
LIGHT = (1e-12,) * 3
SIDES = (("1", 0.0), ("2", pi))


def predict(points, inputs, effort):
    """Speeds (rpm) after the release."""
    return [
        despin(
            point.series, inputs[f"inertia, {point.series}"], (point.conditions["cord_in"] + inputs["cord"]) * INCH,
            point.conditions["speed_before_rpm"] * RPM, effort,
        ) / RPM
        for point in points
    ]  # fmt: skip


def hub(name, inertia, rate):
    """A builder with the hub on its bearing."""
    builder = fm.SceneBuilder(name).rigid_body("hub", mass=3.0, inertia=(inertia,) * 3)
    return builder.revolute("spin", "ground", "hub", axis=(0.0, 0.0, 1.0), rate=rate)


@cache
def despin(rig, inertia, cord, rate, effort):
    """Speed (rad/s) at which both balls leave."""
    R, m, begun = RADIUS[rig], BALL[rig], 1e-3
    settings = {"rtol": (1e-7, 1e-10)[effort], "atol": (1e-9, 1e-12)[effort]}
    builder = hub("unwinding", inertia, rate)
    for side, a in SIDES:
        turned = (cos(a / 2), 0.0, 0.0, sin(a / 2))
        builder.rigid_body(f"reel {side}", mass=1e-7, inertia=LIGHT).rigid_body(f"ball {side}", mass=m, inertia=LIGHT)
        builder.revolute(
            f"turn {side}",
            "hub",
            f"reel {side}",
            axis=(0.0, 0.0, 1.0),
            parent_quaternion=turned,
            angle=begun / R,
            rate=rate,
        )
        builder.prismatic(
            f"cord {side}", f"reel {side}", f"ball {side}", axis=(0.0, -1.0, 0.0), parent_position=(R, 0.0, 0.0),
            position=begun, rate=R * rate,
        )  # fmt: skip
        builder.coupling(f"unwind {side}", f"cord {side}", {f"turn {side}": R})
    builder.event("unwound", "cord 1.translation", cord, fm.EndRun(), crossing="rising")
    end = fm.simulate(builder.scene(), 2.0, samples=2, **settings)
    rates = dict(zip((name for name, _ in end.u_names), end.last_state.u, strict=True))
    builder = hub("swinging", inertia, rates["spin.rotation.rate"])
    for side, a in SIDES:
        builder.rigid_body(f"ball {side}", mass=m, com=(cord, 0.0, 0.0), inertia=LIGHT)
        builder.revolute(
            f"swing {side}", "hub", f"ball {side}", axis=(0.0, 0.0, 1.0), parent_position=(R * cos(a), R * sin(a), 0.0),
            parent_quaternion=(cos(a / 2), 0.0, 0.0, sin(a / 2)), angle=-pi / 2, rate=rates["turn 1.rotation.rate"],
        )  # fmt: skip
    builder.event("radial", "swing 1.rotation", 0.0, fm.EndRun(), crossing="rising")
    end = fm.simulate(builder.scene(), 3.0, samples=2, **settings)
    return dict(zip((name for name, _ in end.u_names), end.last_state.u, strict=True))["spin.rotation.rate"]
