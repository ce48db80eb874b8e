"""Mass ratio across a hinge, and an outer body with nearly no inertia of its own: accurate digits of each algorithm."""

from __future__ import annotations

from fractions import Fraction
from functools import cache
from typing import NamedTuple, cast

import numpy as np

from crosscheck.stability.map import Axis, Measurement, Overlay, StabilityMap, digit_kinds
from flexmb.scene.build import SceneBuilder
from flexmb.scene.schema import Scene
from flexmb.system.algorithm import Algorithm
from flexmb.system.compile import compile
from flexmb.tables.state import DynamicsError
from flexmb.typing import Real

ALGORITHMS: tuple[Algorithm, ...] = ("articulated", "composite", "frisch")
GRAVITY, LENGTH, CENTRE, INERTIA = 9.81, 1.3, 0.47, 0.1  # m/s^2, m, m, kg m^2 of the inner body of 1 kg
FACTORS = (0.9873, 0.9941, 1.0049, 1.0122)  # of mass and inertia, so that none is exact by luck
STATES = 4  # of each
ROUNDING = 2.0**-53


class Inputs(NamedTuple):
    """What the accelerations depend on: angles (rad) and rates (rad/s) of both hinges.

    The chain is stretched. If it were bent, the outer mass would have inertia of its own about the first hinge, and no
    digits would be lost.
    """

    angles: Real
    rates: Real


@cache
def states() -> tuple[Inputs, ...]:
    """Random states, the same for every cell, of which the worst is measured."""
    rng = np.random.default_rng(8)
    return tuple(Inputs(np.array([rng.uniform(-np.pi, np.pi), 0.0]), rng.normal(size=2)) for _ in range(STATES))


def scene(ratio: float, slender: float) -> Scene:
    """A double pendulum: masses 1 and `ratio`; `slender` is the outer I over m c^2, about and of the mass centre."""
    outer = slender * ratio * CENTRE**2
    return (
        SceneBuilder("double pendulum", gravity=(0.0, -GRAVITY, 0.0))
        .rigid_body("inner", mass=1.0, com=(CENTRE, 0.0, 0.0), inertia=(INERTIA,) * 3)
        .rigid_body("outer", mass=ratio, com=(CENTRE, 0.0, 0.0), inertia=(outer,) * 3)
        .revolute("first", "ground", "inner")
        .revolute("second", "inner", "outer", parent_position=(LENGTH, 0.0, 0.0))
        .scene()
    )


def exact(ratio: float, slender: float, at: Inputs) -> tuple[Real, Real]:
    """M (2,2) and the accelerations (2,) of Lagrange's equations, in fractions; sines and cosines in long doubles."""
    m, l, c = Fraction(ratio), Fraction(LENGTH), Fraction(CENTRE)
    inertia = Fraction(slender * ratio * CENTRE**2)
    first, both = np.longdouble(at.angles[0]), np.longdouble(at.angles[0]) + np.longdouble(at.angles[1])
    cosine, sine = (_fraction(f(np.longdouble(at.angles[1]))) for f in (np.cos, np.sin))
    u1, u2 = map(Fraction, at.rates)
    M22 = inertia + m * c * c
    M12 = M22 + m * l * c * cosine
    M11 = Fraction(INERTIA) + c * c + m * l * l + M22 + 2 * m * l * c * cosine
    weight2 = Fraction(GRAVITY) * m * c * _fraction(np.cos(both))
    weight1 = Fraction(GRAVITY) * (c + m * l) * _fraction(np.cos(first)) + weight2
    r1 = m * l * c * sine * (2 * u1 * u2 + u2 * u2) - weight1
    r2 = -m * l * c * sine * u1 * u1 - weight2
    det = M11 * M22 - M12 * M12
    rates = [(M22 * r1 - M12 * r2) / det, (M11 * r2 - M12 * r1) / det]
    return np.array([[M11, M12], [M12, M22]], float), np.array(rates, float)


def _fraction(x: np.longdouble) -> Fraction:
    return Fraction(*x.as_integer_ratio())


def measure(algorithm: Algorithm, ratio: float, slender: float) -> Measurement:
    """log10 of the largest error of the accelerations over their size, both weighed with sqrt(diag M)."""
    errors = []
    for factor in FACTORS:
        mass, thin = factor * ratio, slender / factor**2
        system = compile(scene(mass, thin))
        for at in states():
            M, wanted = exact(mass, thin, at)
            try:
                accelerations = system.accelerations(system.state(at.angles, at.rates), algorithm)
            except DynamicsError as error:
                return Measurement(status="failed", message=str(error))
            weights = np.sqrt(np.diag(M))
            errors.append(np.linalg.norm(weights * (accelerations - wanted)) / np.linalg.norm(weights * wanted))
    return Measurement(float(np.log10(max(max(errors), ROUNDING))))


def left_over(ratio: Real, slender: Real) -> tuple[Real, Real]:
    """Determinant of M over M22, and M11: what the first hinge moves, with the outer hinge free and locked."""
    own = slender * ratio * CENTRE**2
    inner, M22 = INERTIA + CENTRE**2, own + ratio * CENTRE**2
    return inner + ratio * LENGTH**2 * own / M22, inner + own + ratio * (LENGTH + CENTRE) ** 2


def scaled_condition(ratio: Real, slender: Real) -> Real:
    """log10 of u cond(H); H is M scaled to a unit diagonal, its determinant found without cancellation."""
    left, M11 = left_over(ratio, slender)
    rho = np.sqrt(1.0 - np.minimum(left / M11, 1.0))
    return np.asarray(np.log10(ROUNDING * (1.0 + rho) ** 2 * M11 / left))


def cancellation(ratio: Real, slender: Real) -> Real:
    """log10 of the rounding of the outer mass over its remainder: P - P H D^-1 H' P cancels at the hinge.

    This is a bound: where the outer body provides the remainder, forces and inertia have the same error, which cancels.
    """
    left, _ = left_over(ratio, slender)
    return np.asarray(np.log10(ROUNDING * np.maximum(ratio * LENGTH**2 / left, 1.0)))


LEVELS = (-14.0, -12.0, -10.0)
SCALED = Overlay(
    "u cond(H), H the scaled mass matrix", "Demmel 1989; Higham, Accuracy and Stability, theorem 10.6",
    scaled_condition, levels=LEVELS,
)  # fmt: skip
CANCELLING = Overlay(
    "u x outer mass over what is left of it", "cancellation: Higham, Accuracy and Stability, 1.7",
    cancellation, levels=LEVELS, bound=True,
)  # fmt: skip


def digits_map(algorithm: Algorithm) -> StabilityMap:
    """The map of one algorithm."""

    def measured(member: Scene, ratio: float, slender: float) -> Measurement:
        return measure(algorithm, ratio, slender)

    overlay = SCALED if algorithm != "articulated" else CANCELLING
    return StabilityMap(
        name=f"mass_ratio_{algorithm}",
        title=f"Digits that {algorithm} keeps across a hinge",
        quantity="log10 of the largest weighted error",
        scene=scene,
        measure=measured,
        x=Axis("outer over inner mass", "", 1e-9, 1e9, 18, log=True),
        y=Axis("outer inertia over mass x offset^2", "", 1e-12, 1.0, 12, log=True),
        thresholds=LEVELS,
        kinds=digit_kinds("14 digits and more", "12 to 14", "10 to 12", "fewer than 10"),
        overlay=overlay,
        shows=f"How many digits of the accelerations {algorithm} keeps where masses or inertias differ widely.",
        depth=1,
        failure=3,
    )


MAPS = tuple(digits_map(cast(Algorithm, name)) for name in ALGORITHMS)
