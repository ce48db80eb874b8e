"""Inverted pendulum on a hinge that vibrates up and down."""

from __future__ import annotations

import numpy as np
from scipy.special import mathieu_a, mathieu_b

from crosscheck.stability.flow import growth_rate
from crosscheck.stability.map import Axis, Measurement, Overlay, StabilityMap
from crosscheck.stability.spectrum import states_of
from flexmb.scene.build import SceneBuilder
from flexmb.scene.functions import Sine
from flexmb.scene.schema import Scene
from flexmb.system.compile import compile
from flexmb.typing import Real

GRAVITY, LENGTH = 9.81, 1.0
OMEGA_0 = np.sqrt(GRAVITY / LENGTH)
NEUTRAL = 1e-5  # of the drive's frequency: multipliers near 1 show the square root of rounding


def scene(frequency: float, amplitude: float) -> Scene:
    """A mass on a light rod, upright on a slide driven by a sine; both parameters as on the axes."""
    drive = Sine(amplitude=amplitude * LENGTH, angular_frequency_rad_s=frequency * OMEGA_0)
    return (
        SceneBuilder("pendulum on a vibrating hinge", gravity=(0.0, 0.0, -GRAVITY))
        .rigid_body("slide", mass=1.0, inertia=(1.0, 1.0, 1.0))
        .rigid_body("rod", mass=1.0, com=(0.0, 0.0, LENGTH), inertia=(1e-9, 1e-9, 1e-9))
        .prismatic("shaker", "ground", "slide", axis=(0, 0, 1), prescribed=drive)
        .revolute("pivot", "slide", "rod", axis=(0, 1, 0))
        .scene()
    )


def measure(scene: Scene, frequency: float, amplitude: float) -> Measurement:
    """Growth rate over the drive's frequency, from the multipliers of one period (Floquet)."""
    system = compile(scene)
    places = states_of(system, ["pivot"], ["pivot"])
    drive = frequency * OMEGA_0
    return Measurement(growth_rate(system, places, 2.0 * np.pi / drive) / drive)


def outside_mathieu(frequency: Real, amplitude: Real) -> Real:
    """Positive where x'' + (a - 2 q cos 2 tau) x = 0, a = -4 (omega_0/drive)^2, q = 2 amplitude/length, is unstable.

    It is stable between the characteristic values a_0(q) and b_1(q).
    """
    a, q = -4.0 / frequency**2, 2.0 * amplitude
    return np.asarray(np.maximum(mathieu_a(0, q) - a, a - mathieu_b(1, q)))


MAPS = (
    StabilityMap(
        name="vibrating_hinge",
        title="Inverted pendulum on a vibrating hinge",
        quantity="growth rate over drive frequency",
        scene=scene,
        measure=measure,
        x=Axis("drive frequency over the pendulum's", "", 3.0, 60.0, 18, log=True),
        y=Axis("amplitude over length", "", 0.01, 1.0, 14, log=True),
        thresholds=(NEUTRAL,),
        overlay=Overlay(
            "Mathieu's a_0 and b_1",
            "Stephenson 1908, Kapitza 1951: amplitude x frequency > sqrt(2 g l); exactly by Mathieu's functions",
            outside_mathieu,
        ),
        shows="An upright pendulum stands on a hinge that vibrates fast enough, and falls where it moves too far.",
    ),
)
