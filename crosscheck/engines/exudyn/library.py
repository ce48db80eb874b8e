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


@contextmanager
def evaluator(mbs: Any) -> Iterator[tuple[Any, int]]:
    """Exudyn's implicit solver at the initial state of a system, for single evaluations of its equations, and the
    number of its coordinates; the solver is finalised whatever happens."""
    exudyn = load()
    settings = exudyn.SimulationSettings()
    settings.solution.file.write = False
    settings.timeIntegration.verboseMode = 0
    solver = exudyn.MainSolverImplicitSecondOrder()
    solver.InitializeSolver(mbs, settings)
    try:
        yield solver, len(mbs.systemData.GetODE2Coordinates())
    finally:
        solver.FinalizeSolver(mbs, settings)


def constraint_jacobian(mbs: Any, solver: Any, n: int) -> Real:
    """(k,n) derivatives of all constraints by the n coordinates, at the current ones."""
    size = n + solver.GetAEsize()
    solver.SetSystemJacobian(np.zeros((size, size)))
    solver.ComputeJacobianAE(mbs, velocityLevel=False)
    return np.array(solver.GetSystemJacobian())[n:, :n]
