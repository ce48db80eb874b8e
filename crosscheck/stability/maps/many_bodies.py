"""Number of bodies in a chain: round-off of the accelerations by each algorithm."""

from __future__ import annotations

import numpy as np

from crosscheck.stability.map import Axis, Measurement, Overlay, StabilityMap, digit_kinds
from flexmb.scene.build import SceneBuilder
from flexmb.scene.schema import Scene
from flexmb.system.algorithm import Algorithm
from flexmb.system.compile import compile
from flexmb.typing import Real

ALGORITHMS: tuple[Algorithm, ...] = ("articulated", "composite", "frisch")
MOST = {"articulated": 20_000, "composite": 1_500, "frisch": 150}  # within a minute for each cell
ROUNDING = 2.0**-53
PRODUCTS = 2 * 36  # of a body in a sweep: six products of six terms, in both routes
LEVELS = (-15.0, -14.0, -13.0, -12.0)


def count(bodies: float) -> int:
    """Whole bodies."""
    return round(bodies)


def scene(bodies: float, algorithm: float) -> Scene:
    """A chain of equal bodies on hinges about two axes in turn, moving under gravity."""
    builder = SceneBuilder("chain", gravity=(0.0, 0.0, -9.81))
    if bodies > MOST[ALGORITHMS[round(algorithm)]]:
        bodies = 1.0  # `measure` does not use the scene then
    rng = np.random.default_rng(3)
    for k in range(count(bodies)):
        builder.rigid_body(f"b{k}", mass=1.0, com=(0.5, 0.02, 0.01), inertia=(0.01, 0.09, 0.09))
        builder.revolute(
            f"h{k}", "ground" if k == 0 else f"b{k - 1}", f"b{k}", axis=(0, 1, 0) if k % 2 else (0, 0, 1),
            angle=float(rng.uniform(-0.3, 0.3)), rate=float(rng.normal()),
            parent_position=(0.0, 0.0, 0.0) if k == 0 else (1.0, 0.0, 0.0),
        )  # fmt: skip
    return builder.scene()


def measure(scene: Scene, bodies: float, algorithm: float) -> Measurement:
    """log10 of the backward error: the residual of inverse dynamics over the size of its terms."""
    name = ALGORITHMS[round(algorithm)]
    if bodies > MOST[name]:
        return Measurement(status="did not finish", message=f"{name} was not run with more than {MOST[name]} bodies")
    system = compile(scene)
    state = system.initial_state
    rates = system.accelerations(state, name)
    residual = system.inverse_dynamics(state, rates) - system.applied(state)
    terms = np.abs(system.bias(state)) + np.abs(system.inverse_dynamics(state, rates) - system.bias(state))
    error = np.linalg.norm(residual, np.inf) / np.linalg.norm(terms, np.inf)
    return Measurement(float(np.log10(max(error, ROUNDING))))


def rounding(bodies: Real, algorithm: Real) -> Real:
    """log10 of gamma(n), n the successive roundings of a factorisation of n speeds and of two sweeps over n bodies."""
    return np.asarray(np.log10((1 + PRODUCTS) * bodies * ROUNDING))


MAPS = (
    StabilityMap(
        name="many_bodies",
        title="Chains of many bodies: round-off of the accelerations",
        quantity="log10 of the backward error",
        scene=scene,
        measure=measure,
        x=Axis("bodies", "", 2.0, 2e4, 8, log=True),
        y=Axis.of("algorithm", *ALGORITHMS),
        thresholds=LEVELS,
        kinds=digit_kinds("below 1e-15", "1e-15 to 1e-14", "1e-14 to 1e-13", "1e-13 to 1e-12", "above 1e-12"),
        overlay=Overlay(
            "73 n u", "Higham, Accuracy and Stability of Numerical Algorithms, 3.1", rounding, levels=LEVELS, bound=True
        ),
        shows="Backward errors stay below n u; the recursion's do not grow, those that factorise matrices do.",
        depth=1,
        skips=True,
    ),
)
