"""Errors of compiling and starting a scene as its defects: each says which item of the scene is meant, if it names one.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from flexmb.scene.check.walk import entries
from flexmb.scene.loaded import called
from flexmb.scene.problems import Defect, Place, SceneError
from flexmb.scene.schema import Scene

NAMED = ("bodies", "hinges", "wheels", "point_masses", "closures", "couplings", "connectors", "loads", "markers")


@contextmanager
def built(scene: Scene) -> Iterator[None]:
    """ValueErrors of numbers that cannot be computed become a SceneError; errors with a kind of their own stay."""
    try:
        yield
    except ValueError as error:
        if type(error) not in (ValueError, np.linalg.LinAlgError):
            raise
        raise SceneError(called(scene), [_defect(scene, str(error))]) from error


@contextmanager
def started(scene: Scene) -> Iterator[None]:
    """Whatever says that a scene cannot be compiled or evaluated becomes a SceneError."""
    try:
        yield
    except SceneError:
        raise
    except (ValueError, ArithmeticError, NotImplementedError, OSError) as error:
        raise SceneError(called(scene), [_defect(scene, str(error))]) from error


def _defect(scene: Scene, message: str) -> Defect:
    what, _, remedy = message.partition("; ")
    return Defect(str(_place(scene, message)), f"it cannot start: {what}", remedy or "correct what this names")


def _place(scene: Scene, message: str) -> Place:
    """The first item that a message names, or the scene as a whole."""
    for collection in NAMED:
        for place, item in entries(scene, collection):
            if any(f"{mark}{item.name}{mark}" in message for mark in "\"'"):
                return place
    return Place()
