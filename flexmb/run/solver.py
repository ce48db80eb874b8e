"""Integrates all segments of a run by one method and one algorithm, for the system as altered by events."""

from __future__ import annotations

from contextlib import AbstractContextManager

from flexmb.integrate.settings import Settings
from flexmb.run.outputs import doubt_about, observed
from flexmb.run.propagate import Integration, Raw, integration
from flexmb.run.situation import Situation
from flexmb.run.trajectory import Trajectory
from flexmb.system.algorithm import Algorithm
from flexmb.tables.status import Status
from flexmb.typing import Real


class Solver:
    """Integrates the system of a situation and evaluates its outputs. stabilise (1/s): see `flexmb.simulate`."""

    def __init__(self, situation: Situation, settings: Settings, algorithm: Algorithm, stabilise: float) -> None:
        self._situation, self.settings = situation, settings
        self._algorithm, self._stabilise = algorithm, stabilise
        self.doubts: list[str] = []
        """Warnings about integrations that did not fail."""

    def integration(self) -> AbstractContextManager[Integration]:
        """An integration for exclusive use within the context."""
        system, integrator = self._situation.system, self.settings.integrator
        return integration(system, self._algorithm, self._stabilise, integrator)

    def observed(self, raw: Raw, times: Real, solve: Integration) -> Trajectory:
        """Outputs of an integration by `solve` at these times (T,) s."""
        system = self._situation.system
        part, doubt = observed(system, times, raw, self._algorithm, solve), doubt_about(system, solve)
        if part.status is Status.OK and doubt is not None:
            self.doubts.append(f'scene "{system.scene.name}": {doubt}')
        return part

    def accelerations(self, raw: Raw, motion: Real) -> Real:
        """Accelerations (nu,) with the controllers' outputs at the end of an integration, but with another motion
        [q, u, work]."""
        begin = self._situation.going_on(self._situation.with_motion(raw, motion))
        with self.integration() as solve:
            if solve.feedback is None:
                return self._situation.system.accelerations(begin.state, self._algorithm)
            return solve.feedback.accelerations(begin)
