"""Stability of a sampled loop over two numbers of its scene: the largest multiplier at every pair of values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from flexmb.linear.linearize_sampled import linearize_sampled
from flexmb.output.files import whole_file
from flexmb.scene.schema import Scene
from flexmb.tables import arguments
from flexmb.tables.named import brief
from flexmb.typing import Flags, Real


@dataclass(frozen=True, eq=False)
class MultiplierMap:
    """Of a loop over two numbers with the values first (X,) and second (Y,).

    size, tolerance (X,Y): of the largest multiplier per period of the loop, without those of what drifts freely; NaN
    where the loop has none: `refused` says why, by the indices of the values.
    """

    scene: str
    names: tuple[str, str]
    first: Real
    second: Real
    size: Real
    tolerance: Real
    refused: dict[tuple[int, int], str]

    __repr__ = brief

    def __post_init__(self) -> None:
        """TypeError or ValueError for parts that do not fit together."""
        self._refuse_torn()

    def _refuse_torn(self) -> None:
        arguments.held("first", self.first, (None,))
        arguments.held("second", self.second, (None,))
        for name in ("size", "tolerance"):
            arguments.held(name, getattr(self, name), (len(self.first), len(self.second)))

    @property
    def stable(self) -> Flags:
        """(X,Y) where all multipliers are inside the unit circle beyond rounding."""
        return np.asarray(self.size + self.tolerance < 1.0)

    def plot(self, path: Path | str) -> Path:
        """Write the map as a picture: the size of the largest multiplier, and the line where it is 1."""
        from flexmb.linear.sampled_picture import write_map_plot  # loads matplotlib

        self._refuse_torn()
        return write_map_plot(Path(path), self.scene, self.names, self.first, self.second, self.size)

    def to_csv(self, path: Path | str) -> Path:
        """A line for each pair of values, with the size of the largest multiplier."""
        self._refuse_torn()
        pairs = np.stack(np.meshgrid(self.first, self.second, indexing="ij"), axis=-1).reshape(-1, 2)
        header = ",".join([*self.names, "largest multiplier"])
        path = Path(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as beside:
            table = np.column_stack([pairs, self.size.ravel()])
            np.savetxt(beside, table, fmt="%.17g", delimiter=",", header=header, comments="")
        return path


def stability_map(scene: Scene, values: Mapping[str, ArrayLike]) -> MultiplierMap:
    """Stability of a sampled loop over two numbers: `stability_map(scene, {"law.kp": gains, "law.delay_s": delays})`.

    Names are those of `Scene.with_values`, values rows of numbers. At every pair the loop is linearised about where it
    rests, as `linearize_sampled` does. A pair at which it does not rest, or has no derivative, is a gap in the map with
    its reason. Raises TypeError and ValueError for other arguments, PathError for a number that does not exist,
    SceneError for values that make no scene, the first reason where all pairs are gaps, and what else
    `linearize_sampled` raises.
    """
    if not isinstance(scene, Scene):
        raise TypeError(f"a Scene is needed, not {type(scene).__name__}: its numbers take other values")
    if not isinstance(values, Mapping):
        raise TypeError(f"values is a {type(values).__name__}: give two names of numbers with their values, as a dict")
    if len(values) != 2:
        raise ValueError(f"values: a map is over two numbers, not {len(values)}")
    rows = list[Real]()
    for name, given in values.items():
        row = arguments.finite(f'values["{name}"]', np.atleast_1d(arguments.array(f'values["{name}"]', given))).copy()
        if row.ndim != 1 or not len(row):
            raise ValueError(f'values["{name}"]: give at least one, in a row, not an array of shape {row.shape}')
        rows.append(row)
    one, other = values
    size, tolerance = (np.full((len(rows[0]), len(rows[1])), np.nan) for _ in range(2))
    refused, first_error = dict[tuple[int, int], str](), None
    for i, x in enumerate(rows[0]):
        for j, y in enumerate(rows[1]):
            changed = scene.with_values({one: float(x), other: float(y)})
            try:
                found = linearize_sampled(changed).stability
            except ArithmeticError as error:  # it does not rest, or has no derivative there
                first_error = first_error or error
                refused[i, j] = str(error)
                continue
            size[i, j], tolerance[i, j] = abs(found.multiplier), found.tolerance
    if first_error is not None and len(refused) == size.size:
        raise first_error
    return MultiplierMap(scene.name, (one, other), rows[0], rows[1], size, tolerance, refused)
