"""The result of importing a model: a scene, and notes on what the scene does not contain."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from flexmb.scene.problems import SceneError
from flexmb.scene.schema import Scene

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


@contextmanager
def naming(file: str) -> Iterator[None]:
    """Let errors of a scene made from a file name the file in place of the scene's title."""
    try:
        yield
    except SceneError as error:
        raise SceneError(file, error.problems) from None
