"""The result of importing a model: a scene, and notes on what the scene does not contain."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from flexmb.scene.problems import SceneError
from flexmb.scene.rounding import ROUNDING
from flexmb.scene.schema import Scene
from flexmb.typing import Real

MAGNITUDE = 1e150
"""Largest magnitude of a number in an imported file; sums of a million squares of such numbers are still finite."""


def usable(number: float) -> bool:
    """Whether a number and its square are finite; False for NaN."""
    return abs(number) <= MAGNITUDE


class ModelError(ValueError):
    """A file that is not a model, or a model that no scene can represent: file, place, reason and remedy."""


@dataclass(frozen=True)
class ImportedScene:
    """The checked scene, and notes on the parts of the model that it omits, one line for each kind."""

    scene: Scene
    notes: tuple[str, ...]


def listed(names: list[str]) -> str:
    """Names for a note: the first five, and the number of the others."""
    return ", ".join(names[:5]) + (f" and {len(names) - 5} more" if len(names) > 5 else "")


def possible_inertia(mass: float, tensor: Real) -> Real:
    """The tensor about a mass centre itself if it is possible; else the one in which negative second moments
    sum m x x' are zero. Dust that the checks of scenes admit goes too: other codes have checks of their own."""
    if mass == 0.0:
        return np.zeros((3, 3))
    second, axes = np.linalg.eigh(0.5 * np.trace(tensor) * np.eye(3) - tensor)
    if second[0] >= -ROUNDING * float(np.max(np.abs(tensor))):
        return tensor
    second = np.maximum(second, 0.0)
    return np.sum(second) * np.eye(3) - (axes * second) @ axes.T


@contextmanager
def naming(file: str) -> Iterator[None]:
    """Let errors of a scene made from a file name the file in place of the scene's title."""
    try:
        yield
    except SceneError as error:
        raise SceneError(file, error.problems) from None
