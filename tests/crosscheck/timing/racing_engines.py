"""Engines for races: sound ones, and some that pass the verdicts but not their turns."""

import os
from dataclasses import replace

import numpy as np

from crosscheck.engines.contract import Effort, Run, Trajectory
from flexmb.scene.schema import Scene
from tests.crosscheck import fake_engines
from tests.crosscheck.fake_engines import Fake, Pendulum


class ClocklessPendulum(Pendulum):
    def simulate(self, run: Run, effort: Effort) -> Trajectory:
        return replace(super().simulate(run, effort), wall_s=0.0)


class Clockless(Fake):
    """Says that a solve takes no time."""

    def compile(self, scene: Scene) -> Pendulum:
        return ClocklessPendulum(scene)


class Fickle(Fake):
    """Dies when it is compiled for the second time."""

    def compile(self, scene: Scene) -> Pendulum:
        if hasattr(self, "compiled"):
            os._exit(139)
        self.compiled = True
        return Pendulum(scene)


class ForgetfulPendulum(Pendulum):
    solves = 0

    def simulate(self, run: Run, effort: Effort) -> Trajectory:
        self.solves += 1
        found = super().simulate(run, effort)
        if self.solves <= 2:
            return found
        return replace(found, status="diverged", message="it forgot how")


class Forgetful(Fake):
    """Solves twice and no more."""

    def compile(self, scene: Scene) -> Pendulum:
        return ForgetfulPendulum(scene)


class NotANumberPendulum(Pendulum):
    def simulate(self, run: Run, effort: Effort) -> Trajectory:
        found = super().simulate(run, effort)
        return replace(found, momentum=np.full_like(found.momentum, np.nan))


class NotANumber(Fake):
    """Finishes with momenta that are no numbers."""

    def compile(self, scene: Scene) -> Pendulum:
        return NotANumberPendulum(scene)


class Frank(Fake):
    """Says how it is run."""

    algorithm = "one angle"
    settings = "SciPy's DOP853, nothing else."


_fickle = Fickle("fickle")


def engines() -> dict[str, Fake]:
    """Them, and the fake engines."""
    own = (Clockless("clockless"), _fickle, Forgetful("forgetful"), NotANumber("not a number"), Frank("frank"))
    return fake_engines.engines() | {engine.name: engine for engine in own}
