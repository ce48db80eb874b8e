"""What reading somebody else's model gives: a scene, and what of the model is not in it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from flexmb.scene.problems import SceneError
from flexmb.scene.schema import Scene

MAGNITUDE = 1e150
"""Largest magnitude of a number in a foreign file: the sum of a million squares of such numbers is a number still."""


def usable(number: float) -> bool:
    """Whether a number is finite and its square too; not so for NaN."""
    return abs(number) <= MAGNITUDE


class ModelError(ValueError):
    """A model that no scene can represent, or no model at all: the file, the place, the reason and the remedy."""


@dataclass(frozen=True)
class ImportedScene:
    """The scene, checked, and what of the model it leaves out, in words: one line for each kind of thing."""

    scene: Scene
    notes: tuple[str, ...]


def listed(names: list[str]) -> str:
    """Names for a note: the first five, and how many there are."""
    return ", ".join(names[:5]) + (f" and {len(names) - 5} more" if len(names) > 5 else "")


@contextmanager
def naming(file: str) -> Iterator[None]:
    """Errors of the scene that is made of a file name the file: of a robot's title nobody knows where it came from."""
    try:
        yield
    except SceneError as error:
        raise SceneError(file, error.problems) from None
