"""Beams under a follower force at the tip: flutter, with a tip mass and with internal damping."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from scipy.linalg import eigvals

from crosscheck.stability.map import Axis, Measurement, Overlay, StabilityMap
from crosscheck.stability.spectrum import growth_rate, states_of
from flexmb.scene.build import SceneBuilder
from flexmb.scene.functions import Constant
from flexmb.scene.schema import BeamStation, Level, Modes, Scene, TipMass
from flexmb.system.compile import compile
from flexmb.typing import Real

LENGTH, STIFFNESS, MASS = 1.0, 1.0, 1.0  # m, N m^2, kg/m: loads are P L^2/EI, times sqrt(mass L^4/EI)
MODES, ELEMENTS = 6, 12
NEUTRAL = 1e-7  # 1/s; below is rounding
KNOTS = 65


def column(load: float, tip_mass: float = 0.0, damping: float = 0.0, level: Level = "stiffened") -> Scene:
    """A clamped beam, the force along its tip; `damping`: time (s) by which stiffness is multiplied (Kelvin, Voigt)."""
    section = BeamStation(
        x_m=0.0, EA_N=1e6, EIy_Nm2=STIFFNESS, EIz_Nm2=STIFFNESS, GJ_Nm2=1.0, mass_per_length_kg_m=MASS
    )
    lumps = (TipMass(x_m=LENGTH, mass_kg=tip_mass * MASS * LENGTH),) if tip_mass else ()
    return (
        SceneBuilder("follower force")
        .beam(
            "beam", length=LENGTH, elements=ELEMENTS, section=section, level=level, points="line",
            modes=Modes(count=MODES, families=("bending_y",), viscosity_s=damping), tip_masses=lumps,
        )  # fmt: skip
        .weld("clamp", "ground", "beam")
        .force("push", "beam", node="tip", direction=(-1, 0, 0), frame="node", function=Constant(value=load))
        .scene()
    )


def measure(scene: Scene, load: float, other: float) -> Measurement:
    """Growth rate (1/s) of the straight column's bending."""
    system = compile(scene)
    return Measurement(growth_rate(system, states_of(system, ["beam.modes"], ["beam.modes"])))


# ---- The overlay: independent beam elements


@cache
def matrices() -> tuple[Real, Real, Real, Real]:
    """M, K, the geometric stiffness of a unit compression and the follower's part of it, of Hermitian elements."""
    n = 2 * (ELEMENTS + 1)
    M, K, G, F = np.zeros((4, n, n))
    h = LENGTH / ELEMENTS
    mass = [[156, 22 * h, 54, -13 * h], [22 * h, 4 * h**2, 13 * h, -3 * h**2], [54, 13 * h, 156, -22 * h],
            [-13 * h, -3 * h**2, -22 * h, 4 * h**2]]  # fmt: skip
    bend = [[12, 6 * h, -12, 6 * h], [6 * h, 4 * h**2, -6 * h, 2 * h**2], [-12, -6 * h, 12, -6 * h],
            [6 * h, 2 * h**2, -6 * h, 4 * h**2]]  # fmt: skip
    slope = [[36, 3 * h, -36, 3 * h], [3 * h, 4 * h**2, -3 * h, -(h**2)], [-36, -3 * h, 36, -3 * h],
             [3 * h, -(h**2), -3 * h, 4 * h**2]]  # fmt: skip
    for e in range(ELEMENTS):
        place = np.ix_(range(2 * e, 2 * e + 4), range(2 * e, 2 * e + 4))
        M[place] += np.array(mass) * MASS * h / 420.0
        K[place] += np.array(bend) * STIFFNESS / h**3
        G[place] += np.array(slope) / (30.0 * h)
    F[-2, -1] = 1.0  # a force -P slope on the tip's deflection
    free = slice(2, None)
    return M[free, free], K[free, free], G[free, free], F[free, free]


