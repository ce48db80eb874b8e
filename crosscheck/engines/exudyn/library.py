"""The Exudyn library: imported on first use, without its output; EngineMissing names the remedy if it is missing."""

from __future__ import annotations

from functools import cache
from importlib.metadata import PackageNotFoundError
from importlib.metadata import version as installed_version
from types import ModuleType

import numpy as np

from crosscheck.engines.contract import EngineMissing
from flexmb.typing import Real

REMEDY = "Exudyn is not installed: pip install exudyn"


@cache
def load() -> ModuleType:
    """The module `exudyn` with `exudyn.itemInterface` loaded; raises EngineMissing where it is not installed."""
    try:
        import exudyn
        import exudyn.itemInterface
    except ImportError as error:
        raise EngineMissing(REMEDY) from error
    exudyn.special.userInterface.SuppressAll()
    exudyn.config.suppressWarnings = True
    exudyn.config.printToConsole = False
    return exudyn


def version() -> str:
    """Version of the installed library; raises EngineMissing where there is none."""
    try:
        return installed_version("exudyn")
    except PackageNotFoundError as error:
        raise EngineMissing(REMEDY) from error


def matrix(values: Real):
    """A dense matrix as Exudyn's MatrixContainer."""
    container = load().MatrixContainer()
    container.SetWithDenseMatrix(np.asarray(values, dtype=float), useDenseMatrix=True)
    return container
