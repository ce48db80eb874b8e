"""Spin rate against level for a beam clamped to a spinning hub: where each level becomes unstable."""

from __future__ import annotations

import numpy as np

from crosscheck.stability.map import Axis, Measurement, Overlay, StabilityMap
from crosscheck.stability.spectrum import growth_rate, states_of
from flexmb.scene.build import SceneBuilder
from flexmb.scene.functions import Ramp
from flexmb.scene.schema import BeamStation, Modes, Scene
from flexmb.system.compile import compile
from flexmb.typing import Real

LEVELS = ("ruthless", "linear", "full", "stiffened", "exact")
LENGTH, STIFFNESS, MASS = 8.0, 566.6, 0.2019  # m, N m^2, kg/m: beam K of Kane, Ryan and Banerjee (1987)
OMEGA_1 = 1.875104068711961**2 * np.sqrt(STIFFNESS / (MASS * LENGTH**4))  # rad/s, of the clamped beam
NEUTRAL = 1e-4  # of omega_1


def scene(spin: float, level: float) -> Scene:
    """The beam at a constant rate `spin` x omega_1; `level` is a number of `LEVELS`."""
    section = BeamStation(
        x_m=0.0, EA_N=5.03e6, EIy_Nm2=STIFFNESS, EIz_Nm2=STIFFNESS, GJ_Nm2=435.9, mass_per_length_kg_m=MASS
    )
    return (
        SceneBuilder("spinning beam")
        .beam(
            "beam", length=LENGTH, elements=8, section=section, modes=Modes(count=3, families=("bending_y",)),
            level=LEVELS[round(level)], points="line",
        )  # fmt: skip
        .revolute("hub", "ground", "beam", prescribed=Ramp(rate=spin * OMEGA_1))
        .scene()
    )


def measure(scene: Scene, spin: float, level: float) -> Measurement:
    """Growth rate over omega_1 of disturbances of the modes in the plane of rotation."""
    system = compile(scene)
    return Measurement(growth_rate(system, states_of(system, ["beam.modes"], ["beam.modes"])) / OMEGA_1)


def softening(spin: Real, level: Real) -> Real:
    """Positive where the centrifugal force (spin rate squared) exceeds the first mode's stiffness and acts on it."""
    acts = np.isin(np.round(level), [LEVELS.index("linear"), LEVELS.index("full")])
    return np.where(acts, spin - 1.0, -1.0)


MAPS = (
    StabilityMap(
        name="spinning_beam",
        title="Beam on a spinning hub, motion in the plane of rotation",
        quantity="growth rate over omega_1",
        scene=scene,
        measure=measure,
        x=Axis("spin rate over first clamped frequency", "", 0.0, 2.5, 21),
        y=Axis.of("level", *LEVELS),
        thresholds=(NEUTRAL,),
        overlay=Overlay(
            "spin rate = omega_1 without stiffening", "Kane, Ryan, Banerjee 1987; Wu, Haug 1988", softening
        ),
        shows="Levels linear and full lose a spinning beam at its first frequency; the others never do.",
    ),
)
