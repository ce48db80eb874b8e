"""Ways to run a model: algorithm, integrator, tolerance or step; ladders of them, loose to tight."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexmb.simulation import simulate
from flexmb.system import Algorithm, System
from flexmb.trajectory import Trajectory

ABSOLUTE = 1e-2
"""Absolute over relative tolerance, SI: modal coordinates and small rates are of the order of hundredths."""

TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11)
FINEST = 1e-12
STEPS = (2.5, 1.25, 0.6, 0.3, 0.15, 0.075)
"""Fixed steps times the highest frequency; RK4 is stable up to 2.83."""


@dataclass(frozen=True)
class Method:
    """`value` is the relative tolerance of an integrator that controls its step, else the step in s."""

    integrator: str
    value: float
    algorithm: Algorithm = "articulated"

    @property
    def adaptive(self) -> bool:
        return self.integrator in ADAPTIVE

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


def simulated(system: System, times: NDArray[np.float64], method: Method, max_steps: int = 1_000_000) -> Trajectory:
    """A run with output at `times` (s). Where nothing is free to move, no error is there to control: one step."""
    t_end = float(times[-1])
    options = method.options() if system.nu else {"method": "rk4", "step": t_end}
    return simulate(system, t_end, samples=times, max_steps=max_steps, **options)


ADAPTIVE = frozenset({"dop853"})


def ladders(highest: float, algorithm: Algorithm) -> tuple[tuple[Method, ...], ...]:
    """For each integrator its methods from loose to tight; fixed steps are those of the frequency `highest` (rad/s)."""
    adaptive = tuple(Method("dop853", rtol, algorithm) for rtol in TOLERANCES)
    fixed = tuple(Method("rk4", step / highest, algorithm) for step in STEPS)
    return adaptive, fixed
