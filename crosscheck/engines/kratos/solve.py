"""Kratos' implicit steps, one after the other."""

from __future__ import annotations

import numpy as np

from crosscheck.engines.functions_of_time import jumps
from crosscheck.engines.kratos.mesh import JUMP_WINDOW, Mesh
from crosscheck.engines.kratos.state import MeshState, accelerations, held, read


class ImplicitSteps:
    """Fixed steps of backward differences, which begin anew where a load jumps.

    The differences need two states before the first. Those are made from the accelerations there, or a first step
    would be of first order. `count`: steps made so far; `work`: that of loads and a prescribed rotation so far (J), by
    the trapezoidal rule.
    """

    def __init__(self, mesh: Mesh, step: float) -> None:
        self._mesh, self._step = mesh, step
        self._strategy, self._scheme = mesh.strategy()
        self._jumps = sorted({t for load in mesh.layout.scene.loads for t in jumps(load.function)})
        self.count = self.iterations = 0
        self.work = 0.0
        mesh.set_out()
        self._begin()
        self._power = self._power_now()

    @property
    def t(self) -> float:
        """Time (s) of the last step."""
        return self.count * self._step

    def go_on(self) -> bool:
        """One step; False where it has no solution."""
        mesh, before = self._mesh, self.t
        self.count += 1
        mesh.part.CloneTimeStep(self.t)
        self._applied = mesh.load(self.t, -1.0)
        mesh.turn(before, self.t)
        self._strategy.InitializeSolutionStep()
        self._strategy.Predict()
        converged = self._strategy.SolveSolutionStep()
        self._strategy.FinalizeSolutionStep()
        self.iterations += mesh.part.ProcessInfo[mesh.core.NL_ITERATION_NUMBER]
        if not converged or not np.all(np.isfinite(mesh.of_elements("RightHandSide"))):
            return False  # Kratos takes forces that are not finite for none, and for convergence
        power = self._power_now()
        self.work += self._step / 2.0 * (self._power + power)
        if any(before * (1.0 + JUMP_WINDOW) < jump <= self.t * (1.0 + JUMP_WINDOW) for jump in self._jumps):
            self._begin()
            power = self._power_now()
        self._power = power
        return True

    def state(self) -> MeshState:
        """The state after the last step."""
        self._catch_up()
        found = read(self._mesh, self._applied)
        self._scheme.FinalizeNonLinIteration(self._mesh.part, *self._system())
        return found

    def _begin(self) -> None:
        mesh = self._mesh
        self._catch_up()
        self._applied = mesh.load(self.t, 1.0)
        found = accelerations(mesh, self.t, self._applied)
        self._scheme.FinalizeNonLinIteration(mesh.part, *self._system())
        mesh.begin(self.t, self._step, found)

    def _power_now(self) -> float:
        """Of loads and of a prescribed rotation (W)."""
        mesh = self._mesh
        rate = mesh.table((mesh.translation[1], mesh.rotation[1]))
        power = float(np.sum(self._applied * rate))
        if mesh.layout.prescribed:
            self._catch_up()
            power += float(held(mesh, self._applied)[5] * rate[mesh.layout.root, 5])
            self._scheme.FinalizeNonLinIteration(mesh.part, *self._system())
        return power

    def _catch_up(self) -> None:
        """Tell the elements the last increments of rotations, which they take in when an iteration begins."""
        self._scheme.InitializeNonLinIteration(self._mesh.part, *self._system())

    def _system(self) -> tuple:
        strategy = self._strategy
        return strategy.GetSystemMatrix(), strategy.GetSolutionVector(), strategy.GetSystemVector()
