"""Closed loops by RK4: drift against the step, by way of keeping closures closed, and where stabilisation is stable."""

from __future__ import annotations

from functools import cache

import numpy as np

from crosscheck.stability.map import Array, Axis, Outcome, Overlay, StabilityMap, growth_kinds
from flexmb.closed_system import ClosedSystem
from flexmb.scene.build import SceneBuilder
from flexmb.scene.schema import Scene
from flexmb.simulation import simulate
from flexmb.system import compile

CRANK, COUPLER, ROCKER, GROUND = 0.3, 0.8, 0.7, 1.0  # m
SIZE = GROUND
RATE = 2.0  # rad/s of the crank at the start
SAMPLES = 33
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
        .closure("loop", "revolute", "coupler", "rocker", node_a="tip", node_b="tip")
        .scene()
    )


@cache
def system() -> ClosedSystem:
    """The four-bar, compiled; it is the same for all cells."""
    found = compile(scene(0.0, 0.0))
    assert isinstance(found, ClosedSystem)
    return found


def gap(step: float, time: float, rate: float) -> Outcome:
    """log10 of the largest opening of the loop over its size, in the second half of a run of RK4."""
    mechanism = system()
    done = simulate(
        mechanism, time, "rk4", step=step, samples=np.linspace(0.0, time, SAMPLES), stabilise=rate
    )
    if not done.finished:
        return Outcome(status="failed", message=done.message)
    half = slice(SAMPLES // 2, None)
    states = zip(done.t[half], done.q[half], done.u[half], strict=True)
    gaps = [mechanism.closure_gaps(mechanism.state(q, u, t))["loop"] for t, q, u in states]
    return Outcome(float(np.log10(max(max(distance / SIZE, angle) for distance, angle in gaps) + 1e-17)))


# ---- Where stabilisation is stable

STEPS = 512


def measure_stability(scene: Scene, step: float, rate: float) -> Outcome:
    """The opening after `STEPS` steps."""
    return gap(step, STEPS * step, rate)


def beyond_real_interval(step: Array, rate: Array) -> Array:
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
    kinds=growth_kinds(),
    overlay=Overlay(
        "step x rate = 2.785",
        "Baumgarte 1972; real stability interval of RK4: Hairer, Wanner II, IV.2",
        beyond_real_interval,
    ),
    shows="Baumgarte's stabilisation must not be faster than the integrator's step allows.",
    depth=2,
    failure=1,
)
MAPS = (STABILISATION,)
