"""The scene of a sample: the base scene with other numbers at the paths of the parameters."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from crosscheck.library.case import CaseError
from crosscheck.sampling.file import SweepFile
from flexmb.scene.schema import Scene
from flexmb.scene.values import PathError, changed_at, number_at
from flexmb.typing import Real


def with_values(scene: Scene, sweep: SweepFile, values: Iterable[float]) -> Scene:
    """The scene with the value of each parameter; CaseError names a path that leads to no number, and the remedy."""
    for parameter, value in zip(sweep.parameters, values, strict=True):
        for path in parameter.paths:

            def changed(
                old: Any, path: str = path, value: float = value, relative: bool = parameter.relative
            ) -> float:
                given = value * old if relative and isinstance(old, int | float) else value
                return number_at(path, old, given)

            try:
                scene = changed_at(scene, path, changed)
            except PathError as problem:
                raise CaseError(str(problem)) from None
    return scene


def require_numbers(scene: Scene, sweep: SweepFile, values: Real) -> None:
    """CaseError, as of `with_values`, where a path leads to no number, or to one that some sample's value does not fit.

    `values` (number of samples, number of parameters). A count takes whole numbers alone, in every sample.
    """
    for column, parameter in enumerate(sweep.parameters):
        different = np.unique(values[:, column])
        for path in parameter.paths:

            def fits(old: Any, path: str = path, relative: bool = parameter.relative, given: Real = different) -> Any:
                number_at(path, old, 0.0)
                if isinstance(old, int):
                    for value in given:
                        number_at(path, old, value * old if relative else value)
                return old

            try:
                changed_at(scene, path, fits)
            except PathError as problem:
                raise CaseError(str(problem)) from None
