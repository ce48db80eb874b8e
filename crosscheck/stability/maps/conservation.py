"""What methods of equal steps lose: momentum and energy of a body that tumbles, and the load of a constraint."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.special import ellipj

from crosscheck.engines.contract import Effort, Run
from crosscheck.engines.registry import engine
from crosscheck.stability.map import Axis, Kind, Measurement, Overlay, StabilityMap, digit_kinds
from crosscheck.stability.runs import conserved, drift
from flexmb.run.simulate import simulate
from flexmb.scene.build import SceneBuilder
from flexmb.scene.schema import Scene
from flexmb.typing import Real

BETWEEN = 16  # steps between outputs: some codes take powers of two
LEAST = 1e-17


class Stepping(NamedTuple):
    """A method of equal steps, and the order of its errors."""

    engine: str
    method: str
    order: int

    @property
    def label(self) -> str:
        return f"{self.method} of {self.engine}"

    def outputs(self, scene: Scene, step: float, span: float) -> tuple[Real, dict[str, Real], dict[str, Real]]:
        """Times, [quaternion, velocity] (T,10) of markers, loads (T,6). ArithmeticError for a run that ended early."""
        times = BETWEEN * step * np.arange(max(2, round(span / step / BETWEEN)) + 1)
        if self.engine == "flexmb":
            done = simulate(scene, times[-1], self.method, step=step, samples=times)  # type: ignore[arg-type]
            markers, loads, why = done.markers, done.loads, "" if done.finished else done.message
        else:
            other = engine(self.engine)
            other.version()  # raises EngineMissing
            theirs = other.compile(scene).simulate(Run(times), Effort("step", step, self.method))
            markers, loads = theirs.markers, theirs.loads  # type: ignore[assignment]
            why = "" if theirs.status == "finished" else theirs.message
        if why:
            raise ArithmeticError(why)
        paths = {name: np.hstack([path.quaternion, path.velocity]) for name, path in markers.items()}
        return times, paths, dict(loads)


RIVALS = (
    Stepping("flexmb", "rk4", 4),
    Stepping("flexmb", "generalised_alpha", 2),
    Stepping("mujoco", "RK4", 4),
    Stepping("mujoco", "Euler", 1),
    Stepping("exudyn", "RK44", 4),
    Stepping("exudyn", "TrapezoidalIndex2", 2),
    Stepping("exudyn", "GeneralizedAlpha", 2),
)
Error = Callable[[Stepping, Scene, float], float]


def order_law(
    steppings: tuple[Stepping, ...], error: Error, scene: Scene, anchor: float
) -> Callable[[Real, Real], Real]:
    """log10 of errors against step and number of a method: by its order, through its own error at the step `anchor`."""

    @cache
    def anchored(number: int) -> float:
        return error(steppings[number], scene, anchor)

    def predict(step: Real, number: Real) -> Real:
        found = np.round(number).astype(int)
        starts = np.vectorize(anchored, otypes=[float])(found)
        return starts + np.array([each.order for each in steppings])[found] * np.log10(step / anchor)

    return predict


class OrderMap(NamedTuple):
    """Errors (log10) of methods against steps (s) from `low` to `high`; the overlay is through those at `anchor`."""

    scene: Scene
    error: Error
    steppings: tuple[Stepping, ...]
    low: float
    high: float
    anchor: float
    levels: tuple[float, ...]
    kinds: tuple[Kind, ...]
    source: str

    def named(self, name: str, title: str, quantity: str, shows: str) -> StabilityMap:
        """The map with its words."""
        law = order_law(self.steppings, self.error, self.scene, self.anchor)
        return StabilityMap(
            name=name,
            title=title,
            quantity=quantity,
            scene=lambda step, number: self.scene,
            measure=lambda scene, step, number: Measurement(self.error(self.steppings[round(number)], scene, step)),
            x=Axis("step", "s", self.low, self.high, 5, log=True),
            y=Axis.of("method", *(each.label for each in self.steppings)),
            thresholds=self.levels,
            kinds=self.kinds,
            overlay=Overlay("the order of each method", self.source, law, levels=self.levels),
            shows=shows,
            depth=1,
        )


# ---- A tumbling body

INERTIA = np.array([1.0, 2.0, 2.6])  # kg m^2
SPIN = (0.3, 2.0, 0.4)  # rad/s: near the middle axis, whose spin turns over
TUMBLING = 20.0  # s: six turns


def tumbling() -> Scene:
    """A free body without loads, marked at its mass centre."""
    return (
        SceneBuilder("tumbling body")
        .rigid_body("body", mass=1.0, inertia=(1.0, 2.0, 2.6))
        .free("base", "ground", "body", angular_velocity=SPIN)
        .marker("body", "body")
        .scene()
    )


def kept(method: Stepping, scene: Scene, step: float) -> tuple[float, float]:
    """log10 of the largest relative change of the angular momentum and of the energy."""
    _, paths, _ = method.outputs(scene, step, TUMBLING)
    momentum, energy = conserved(paths["body"][:, :4], paths["body"][:, 4:], INERTIA)
    return drift(momentum), drift(energy)


# ---- The load of a constraint

LENGTH, ANGLE, GRAVITY = 1.0, 1.2, 9.81  # m, rad, m/s^2
SWING = 2.0  # s
INDEX = (
    Stepping("flexmb", "generalised_alpha", 2),
    Stepping("exudyn", "TrapezoidalIndex2", 2),
    Stepping("exudyn", "GeneralizedAlpha", 2),
)
"""Without constraints as equations; with them on the level of speeds (index 2); on that of positions (index 3)."""


def swinging() -> Scene:
    """A rod of a kilogram that swings about its end."""
    return (
        SceneBuilder("pendulum", gravity=(0.0, 0.0, -GRAVITY))
        .rigid_body("rod", mass=1.0, com=(0.0, 0.0, -0.5 * LENGTH), inertia=(LENGTH**2 / 12.0, LENGTH**2 / 12.0, 1e-3))
        .revolute("pin", "ground", "rod", axis=(0.0, 1.0, 0.0), angle=ANGLE)
        .scene()
    )


def pin_force(times: Real) -> Real:
    """Force (T,3) N of the pin in World axes, exactly: Jacobi's elliptic functions (Landau, Lifshitz, Mechanics, 11).

    The rod begins at rest at `ANGLE`; omega_0^2 = 3 g / (2 length) for a rod about its end.
    """
    square = 1.5 * GRAVITY / LENGTH
    k = np.sin(0.5 * ANGLE)
    _, cn, dn, _ = ellipj(np.sqrt(square) * times, k**2)
    angle = 2.0 * np.arcsin(k * cn / dn)
    rate_square = 2.0 * square * (np.cos(angle) - np.cos(ANGLE))
    acceleration = -square * np.sin(angle)
    # The mass centre is at length/2 (-sin, 0, -cos): turning about +y moves what hangs down towards -x.
    x = -0.5 * LENGTH * (acceleration * np.cos(angle) - rate_square * np.sin(angle))
    z = -0.5 * LENGTH * (-acceleration * np.sin(angle) - rate_square * np.cos(angle))
    return np.column_stack([x, np.zeros_like(x), z + GRAVITY])


def load_error(method: Stepping, scene: Scene, step: float) -> float:
    """log10 of the largest error of the pin's force over the weight."""
    times, _, loads = method.outputs(scene, step, SWING)
    return float(np.log10(np.max(np.linalg.norm(loads["pin"][:, 3:] - pin_force(times), axis=1)) / GRAVITY + LEAST))


