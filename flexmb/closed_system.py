"""A compiled scene with closures: the system of its tree, with the accelerations and loads of the closed chain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flexmb import dynamics
from flexmb.arrays import Real
from flexmb.closure.constants import closure_constants
from flexmb.closure.system import ClosedMotion, Closures
from flexmb.scene import schema as s
from flexmb.status import Status
from flexmb.system import Algorithm, Evaluation, State, System, pack


class ClosedSystem(System):
    """A tree with closures. Mass matrix, bias and inverse dynamics are those of the tree alone."""

    def __init__(self, scene: s.Scene) -> None:
        super().__init__(scene)
        self.closures = Closures(
            self.constants, closure_constants(scene, self._links, self.constants, self._closure_ports), self.workspace()
        )

    def accelerations(self, state: State, algorithm: Algorithm = "articulated") -> Real:
        """udot (nu,) of the closed chain under all loads, at a state that closes all closures.

        Raises DynamicsError where an inertia is not positive definite, or the closures are singular.
        """
        self._only_articulated(algorithm)
        return self._motion(state.t, pack(state)).accelerations

    def hinge_loads(self, state: State, accelerations: Real | None = None) -> dict[str, Real]:
        """Total load (6,) [torque; force] across each hinge and closure on the outboard body (body_b), World axes."""
        if accelerations is not None:
            raise NotImplementedError(
                f'scene "{self.scene.name}": the loads of forced accelerations are those of a tree; '
                "leave accelerations out, or prescribe coordinates"
            )
        return self.evaluate(state.t, state.q, state.u).loads

    def evaluate(self, t: float, q: Real, u: Real, algorithm: Algorithm = "articulated") -> Evaluation:
        """Everything observable at one state; `loads` has the closures' too."""
        self._only_articulated(algorithm)
        y = np.concatenate([q, u, [0.0]])
        motion = self._motion(t, y)
        markers, wheel_loads, energy, momentum = self._outputs()
        dynamics.observe_motion(
            t, y, motion.accelerations, self._marker_body, self._marker_port, self.constants, self._w,
            markers, wheel_loads, energy, momentum,
        )  # fmt: skip
        found = self._evaluation(
            motion.accelerations, motion.drives, markers, motion.hinges, wheel_loads, energy, momentum
        )
        closures = zip(self.scene.closures, motion.closures, strict=True)
        return replace(found, loads=found.loads | {closure.name: load for closure, load in closures})

    def _motion(self, t: float, y: Real) -> ClosedMotion:
        status, motion = self.closures.motion(t, y)
        self._check(status, self.closures.fault)
        return motion

    def fault_name(self, status: int, fault: int) -> str:
        """What a failure's number stands for: a closure or a body."""
        if status in (Status.CLOSURE_SINGULAR, Status.CLOSURE_OPEN):
            return self.scene.closures[fault].name
        return super().fault_name(status, fault)

    def _only_articulated(self, algorithm: Algorithm) -> None:
        if algorithm != "articulated":
            raise NotImplementedError(
                f'scene "{self.scene.name}" has closures, which algorithm {algorithm!r} does not know: '
                'use algorithm="articulated"'
            )
