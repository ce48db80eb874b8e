"""Observed orders of convergence of the library's integrators on a manufactured motion, beside those of theory.

The error is that of the coordinates at the end of the run, against the prescribed ones. Methods of equal steps halve
the step, those that adapt it take tighter tolerances; the order is the slope of the error against the number of steps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import flexmb as fm
from crosscheck.manufacture.drives import Manufactured
from flexmb.integrate.catalogue import INTEGRATORS
from flexmb.integrate.integrator import Method
from flexmb.run.simulate import RunSettings

THEORY: dict[Method, str] = {
    "rk4": "4", "generalised_alpha": "2", "dop853": "8", "radau5": "5", "exponential": "5 to 6",
}  # fmt: skip
STEPS = (1 / 16, 1 / 32, 1 / 64, 1 / 128, 1 / 256)  # of the duration
TOLERANCES = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8)


@dataclass(frozen=True)
class Order:
    """Of one integrator: steps and errors of its runs, coarse to fine, and the slope between them."""

    method: Method
    theory: str
    steps: tuple[int, ...]
    errors: tuple[float, ...]

    @property
    def observed(self) -> float:
        """Least-squares slope of log error against log steps over all runs, with its sign turned."""
        return -float(np.polyfit(np.log(self.steps), np.log(self.errors), 1)[0])


def orders(made: Manufactured) -> list[Order]:
    """One for each integrator of the library."""
    system = fm.compile(made.scene)
    exact = made.motion.at(made.duration_s).q
    found = []
    for method, theory in THEORY.items():
        steps, errors = [], []
        for step, rtol in zip(STEPS, TOLERANCES, strict=True):
            fixed = INTEGRATORS[method].fixed
            settings: RunSettings = (
                {"step": step * made.duration_s} if fixed else {"rtol": rtol, "atol": 1e-2 * rtol}
            )
            run = fm.simulate(system, made.duration_s, method, samples=2, **settings)
            steps.append(run.statistics.accepted_steps)
            errors.append(float(np.max(np.abs(run.q[-1] - exact))))
        found.append(Order(method, theory, tuple(steps), tuple(errors)))
    return found