ORDERS = "orders: Hairer, Lubich, Wanner 2006; Chung, Hulbert 1993; MuJoCo and Exudyn documentation"
TUMBLES = OrderMap(
    tumbling(), lambda method, scene, step: kept(method, scene, step)[0], RIVALS, 2e-3, 1e-1, 1e-2,
    (-10.0, -7.0, -4.0, -2.0),
    digit_kinds("below 1e-10", "1e-10 to 1e-7", "1e-7 to 1e-4", "1e-4 to 1e-2", "above 1e-2"), ORDERS,
)  # fmt: skip
SWINGS = OrderMap(
    swinging(), load_error, INDEX, 1e-3, 5e-2, 1e-2, (-5.0, -4.0, -3.0, -2.0),
    digit_kinds("below 1e-5", "1e-5 to 1e-4", "1e-4 to 1e-3", "1e-3 to 1e-2", "above 1e-2"),
    "second order of multipliers too: Arnold, Brüls 2007; closed form: Jacobi's elliptic functions",
)  # fmt: skip
MAPS = (
    TUMBLES.named(
        "momentum_drift",
        "A tumbling body: momentum lost by each method",
        "log10 of the change of angular momentum",
        "Nothing turns a free body; what its angular momentum changes by is the method's error.",
    ),
    TUMBLES._replace(error=lambda method, scene, step: kept(method, scene, step)[1], anchor=2e-2).named(
        "energy_drift",
        "A tumbling body: energy lost or won by each method",
        "log10 of the change of energy",
        "Methods of fourth order keep the energy of a tumbling body, those of first order lose or win all of it.",
    ),
    SWINGS.named(
        "index_load",
        "The load of a pin: without constraints, at index 2 and at index 3",
        "log10 of the error of the force over the weight",
        "Loads of index 3 keep the second order of the method as those of index 2 do, in a smooth motion.",
    ),
)
