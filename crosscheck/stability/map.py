"""The definition of a stability map: one family of scenes with two parameters, one quantity, two axes, one overlay."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import Literal

import msgspec
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator

from flexmb.scene.schema import Scene
from flexmb.typing import Real

Prediction = Callable[[Real, Real], Real]
CellStatus = Literal["measured", "failed", "did not finish", "did not run"]

NO_PREDICTION = -3  # in place of the number of a class
STABLE, UNSTABLE = "#9ecae1", "#f4a582"  # colours of maps that ask only whether a motion is stable
DIGITS = ("#08519c", "#4292c6", "#9ecae1", "#fdae6b", "#e6550d")  # from many digits to few


class Axis(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A parameter from `low` to `high` in `cells` coarse cells, equal in its logarithm if `log`.

    With `categories` there is one row of cells for each of them. They are not divided, and their values are 0, 1, 2 ...
    """

    name: str
    unit: str = ""
    low: float = 0.0
    high: float = 1.0
    cells: int = 1
    log: bool = False
    categories: tuple[str, ...] = ()

    @staticmethod
    def of(name: str, *categories: str) -> Axis:
        """An axis whose values have names."""
        return Axis(name, low=-0.5, high=len(categories) - 0.5, cells=len(categories), categories=categories)

    @property
    def label(self) -> str:
        """Name and unit."""
        return f"{self.name} ({self.unit})" if self.unit else self.name

    def values(self, fractions: Real) -> Real:
        """Parameters at fractions 0..1 of the axis."""
        if self.log:
            return np.asarray(self.low * (self.high / self.low) ** fractions)
        return np.asarray(self.low + (self.high - self.low) * fractions)

    def fractions(self, values: Real) -> Real:
        """Where on the axis, 0..1, parameters are."""
        if self.log:
            return np.asarray(np.log(values / self.low) / np.log(self.high / self.low))
        return np.asarray((values - self.low) / (self.high - self.low))

    def edges(self, level: int) -> Real:
        """Bounds (n+1,) of the cells after `level` halvings."""
        count = self.count(level)
        return self.values(np.arange(count + 1) / count)

    def centres(self, level: int) -> Real:
        """Middles (n,) of the cells after `level` halvings."""
        count = self.count(level)
        return self.values((np.arange(count) + 0.5) / count)

    def count(self, level: int) -> int:
        """How many cells there are after `level` halvings."""
        return self.cells if self.categories else self.cells * 2**level


@dataclass(frozen=True)
class Measurement:
    """The result of a cell: the value of the quantity, or the status and reason why there is none."""

    value: float = np.nan
    status: CellStatus = "measured"
    message: str = ""


@dataclass(frozen=True)
class Kind:
    """A class of cells: between two thresholds of the quantity."""

    name: str
    colour: str


def growth_kinds() -> tuple[Kind, Kind]:
    """Classes of a map of growth rates."""
    return Kind("stable", STABLE), Kind("unstable", UNSTABLE)


@dataclass(frozen=True)
class Overlay:
    """The theoretical or published boundary: where `predict(x, y)` (arrays of one shape) crosses `levels`.

    Below the first level the first class is expected, and so on; there are as many levels as thresholds of the map. A
    `bound` limits the quantity only from above, so that classes below the expected one are correct too. `source` names
    the theory or the publication.
    """

    name: str
    source: str
    predict: Prediction
    levels: tuple[float, ...] = (0.0,)
    bound: bool = False

    def classes(self, x: Real, y: Real) -> NDArray[np.intp]:
        """Numbers of the classes expected at x, y; `NO_PREDICTION` where the prediction is NaN."""
        predicted = self.predict(x, y)
        return np.where(np.isnan(predicted), NO_PREDICTION, np.searchsorted(self.levels, predicted, side="right"))


def interpolated(x: Axis, y: Axis, predict: Prediction, knots: int = 129) -> Prediction:
    """A costly prediction, found at `knots` values of each axis and linear between them; beyond the axes too."""

    @cache
    def table() -> RegularGridInterpolator:
        places = np.linspace(0.0, 1.0, knots)
        values = predict(*np.meshgrid(x.values(places), y.values(places), indexing="ij"))
        return RegularGridInterpolator((places, places), values, bounds_error=False, fill_value=None)

    def found(at_x: Real, at_y: Real) -> Real:
        fractions = np.stack([x.fractions(np.asarray(at_x)), y.fractions(np.asarray(at_y))], axis=-1)
        return np.asarray(table()(fractions))

    return found


@dataclass(frozen=True)
class StabilityMap:
    """One case, one quantity, two axes.

    `scene(x, y)` is the family, `measure(scene, x, y)` finds the quantity in one member; the classes `kinds`, by
    default stable and unstable, lie between the `thresholds` (increasing, one fewer). `depth` halvings are made where
    class or status changes. A cell that `failed` counts as class number `failure` in the comparison with the overlay;
    if `failure` is not given, every failed cell is wrong. With `skips`, cells that did not finish are no evidence.
    `shows` is the text of the gallery."""

    name: str
    title: str
    quantity: str
    scene: Callable[[float, float], Scene]
    measure: Callable[[Scene, float, float], Measurement]
    x: Axis
    y: Axis
    thresholds: tuple[float, ...]
    overlay: Overlay
    shows: str
    kinds: tuple[Kind, ...] = field(default_factory=growth_kinds)
    depth: int = 3
    failure: int | None = None
    skips: bool = False

    def __post_init__(self) -> None:
        if not len(self.kinds) == len(self.thresholds) + 1 == len(self.overlay.levels) + 1:
            raise ValueError(f"map {self.name}: {len(self.kinds)} classes need one fewer thresholds and overlay levels")

    def kind(self, value: float) -> int:
        """Number of the class of a value."""
        return int(np.searchsorted(self.thresholds, value, side="right"))

    def outcome(self, x: float, y: float) -> Measurement:
        """The quantity at one place."""
        return self.measure(self.scene(x, y), x, y)


def digit_kinds(*names: str) -> tuple[Kind, ...]:
    """Classes of a map of errors, from many digits to few."""
    return tuple(Kind(name, colour) for name, colour in zip(names, DIGITS[: len(names)], strict=True))
