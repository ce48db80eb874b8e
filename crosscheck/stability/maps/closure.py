"""Closed loops by RK4: drift against the step by each way of closing loops, and where stabilisation is stable."""

from __future__ import annotations

from functools import cache

import numpy as np

from crosscheck.engines.contract import Effort, Run
from crosscheck.engines.registry import engine
from crosscheck.stability.map import Axis, Measurement, Overlay, StabilityMap, digit_kinds
from flexmb.run.simulate import simulate
from flexmb.scene.build import SceneBuilder
from flexmb.scene.schema import Scene
from flexmb.system.compile import compile
from flexmb.system.system import System
from flexmb.typing import Real

CRANK, COUPLER, ROCKER, GROUND = 0.3, 0.8, 0.7, 1.0  # m
SIZE = GROUND
RATE = 3.8269366540605176  # initial rate (rad/s) of the crank in the motion of the published pictures
SAMPLES = 33
LEAST = 1e-17
REAL_RK4 = 2.785293563405282  # |R(z)| = 1 at z = -2.785 on the real axis


def scene(step: float, other: float) -> Scene:
    """A rigid four-bar in a vertical plane, cut between coupler and rocker."""
    crank = 1.0
    pin = CRANK * np.array([np.cos(crank), np.sin(crank)])
    diagonal = np.array([GROUND, 0.0]) - pin
    d = float(np.linalg.norm(diagonal))
    along = (COUPLER**2 - ROCKER**2 + d**2) / (2.0 * d)
    across = np.sqrt(COUPLER**2 - along**2) / d
    joint = pin + along / d * diagonal + across * np.array([-diagonal[1], diagonal[0]])
    coupler = float(np.arctan2(joint[1] - pin[1], joint[0] - pin[0]))
    rocker = float(np.arctan2(joint[1], joint[0] - GROUND))
    builder = SceneBuilder("four-bar", gravity=(0.0, -9.81, 0.0))
    for name, length in (("crank", CRANK), ("coupler", COUPLER), ("rocker", ROCKER)):
        inertia = (1e-5, length**3 / 12.0, length**3 / 12.0)
        builder.rigid_body(
            name, mass=length, com=(0.5 * length, 0.0, 0.0), inertia=inertia, nodes={"tip": (length, 0.0, 0.0)}
        )
    return (
        builder.revolute("drive", "ground", "crank", angle=crank, rate=RATE)
        .revolute("pin", "crank", "coupler", parent_node="tip", angle=coupler - crank)
        .revolute("pivot", "ground", "rocker", parent_position=(GROUND, 0.0, 0.0), angle=rocker)
        .closure("loop", "spherical", "coupler", "rocker", node_a="tip", node_b="tip")
        .marker("a", "coupler", node="tip")
        .marker("b", "rocker", node="tip")
        .scene()
    )


@cache
def system() -> System:
    """The four-bar, compiled; it is the same for all cells."""
    return compile(scene(0.0, 0.0))


def gap(step: float, time: float, rate: float, samples: int = SAMPLES) -> Measurement:
    """`opening` of a run of flexmb with RK4; with `rate` 0 it projects."""
    done = simulate(system(), time, "rk4", step=step, samples=np.linspace(0.0, time, samples), stabilise=rate)
    if not done.finished:
        return Measurement(status="failed", message=done.message)
    return opening(done.markers["a"].position, done.markers["b"].position)


