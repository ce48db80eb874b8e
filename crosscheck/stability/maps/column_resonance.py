"""A column under a load that pulsates: parametric resonance of a flexible body."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.linalg import eigh

from crosscheck.stability.flow import growth_rate
from crosscheck.stability.map import Axis, Measurement, Overlay, StabilityMap, interpolated
from crosscheck.stability.maps.follower_force import LENGTH, MASS, STIFFNESS, matrices
from crosscheck.stability.spectrum import states_of
from flexmb.scene.build import SceneBuilder
from flexmb.scene.functions import Sine
from flexmb.scene.schema import BeamStation, Modes, Scene
from flexmb.system.compile import compile
from flexmb.typing import Real

MODES, ELEMENTS = 2, 12
DAMPING = 0.02  # time (s) by which stiffness is multiplied (Kelvin, Voigt)
STEPS = 100  # of RK4 in a period of the overlay: multipliers to 1e-7
NEUTRAL = 0.0


@cache
def elements() -> tuple[Real, Real, float]:
    """Of independent beam elements: squares (n,) of the lowest frequencies, the geometric stiffness (n,n) of a unit
    compression by their modes, and Euler's load (N)."""
    M, K, G, _ = matrices()
    squares, shapes = eigh(K, M)
    shapes = shapes[:, :MODES]
    buckling = 1.0 / np.max(eigh(G, K, eigvals_only=True))
    return squares[:MODES], shapes.T @ G @ shapes, float(buckling)


def drive(frequency: Real) -> Real:
    """rad/s of the load."""
    return np.asarray(frequency * np.sqrt(elements()[0][0]))


def scene(frequency: float, amplitude: float) -> Scene:
    """A clamped beam whose tip is pushed along World x by a sine; both parameters as on the axes."""
    section = BeamStation(
        x_m=0.0, EA_N=1e6, EIy_Nm2=STIFFNESS, EIz_Nm2=STIFFNESS, GJ_Nm2=1.0, mass_per_length_kg_m=MASS
    )
    load = Sine(amplitude=amplitude * elements()[2], angular_frequency_rad_s=float(drive(np.asarray(frequency))))
    return (
        SceneBuilder("column under a pulsating load")
        .beam(
            "beam",
            length=LENGTH,
            elements=ELEMENTS,
            section=section,
            level="stiffened",
            points="line",
            modes=Modes(count=MODES, families=("bending_y",), viscosity_s=DAMPING),
        )  # fmt: skip
        .weld("clamp", "ground", "beam")
        .force("push", "beam", node="tip", direction=(-1, 0, 0), function=load)
        .scene()
    )


def measure(scene: Scene, frequency: float, amplitude: float) -> Measurement:
    """Growth rate over the load's frequency, from the multipliers of one period (Floquet)."""
    system, rate = compile(scene), float(drive(np.asarray(frequency)))
    places = states_of(system, ["beam.modes"], ["beam.modes"])
    return Measurement(growth_rate(system, places, 2.0 * np.pi / rate) / rate)


def multipliers(frequency: Real, amplitude: Real) -> Real:
    """Floquet's multipliers (..., 2 n) of q'' + D q' + (squares - P(t) G) q = 0, the elements' equations by their own
    modes, from a period of the fundamental matrix by RK4."""
    squares, G, buckling = elements()
    rate, load = drive(np.asarray(frequency)), np.asarray(amplitude) * buckling
    still = np.zeros((2 * MODES, 2 * MODES))
    still[:MODES, MODES:] = np.eye(MODES)
    still[MODES:, :MODES], still[MODES:, MODES:] = -np.diag(squares), -DAMPING * np.diag(squares)
    pushed = np.zeros_like(still)
    pushed[MODES:, :MODES] = G
    step = (2.0 * np.pi / STEPS / rate)[..., None, None]
    X = np.broadcast_to(np.eye(2 * MODES), (*rate.shape, 2 * MODES, 2 * MODES)).copy()
    for number in range(STEPS):
        first, middle, last = (
            still + (load * np.sin(2.0 * np.pi * (number + part) / STEPS))[..., None, None] * pushed
            for part in (0.0, 0.5, 1.0)
        )
        k1 = first @ X
        k2 = middle @ (X + 0.5 * step * k1)
        k3 = middle @ (X + 0.5 * step * k2)
        X = X + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + last @ (X + step * k3))
    return np.linalg.eigvals(X)


def excess(frequency: Real, amplitude: Real) -> Real:
    """Positive where a multiplier is outside the unit circle."""
    return np.asarray(np.max(np.abs(multipliers(frequency, amplitude)), axis=-1) - 1.0)


FREQUENCY = Axis("frequency of the load over the column's", "", 1.2, 2.8, 16)
AMPLITUDE = Axis("amplitude of the load over Euler's", "", 0.05, 0.95, 9)
MAPS = (
    StabilityMap(
        name="column_resonance",
        title="A column under a pulsating load: parametric resonance",
        quantity="growth rate over frequency of the load",
        scene=scene,
        measure=measure,
        x=FREQUENCY,
        y=AMPLITUDE,
        thresholds=(NEUTRAL,),
        overlay=Overlay(
            "Floquet's multipliers of beam elements, by RK4",
            "Bolotin, The Dynamic Stability of Elastic Systems (1964): the principal region, with damping",
            interpolated(FREQUENCY, AMPLITUDE, excess),
        ),
        shows="A load far below Euler's shakes a column out of its straight shape at twice its frequency.",
        depth=2,
    ),
)
