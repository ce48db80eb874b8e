"""Spin of a free body about a principal axis."""

from __future__ import annotations

from crosscheck.stability.map import Axis, Measurement, Overlay, StabilityMap
from crosscheck.stability.spectrum import growth_rate
from flexmb.scene.build import SceneBuilder
from flexmb.scene.schema import Scene
from flexmb.system.compile import compile
from flexmb.typing import Real

SPIN = 1.0  # rad/s
NEUTRAL = 1e-7  # of the spin: neutral motions come out at rounding, or its square root


def scene(first: float, second: float) -> Scene:
    """A free body with moments of inertia `first`, `second`, 1 that spins about the third axis."""
    return (
        SceneBuilder("free body")
        .rigid_body("body", mass=1.0, inertia=(first, second, 1.0))
        .free("base", "ground", "body", angular_velocity=(0.0, 0.0, SPIN))
        .scene()
    )


def measure(scene: Scene, first: float, second: float) -> Measurement:
    """Growth rate over spin of disturbances of the two transverse rates."""
    system = compile(scene)
    start = system.nq + system.speed("base").start
    return Measurement(growth_rate(system, [start, start + 1]) / SPIN)


def intermediate(first: Real, second: Real) -> Real:
    """Positive where the third moment lies between the two others."""
    return -(1.0 - first) * (1.0 - second)


MAPS = (
    StabilityMap(
        name="free_spin",
        title="Spin of a free body about its third axis",
        quantity="growth rate over spin",
        scene=scene,
        measure=measure,
        x=Axis("first moment of inertia over the third", "", 0.55, 1.45, 9),
        y=Axis("second moment of inertia over the third", "", 0.55, 1.45, 9),
        thresholds=(NEUTRAL,),
        overlay=Overlay(
            "the third axis is the intermediate one", "Euler 1758: (I3 - I1)(I3 - I2) changes sign", intermediate
        ),
        shows="A free body spins steadily about its axes of largest and smallest inertia, not about the third.",
    ),
)