def opening(a: Real, b: Real) -> Measurement:
    """log10 of the largest distance of the joined points over the size of the loop, in the second half of a run."""
    distance = np.linalg.norm(a - b, axis=1)[len(a) // 2 :]
    return Measurement(float(np.log10(np.max(distance) / SIZE + LEAST)))


# ---- Where stabilisation is stable

STEPS = 512


def measure_stability(scene: Scene, step: float, rate: float) -> Measurement:
    """The largest opening in the second half of `STEPS` steps, at each of them.

    The opening of an unstable loop oscillates and may be small at single instants.
    """
    return gap(step, STEPS * step, rate, STEPS + 1)


def beyond_real_interval(step: Real, rate: Real) -> Real:
    """Positive where the double root -rate of g'' + 2 rate g' + rate^2 g = 0 is outside RK4's stability interval."""
    return np.asarray(step * rate / REAL_RK4 - 1.0)


STABILISATION = StabilityMap(
    name="closure_stabilisation",
    title="Stabilised four-bar by RK4: which rates the step allows",
    quantity="log10 of the loop's opening over its size",
    scene=scene,
    measure=measure_stability,
    x=Axis("step", "s", 1e-4, 2e-3, 6, log=True),
    y=Axis("rate of stabilisation", "1/s", 5e2, 5e4, 8, log=True),
    thresholds=(-3.0,),
    overlay=Overlay(
        "step x rate = 2.785",
        "Baumgarte 1972; real stability interval of RK4: Hairer, Wanner II, IV.2",
        beyond_real_interval,
    ),
    shows="Baumgarte's stabilisation must not be faster than the integrator's step allows.",
    depth=2,
    failure=1,
)

# ---- Drift

SPAN = 3.0  # s
KEPT = ("projection", "stabilised 20/s", "MuJoCo's soft constraint")
SLOW_RATE = 20.0  # 1/s
PROJECTED = 6e-14  # of the size of the mechanism: where projection stops
SOFT_TIME, SOFT_IMPEDANCE = 0.02, 0.9  # s; MuJoCo's defaults (solref, solimp)
ANCHOR = 1e-3  # s
LEVELS = (-12.0, -9.0, -7.0, -4.0)


def measure_drift(scene: Scene, step: float, kept: float) -> Measurement:
    """The opening within `SPAN`."""
    match KEPT[round(kept)]:
        case "projection":
            return gap(step, SPAN, 0.0)
        case "stabilised 20/s":
            return gap(step, SPAN, SLOW_RATE)
    mujoco = engine("mujoco")
    mujoco.version()  # raises EngineMissing
    trajectory = mujoco.compile(scene).simulate(Run(np.linspace(0.0, SPAN, SAMPLES)), Effort("step", step, "RK4"))
    if trajectory.status != "finished":
        return Measurement(status="failed", message=trajectory.message)
    return opening(trajectory.markers["a"].position, trajectory.markers["b"].position)


@cache
def anchored() -> float:
    """log10 of the stabilised drift with steps of `ANCHOR`."""
    return gap(ANCHOR, SPAN, SLOW_RATE).value


@cache
def pulled_apart() -> float:
    """Largest relative acceleration (m/s^2) in a run that the joined points would have without the closure."""
    mechanism, tree = system(), System(system().scene)
    done = simulate(mechanism, SPAN, samples=SAMPLES, rtol=1e-8, atol=1e-10)
    largest = 0.0
    for q, u in zip(done.q, done.u, strict=True):
        seen = tree.evaluate(0.0, q, u).markers
        largest = max(largest, float(np.linalg.norm((seen["a"].acceleration - seen["b"].acceleration)[3:])))
    return largest


def drift(step: Real, kept: Real) -> Real:
    """log10 of the opening: the limit where projection stops, the fourth order in the step, or the yield of a soft
    constraint.

    MuJoCo's constraint is a critically damped spring of its time constant T, not shorter than two steps, whose force is
    scaled by its impedance d: it yields (1 - d) T^2 a under a load that would part the points with the acceleration a.
    """
    time = np.maximum(SOFT_TIME, 2.0 * step)
    table = np.array([
        np.full_like(step, np.log10(PROJECTED)),
        anchored() + 4.0 * np.log10(step / ANCHOR),
        np.log10((1.0 - SOFT_IMPEDANCE) * time**2 * pulled_apart() / SIZE),
    ])  # fmt: skip
    return np.asarray(np.choose(np.round(kept).astype(int), table))


DRIFT = StabilityMap(
    name="closure_drift",
    title="A loop that should stay closed: four-bar by RK4",
    quantity="log10 of the loop's opening over its size",
    scene=scene,
    measure=measure_drift,
    x=Axis("step", "s", 2.5e-4, 1.2e-2, 6, log=True),
    y=Axis.of("how it is kept closed", *KEPT),
    thresholds=LEVELS,
    kinds=digit_kinds("below 1e-12", "1e-12 to 1e-9", "1e-9 to 1e-7", "1e-7 to 1e-4", "above 1e-4"),
    overlay=Overlay(
        "6e-14; fourth order; (1 - d) T^2 a",
        "projection; RK4 (Kutta 1901) through the run with 1 ms; MuJoCo documentation, Computation: constraint model",
        drift,
        levels=LEVELS,
    ),
    shows="Projection closes a loop to rounding whatever the step, stabilisation to the order of the method.",
    depth=2,
)
MAPS = (STABILISATION, DRIFT)
