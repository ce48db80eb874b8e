"""The Kratos library: imported on first use, without its output; EngineMissing says what to install."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version as installed_version
from types import ModuleType

from crosscheck.engines.peer import needed

DISTRIBUTION = "KratosStructuralMechanicsApplication"  # which requires the core
_BELOW_WARNINGS = -1


def version() -> str:
    """Version of the installed library; raises EngineMissing where there is none."""
    with needed("Kratos", DISTRIBUTION):
        load()
        return installed_version(DISTRIBUTION)


def load() -> tuple[ModuleType, ModuleType]:
    """Kratos' core and its structural mechanics; raises EngineMissing where they are not installed."""
    with needed("Kratos", DISTRIBUTION), _silence():
        import KratosMultiphysics as core
        import KratosMultiphysics.StructuralMechanicsApplication as structural
    core.Logger.GetDefaultOutput().SetSeverity(core.Logger.Severity(_BELOW_WARNINGS))
    return core, structural


@contextmanager
def _silence() -> Iterator[None]:
    """Without what C++ writes to standard output: Kratos prints a banner there while it is imported."""
    sys.stdout.flush()
    kept, nowhere = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)
