"""The result of importing a model: a scene, and notes on what the scene does not contain.

Limits and dry friction of imported joints become connectors along their hinges: stops that are springs, smooth
friction. Robot files say where a joint stops and how much friction it has, but not how hard the stop is nor how the
friction passes through zero: whoever imports gives these two numbers, and without them notes say what is left out.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from flexmb.scene.build import SceneBuilder
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


STOPS = "--stop-stiffness makes them stops"
SMOOTH = "--smoothing makes it a connector"


@dataclass(frozen=True)
class JointConnectors:
    """What limits and friction become; `taken` are names that connectors must not have.

    `stop_stiffness`: of stops at limits, N m/rad or N/m. `smoothing`: the rate (rad/s or m/s) below which friction
    falls to zero. None leaves limits, or friction, out.
    """

    stop_stiffness: float | None
    smoothing: float | None
    taken: Collection[str]

    def __post_init__(self) -> None:
        for key in ("stop_stiffness", "smoothing"):
            value = getattr(self, key)
            if value is not None and not 0.0 < value < float("inf"):
                raise ValueError(f"{key} is {value:g}: give a positive number, in SI units")

    def stop(self, builder: SceneBuilder, joint: str, turns: bool, lower: float, upper: float) -> None:
        """Stops of a joint that turns or slides at `lower` and `upper` (rad or m)."""
        assert self.stop_stiffness is not None
        make = builder.angular_spring if turns else builder.linear_spring
        make(self._named(joint, "stops"), joint, lower=lower, upper=upper, stop_stiffness=self.stop_stiffness)

    def rub(self, builder: SceneBuilder, joint: str, turns: bool, sliding: float) -> None:
        """Dry friction of a joint that turns or slides, of size `sliding` (N m or N)."""
        assert self.smoothing is not None
        make = builder.angular_friction if turns else builder.linear_friction
        make(self._named(joint, "friction"), joint, sliding=sliding, smoothing=self.smoothing)

    def _named(self, joint: str, what: str) -> str:
        return next(name for name in (f"{joint}.{what}{end}" for end in ("", *range(99))) if name not in self.taken)