def _with_tip(M: Real, tip_mass: float) -> Real:
    loaded = M.copy()
    loaded[-2, -2] += tip_mass * MASS * LENGTH
    return loaded


def growth(load: float, tip_mass: float, damping: float) -> float:
    """Largest real part of the eigenvalues of the elements' equations."""
    M, K, G, F = matrices()
    M = _with_tip(M, tip_mass)
    n = len(M)
    A, B = np.eye(2 * n), np.eye(2 * n)
    A[:n, :n], A[:n, n:] = 0.0, np.eye(n)
    A[n:, :n], A[n:, n:] = -(K - load * (G - F)), -damping * K
    B[n:, n:] = M
    return float(np.max(eigvals(A, B).real))


@cache
def critical_load(tip_mass: float, damping: float) -> float:
    """The load at which motion starts to grow, by bisection."""
    low, high = 2.0, 40.0
    while high - low > 1e-3:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if growth(middle, tip_mass, damping) > 1e-3 * max(damping, 1e-3) else (middle, high)
    return 0.5 * (low + high)


def excess(axis: Axis, critical: Callable[[float], float]) -> Callable[[Real, Real], Real]:
    """Positive beyond the critical load, found at `KNOTS` values of the other parameter."""

    def predict(load: Real, other: Real) -> Real:
        knots = axis.values(np.linspace(0.0, 1.0, KNOTS))
        scale = np.log if axis.log else np.asarray
        return np.asarray(load - np.interp(scale(other), scale(knots), [critical(float(knot)) for knot in knots]))

    return predict


LOAD = Axis("load P L^2 / EI", "", 8.0, 24.0, 16)
TIP_MASS = Axis("tip mass over the beam's", "", 0.0, 2.0, 8)
DAMPING = Axis("internal damping time x sqrt(EI / m L^4)", "", 1e-4, 1e-1, 9, log=True)
MAPS = (
    StabilityMap(
        name="follower_force",
        title="Beck's and Pflueger's columns: follower force and tip mass, no damping",
        quantity="growth rate",
        scene=lambda load, tip_mass: column(load, tip_mass=tip_mass),
        measure=measure,
        x=LOAD,
        y=TIP_MASS,
        thresholds=(NEUTRAL,),
        overlay=Overlay(
            "flutter of the undamped column, 20.05 without tip mass",
            "Beck 1952, Pflueger 1955; computed with beam elements",
            excess(TIP_MASS, lambda tip_mass: critical_load(tip_mass, 0.0)),
        ),
        shows="A force that follows the tip lets a column flutter; level stiffened has what static buckling needs too.",
        depth=2,
    ),
    StabilityMap(
        name="follower_force_exact",
        title="Beck's and Pflueger's columns at level exact",
        quantity="growth rate",
        scene=lambda load, tip_mass: column(load, tip_mass=tip_mass, level="exact"),
        measure=measure,
        x=LOAD,
        y=TIP_MASS,
        thresholds=(NEUTRAL,),
        overlay=Overlay(
            "flutter of the undamped column, 20.05 without tip mass",
            "Beck 1952, Pflueger 1955; computed with beam elements",
            excess(TIP_MASS, lambda tip_mass: critical_load(tip_mass, 0.0)),
        ),
        shows="Strains in place of modes: the same boundary, with no geometric stiffness but that of the kinematics.",
        depth=2,
    ),
    StabilityMap(
        name="follower_force_damped",
        title="Beck's column with internal damping",
        quantity="growth rate",
        scene=lambda load, damping: column(load, damping=damping),
        measure=measure,
        x=LOAD,
        y=DAMPING,
        thresholds=(NEUTRAL,),
        overlay=Overlay(
            "flutter of the damped column, 10.94 for vanishing damping",
            "Bolotin, Zhinzher 1969; Herrmann, Jong 1965; computed with beam elements",
            excess(DAMPING, lambda damping: critical_load(0.0, damping)),
        ),
        shows="However small, internal damping takes nearly half of the load at which Beck's column flutters.",
        depth=2,
    ),
)
