"""Equations of motion rebuilt from exported data, as a route to the reference of a case.

A case's file calls it: `exact = rebuilt(__file__, rtol=1e-9)`. The route shares with flexmb the data that are exported,
for flexible bodies their modes and inertia points, and nothing of the dynamics (`crosscheck/export/rebuild`).
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from crosscheck.export.model import model_data
from crosscheck.export.rebuild import RebuiltCase
from crosscheck.library.case_error import CaseError
from crosscheck.library.find import load_case
from crosscheck.running.plan import variant_scene
from flexmb.typing import Real


def rebuilt(file: str, rtol: float) -> Callable[[Real], dict[str, Real]]:
    """The function `exact(times)` of a file in a case's folder, for the variant of its reference."""
    folder = Path(file).parent

    def exact(times: Real) -> dict[str, Real]:
        case = load_case(folder)
        if case.run.reference is None:
            raise CaseError(f"{folder / 'run.toml'}: it has no table [reference]")
        variant = case.run.variant(case.run.reference.variant)
        model = RebuiltCase(*model_data(variant_scene(case.scene(variant), variant)))
        channels = model.channels(times, model.integrate(times, rtol))
        return {name: np.asarray(values) for name, values in channels.items()}

    return exact
