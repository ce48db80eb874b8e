"""The scene of a sample: the swept one with other numbers."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from crosscheck.library.case import CaseError
from crosscheck.sampling.file import SweepFile
from flexmb.scene.schema import Scene
from flexmb.scene.values import PathError, changed_at, number_at


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
