"""Methods to run a model (algorithm, integrator, tolerance or step), and ladders of them from loose to tight."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexmb.integrate.catalogue import INTEGRATORS
from flexmb.integrate.integrator import Integrator
from flexmb.integrate.settings import Settings
from flexmb.run.operations import of_run
from flexmb.run.simulate import run_of_many
from flexmb.run.trajectory import Trajectory
from flexmb.system.algorithm import Algorithm
from flexmb.system.system import System
from flexmb.tables.status import Status

ABSOLUTE = 1e-2
"""Ratio of absolute and relative tolerance, SI: modal coordinates and small rates are of the order of hundredths."""

TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11)
FINEST = 1e-12
STEPS = (2.5, 1.25, 0.6, 0.3, 0.15, 0.075)
"""Fixed steps times the highest frequency; RK4 is stable up to 2.83."""
SOME_STEPS = 20
"""Steps after which it is known what a step of an implicit method costs."""


@dataclass(frozen=True)
class RunMethod:
    """A way to integrate; `value` is the relative tolerance if the integrator controls its step, else the step (s)."""

    integrator: str
    value: float
    algorithm: Algorithm = "articulated"

    @property
    def adaptive(self) -> bool:
        return not INTEGRATORS[self.integrator].fixed

    def options(self) -> dict[str, Any]:
        """Keyword arguments of `flexmb.simulate`."""
        chosen: dict[str, Any] = {"method": self.integrator, "algorithm": self.algorithm}
        if self.adaptive:
            return chosen | {"rtol": self.value, "atol": ABSOLUTE * self.value}
        return chosen | {"step": self.value}

    def words(self) -> str:
        """Options of `flexmb simulate`."""
        names = {key: value if isinstance(value, str) else f"{value:.12g}" for key, value in self.options().items()}
        return " ".join(f"--{key} {value}" for key, value in names.items())

    def __str__(self) -> str:
        kind = "rtol" if self.adaptive else "step"
        unit = "" if self.adaptive else " s"
        return f"{self.integrator}, {kind} {self.value:.3g}{unit}, {self.algorithm}"


def simulated(system: System, times: NDArray[np.float64], method: RunMethod, max_steps: int = 1_000_000) -> Trajectory:
    """A run with output at `times` (s), from 0."""
    options = method.options()
    algorithm, settings = options.pop("algorithm"), Settings(**options, max_steps=max_steps)
    return run_of_many(system, times, settings.checked(float(times[-1])), algorithm).trajectory


def simulated_within(
    system: System, times: NDArray[np.float64], method: RunMethod, each: int, most: float, max_steps: int
) -> tuple[Trajectory | None, bool]:
    """A run that ends after about `most` operations or `max_steps` steps, and whether the operations ended it; `each`:
    operations of an evaluation. No run if equal steps are certain to take more.

    What a step of an implicit method takes is not known before: `SOME_STEPS` are made to measure it.
    """
    steps = _steps_within(method, each, most)
    if not method.adaptive and steps < float(times[-1] - times[0]) / method.value:
        return None, True
    if INTEGRATORS[method.integrator].linearises and np.isfinite(most) and steps > SOME_STEPS:
        first = simulated(system, times, method, SOME_STEPS)
        if first.status is not Status.MAX_STEPS:
            return first, False
        size = system.nq + system.nu + 1
        steps = max(SOME_STEPS, int(SOME_STEPS * most / of_run(method.integrator, each, size, first.statistics)))
    done = simulated(system, times, method, min(steps, max_steps))
    return done, done.status is Status.MAX_STEPS and steps < max_steps


def _steps_within(method: RunMethod, each: int, most: float) -> int:
    """The most steps that a run can take until it has executed `most` operations, with `each` for an evaluation."""
    return int(min(most / (each * INTEGRATORS[method.integrator].evaluations), 1e9)) + 1


def ladders(
    highest: float, slow: float, algorithm: Algorithm, tree: bool, longest: float
) -> tuple[tuple[RunMethod, ...], ...]:
    """For each integrator its methods from loose to tight; integrators that linearise come first.

    Fixed steps are chosen by the frequency `highest` (rad/s), those of implicit methods by `slow`, the frequency of the
    scene with all bodies rigid, and none is longer than `longest` (s), the interval of the output, in which any run
    makes a step at least. Integrators that linearise are tried on trees only, with the recursion.
    """
    chosen = [integrator for integrator in INTEGRATORS.values() if tree or not integrator.linearises]
    rates = {integrator.name: slow if integrator.linearises else max(highest, slow) for integrator in chosen}
    return tuple(
        _ladder(
            integrator,
            max(rates[integrator.name], STEPS[0] / longest),
            "articulated" if integrator.linearises else algorithm,
        )
        for integrator in sorted(chosen, key=lambda integrator: not integrator.linearises)
    )


def _ladder(integrator: Integrator, frequency: float, algorithm: Algorithm) -> tuple[RunMethod, ...]:
    """Methods from loose to tight, without the tightest ones for integrators that linearise, which are slow there."""
    if integrator.fixed:
        return tuple(RunMethod(integrator.name, step / frequency, algorithm) for step in STEPS)
    tolerances = TOLERANCES[:-3] if integrator.linearises else TOLERANCES
    return tuple(RunMethod(integrator.name, rtol, algorithm) for rtol in tolerances)
