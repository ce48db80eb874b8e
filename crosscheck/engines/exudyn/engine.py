"""The Exudyn engine: rigid bodies in redundant coordinates, flexible ones in floating frames of reference."""

from __future__ import annotations

import numpy as np

from crosscheck.engines.contract import Effort, Model, Support
from crosscheck.engines.exudyn import library
from crosscheck.engines.exudyn.assembly import flexible, unconstrained
from crosscheck.engines.exudyn.solve import EXPLICIT
from crosscheck.engines.exudyn.support import supports
from crosscheck.engines.functions_of_time import fastest_rate
from flexmb.scene.schema import Scene

RIGID_STEP, FLEXIBLE_STEP = 4e-3, 2e-3
"""Coarsest step (s) of a scene in which no wheel spins, without and with flexible bodies."""
SPIN_PER_STEP, WHEEL_STEP = 0.2, 1e-3
"""Angle (rad) that a wheel may turn in a coarsest step, for the error of its bearing grows with it, and the step (s)
below which this is not pursued, for the time of a run grows with it."""


class ExudynEngine:
    """Exudyn behind the engine contract."""

    name = "exudyn"
    takes = ("connectors",)
    summary = "rigid bodies and floating frames in redundant coordinates"
    algorithm = "redundant coordinates, Lagrange multipliers"
    settings = (
        "Its own solvers in their own C++ loop, without files, messages or contacts. Linear algebra is dense for "
        "small scenes and Eigen's sparse one for large ones, whichever is faster. A sensor in Python takes the state "
        "at every sample, and functions of time are called in Python where a scene has them; both are in the timed "
        "solve. A single free body is restarted at every sample, as its solver does not stop there by itself. Where "
        "Newton's method does not reach the first tolerance, the solve is made again with the next, and all count."
    )

    def version(self) -> str:
        """Version of the library; raises EngineMissing where it is not installed."""
        return library.version()

    def supports(self, scene: Scene) -> Support:
        """How exactly Exudyn represents the scene, with the reason."""
        return supports(scene)

    def efforts(self, scene: Scene) -> tuple[Effort, ...]:
        """One free body: error-controlled steps; else the trapezoidal rule at three steps, each half the one before.

        Generalised-alpha rings on drive torques (percents at the same step), so it is not the default.
        """
        if unconstrained(scene):
            return tuple(Effort("tolerance", tolerance, EXPLICIT) for tolerance in (1e-7, 1e-9, 1e-11))
        coarsest = FLEXIBLE_STEP if any(flexible(body) for body in scene.bodies) else RIGID_STEP
        step = min(coarsest, max(WHEEL_STEP, SPIN_PER_STEP / max(_fastest_spin(scene), 1e-9)))
        return tuple(Effort("step", step / refinement, "TrapezoidalIndex2") for refinement in (1, 2, 4))

    def compile(self, scene: Scene) -> Model:
        """Convert the scene."""
        from crosscheck.engines.exudyn.model import ExudynModel

        return ExudynModel(scene)


def _fastest_spin(scene: Scene) -> float:
    """Fastest wheel rate (rad/s) at the start or by prescription."""
    prescribed = [fastest_rate(w.prescribed_rad) for w in scene.wheels if w.prescribed_rad is not None]
    return float(np.max([0.0, *(abs(w.speed_rad_s) for w in scene.wheels), *prescribed]))
