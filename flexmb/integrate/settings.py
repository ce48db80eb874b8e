"""The settings of an integrator, and their limits."""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np

from flexmb.integrate.catalogue import INTEGRATORS, integrator
from flexmb.integrate.integrator import Integrator, Method
from flexmb.integrate.problem import Accuracy
from flexmb.tables import arguments

FINEST_RTOL = 100 * np.finfo(float).eps
COARSEST_RTOL = 1e-2  # error estimates are leading terms, which are not reliable for larger errors
MOST_STEPS = sys.maxsize  # the largest count of compiled code
SHORTEST_STEP = 10 * np.finfo(float).eps  # fixed step over t_end: shorter ones do not advance time
DAMPING_NOTHING_SLOW = 0.8  # spectral radius: a mode that is not resolved loses nine tenths in ten steps


@dataclass(frozen=True)
class Settings:
    """How a run is integrated: `step` (s) and `spectral_radius` belong to methods that have them, else None."""

    method: Method = "dop853"
    rtol: float = 1e-10
    atol: float = 1e-12
    step: float | None = None
    max_steps: int = 1_000_000
    spectral_radius: float | None = None

    @property
    def integrator(self) -> Integrator:
        """The method's declaration; ValueError where there is none of that name."""
        return integrator(self.method)

    def accuracy(self, coordinates: int, speeds: int) -> Accuracy:
        """What the integrator is told of a state with so many coordinates and speeds, behind which is the work."""
        return Accuracy(
            rtol=self.rtol,
            atol=self.atol,
            controlled=coordinates + speeds,
            max_steps=self.max_steps,
            step=0.0 if self.step is None else self.step,
            radius=DAMPING_NOTHING_SLOW if self.spectral_radius is None else self.spectral_radius,
            coordinates=coordinates,
        )

    def checked(self, t_end: float) -> Settings:
        """The same in plain numbers; ValueError for settings that make no sense, TypeError for anything but numbers."""
        plain = Settings(
            self.method,
            rtol=arguments.number("rtol", self.rtol),
            atol=arguments.number("atol", self.atol),
            step=None if self.step is None else arguments.number("step", self.step),
            max_steps=arguments.whole("max_steps", self.max_steps),
            spectral_radius=(
                None if self.spectral_radius is None else arguments.number("spectral_radius", self.spectral_radius)
            ),
        )
        plain._check(t_end)
        return plain

    def _check(self, t_end: float) -> None:
        method = self.integrator
        if method.fixed and (self.step is None or self.step <= 0.0):
            raise ValueError(
                f'method "{self.method}" takes fixed steps, but step is {self.step}: give a positive step in seconds'
            )
        if self.step is not None and self.step < SHORTEST_STEP * t_end:
            raise ValueError(
                f"step is {self.step:g} s, by which double precision does not advance a time of {t_end:g} s: max_steps "
                f"allows {self.max_steps} of them, so use {t_end / self.max_steps:.1e} s or more"
            )
        if not method.fixed and self.step is not None:
            raise ValueError(
                f'method "{self.method}" chooses its own steps: leave step out and set rtol and atol, or use "rk4"'
            )
        if self.spectral_radius is not None:
            if not method.damps:
                damping = " or ".join(f'"{name}"' for name, integrator in INTEGRATORS.items() if integrator.damps)
                raise ValueError(f'spectral_radius is for method {damping}: leave it out for "{self.method}"')
            if not 0.0 <= self.spectral_radius <= 1.0:
                raise ValueError(
                    f"spectral_radius is {self.spectral_radius:g}: from 0 (what is not resolved dies in a step) to 1 "
                    "(nothing is damped)"
                )
        if not FINEST_RTOL <= self.rtol <= COARSEST_RTOL:
            raise ValueError(
                f"rtol is {self.rtol:g}: double precision resolves {FINEST_RTOL:.1e}, and above {COARSEST_RTOL:g} the "
                "error of a step is not known; use a value between them"
            )
        if not self.atol > 0.0:
            raise ValueError(
                f"atol is {self.atol:g}: give a positive one, or a coordinate that passes zero stops the run"
            )
        if not 1 <= self.max_steps <= MOST_STEPS:
            raise ValueError(f"max_steps is {self.max_steps}: allow at least one step, and at most {MOST_STEPS}")
