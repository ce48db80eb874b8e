"""Dual spin with energy dissipation: a body with nutation dampers carries a wheel."""

from __future__ import annotations

import numpy as np

from crosscheck.stability.map import Axis, Measurement, Overlay, StabilityMap
from crosscheck.stability.spectrum import growth_rate
from flexmb.scene.build import SceneBuilder, linear
from flexmb.scene.schema import Scene
from flexmb.system.compile import compile
from flexmb.typing import Real

SPIN, TRANSVERSE = 1.0, 1.0  # rad/s, kg m^2
MASS, ARM = 1e-3, 0.5  # kg, m of each of four dampers
STIFFNESS, DAMPING = MASS * 2.0**2, MASS * 1.0  # N/m, N s/m: tuned to 2 rad/s
WHEEL = 0.1  # kg m^2
NEUTRAL = 1e-10  # of the spin; dampers of a thousandth of the inertia make growth rates of 1e-5 to 1e-4


def scene(inertia: float, momentum: float) -> Scene:
    """A gyroscope on a spherical hinge with four dampers in its plane, which move along the axis, and a wheel on it.

    `inertia` is the axial inertia of the body over the transverse inertia of the whole; `momentum` is the wheel's
    momentum over the transverse inertia times the body's spin.
    """
    dampers = 4.0 * MASS * ARM**2
    rate = momentum * TRANSVERSE * SPIN / WHEEL
    axial, transverse = inertia * TRANSVERSE - WHEEL - dampers, TRANSVERSE - 0.5 * WHEEL - 0.5 * dampers
    builder = (
        SceneBuilder("dual spin")
        .rigid_body("body", mass=1.0, inertia=(transverse, transverse, axial))
        .spherical("centre", "ground", "body", angular_velocity=(0.0, 0.0, SPIN))
        .wheel(
            "wheel", "body", axis=(0, 0, 1), mass=1.0, axial_inertia=WHEEL, transverse_inertia=0.5 * WHEEL,
            speed=rate,
        )  # fmt: skip
    )
    for n, (x, y) in enumerate(((ARM, 0.0), (0.0, ARM), (-ARM, 0.0), (0.0, -ARM))):
        builder.point_mass(
            f"damper {n}", "body", offset=(x, y, 0.0), mass=MASS, directions=((0, 0, 1),),
            coordinates=(linear(stiffness=STIFFNESS, damping=DAMPING),),
        )  # fmt: skip
    return builder.scene()


def measure(scene: Scene, inertia: float, momentum: float) -> Measurement:
    """Growth rate over spin of disturbances of the transverse rates and of the dampers."""
    system = compile(scene)
    start = system.nq + system.speed("centre").start
    places = [start, start + 1]
    for mass in scene.point_masses:
        places += [system.coordinate(mass.name).start, system.nq + system.speed(mass.name).start]
    return Measurement(growth_rate(system, places) / SPIN)


def energy_sink(inertia: Real, momentum: Real) -> Real:
    """Positive where nutation grows: where, as the damped body sees it, nutation turns against the body's spin."""
    return np.asarray(1.0 - inertia - momentum)


MAPS = (
    StabilityMap(
        name="dual_spin",
        title="Dual spin: a body with nutation dampers and a wheel",
        quantity="growth rate over spin",
        scene=scene,
        measure=measure,
        x=Axis("axial inertia of the damped body over the transverse one", "", 0.4, 1.6, 9),
        y=Axis("wheel momentum over transverse inertia x spin", "", -0.35, 0.95, 9),
        thresholds=(NEUTRAL,),
        overlay=Overlay(
            "energy sink on one body: inertia ratio + wheel momentum = 1",
            "Landon, Stewart 1964; Iorillo 1965; Likins 1967",
            energy_sink,
        ),
        shows="Dissipation drives a prolate body from its spin; a wheel of enough momentum holds it (dual spin).",
    ),
)
