"""The Exudyn library: imported on first use, without its output; EngineMissing names the remedy if it is missing."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from types import ModuleType
from typing import Any

import numpy as np

from crosscheck.engines.peer import Library, needed
from flexmb.typing import Real

METHODS = (
    "TrapezoidalIndex2", "GeneralizedAlpha", "ExplicitEuler", "ExplicitMidpoint", "RK33", "RK44", "RK67", "ODE23",
    "DOPRI5", "DVERK6",
)  # fmt: skip
LIBRARY = Library("Exudyn", __name__, "exudyn")  # this module imports it when it is used


@cache
def load() -> ModuleType:
    """The module `exudyn` with `exudyn.itemInterface` loaded; raises EngineMissing where it is not installed."""
    with needed(LIBRARY.words, LIBRARY.distribution):
        import exudyn
        import exudyn.itemInterface
    exudyn.special.userInterface.SuppressAll()
    exudyn.config.suppressWarnings = True
    exudyn.config.printToConsole = False
    return exudyn


def matrix(values: Real):
    """A dense matrix as Exudyn's MatrixContainer."""
    container = load().MatrixContainer()
    container.SetWithDenseMatrix(np.asarray(values, dtype=float), useDenseMatrix=True)
    return container


class ExudynEquations:
    """The equations of a system by Exudyn's implicit solver, at its current coordinates unless others are given:
    M a + C' multipliers = f for n coordinates and k constraints of Jacobian C."""

    def __init__(self, mbs: Any, solver: Any) -> None:
        self._mbs, self.solver, self._data = mbs, solver, mbs.systemData
        self.n, self.k = len(self._data.GetODE2Coordinates()), solver.GetAEsize()
        if self.k:
            self._data.SetAECoordinates(np.zeros(self.k))

    def mass(self) -> Real:
        """M (n, n)."""
        self.solver.ComputeMassMatrix(self._mbs)
        return np.array(self.solver.GetSystemMassMatrix())[: self.n, : self.n]

    def force(self, q: Real | None = None, v: Real | None = None) -> Real:
        """f (n,), without the multipliers."""
        if q is not None:
            self._data.SetODE2Coordinates(q)
        if v is not None:
            self._data.SetODE2Coordinates_t(v)
        self.solver.ComputeODE2RHS(self._mbs)
        return np.array(self.solver.GetSystemResidual())[: self.n]

    def jacobian(self, q: Real | None = None) -> Real:
        """C (k, n)."""
        if not self.k:
            return np.zeros((0, self.n))
        if q is not None:
            self._data.SetODE2Coordinates(q)
        size = self.n + self.k
        self.solver.SetSystemJacobian(np.zeros((size, size)))
        self.solver.ComputeJacobianAE(self._mbs, velocityLevel=False)
        return np.array(self.solver.GetSystemJacobian())[self.n :, : self.n]


def accelerations(M: Real, f: Real, C: Real, kept: Real) -> tuple[Real, Real]:
    """a (n,) and multipliers (k,) with M a + C' multipliers = f and C a = `kept` (k,); the least where rows repeat."""
    if not len(C):
        return np.linalg.solve(M, f), np.zeros(0)
    system = np.block([[M, C.T], [C, np.zeros((len(C), len(C)))]])
    solution = np.linalg.lstsq(system, np.concatenate([f, kept]), rcond=1e-14)[0]
    return solution[: len(M)], solution[len(M) :]


@contextmanager
def equations(mbs: Any) -> Iterator[ExudynEquations]:
    """The equations of a system at its initial state; Exudyn's solver is finalised whatever happens."""
    exudyn = load()
    settings = exudyn.SimulationSettings()
    settings.solution.file.write = False
    settings.timeIntegration.verboseMode = 0
    solver = exudyn.MainSolverImplicitSecondOrder()
    solver.InitializeSolver(mbs, settings)
    try:
        yield ExudynEquations(mbs, solver)
    finally:
        solver.FinalizeSolver(mbs, settings)
