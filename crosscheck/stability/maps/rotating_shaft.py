"""Rotating shaft with internal damping, which destabilises it above its critical speed."""

from __future__ import annotations

import numpy as np

from crosscheck.stability.flow import growth_rate
from crosscheck.stability.map import Axis, Measurement, Overlay, StabilityMap
from flexmb.scene.build import SceneBuilder, angular, linear
from flexmb.scene.functions import Ramp
from flexmb.scene.schema import Scene
from flexmb.system.compile import compile
from flexmb.typing import Real

MASS, OMEGA = 1.0, 1.0  # kg, rad/s: the disc and its critical speed
INTERNAL = 0.02  # N s/m
ANCHOR = 1e9  # kg: represents the ground beyond the disc, with a relative error of 1e-9
NEUTRAL = 1e-7  # of the critical speed


def scene(speed: float, ratio: float) -> Scene:
    """A disc on a shaft that bends in rotating axes, with damping there, and `ratio` x that damping in fixed axes.

    The shaft's end turns at `speed` x the critical one and carries the disc on springs and dampers. The disc does not
    turn; dampers in fixed axes join it to a mass that represents the ground.
    """
    shaft = linear(stiffness=MASS * OMEGA**2, damping=INTERNAL)
    air = linear(damping=ratio * INTERNAL)
    rate = speed * OMEGA
    return (
        SceneBuilder("shaft with internal damping")
        .rigid_body("shaft", mass=1.0, inertia=(1.0, 1.0, 1.0))
        .rigid_body("disc", mass=MASS, inertia=(1.0, 1.0, 1.0))
        .rigid_body("surroundings", mass=ANCHOR, inertia=(1.0, 1.0, 1.0))
        .revolute("drive", "ground", "shaft", prescribed=Ramp(rate=rate))
        .planar("bending", "shaft", "disc", x=shaft, y=shaft, rotation=angular(prescribed=Ramp(rate=-rate)))
        .planar("drag", "disc", "surroundings", x=air, y=air, rotation=angular(prescribed=Ramp(rate=0.0)))
        .scene()
    )


def measure(scene: Scene, speed: float, ratio: float) -> Measurement:
    """Growth rate over critical speed, in one turn, of disturbances of the disc and of the speed of the surroundings.

    Turning and fixed axes are mixed, so the coefficients repeat with every turn (Floquet).
    """
    system = compile(scene)
    q, u = system.coordinate("bending").start, system.nq + system.speed("bending").start
    drag = system.nq + system.speed("drag").start
    return Measurement(growth_rate(system, [q, q + 1, u, u + 1, drag, drag + 1], 2.0 * np.pi / (speed * OMEGA)) / OMEGA)


def excess(speed: Real, ratio: Real) -> Real:
    """Positive above the speed at which both dampings balance for the whirl at the critical speed."""
    return np.asarray(speed - (1.0 + ratio))


MAPS = (
    StabilityMap(
        name="rotating_shaft",
        title="Rotating shaft with internal damping",
        quantity="growth rate over critical speed",
        scene=scene,
        measure=measure,
        x=Axis("speed over critical speed", "", 0.2, 4.0, 10),
        y=Axis("external over internal damping", "", 0.0, 2.6, 9),
        thresholds=(NEUTRAL,),
        overlay=Overlay(
            "speed = critical x (1 + external/internal damping)",
            "Kimball 1924; Smith 1933; Genta, Dynamics of Rotating Systems, 2.3",
            excess,
        ),
        shows="Damping inside a shaft destabilises it above its critical speed, unless damping outside makes up.",
    ),
)
