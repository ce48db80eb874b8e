"""The numbers of a scene by name, each of which may be a parameter: names are those of `Scene.with_values`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from flexmb.kept import kept
from flexmb.scene.schema import Scene
from flexmb.scene.values import PathError, values_at, with_values

NEARBY = 2.0**-6
"""Change of a number, relative to its scale, by which one sees what depends on it."""


class Number:
    """A real number of a scene, or equal ones at several places of one path with `*`."""

    def __init__(self, scene: Scene, name: str) -> None:
        """PathError where the scene has no such number, or what is there is no real number."""
        if not isinstance(name, str):
            raise TypeError(f"a parameter is named by a string, not by {name!r}: write a path such as rod.mass_kg")
        values = [_real(value, name) for value in values_at(scene, name)]
        if len(set(values)) > 1:
            raise PathError(
                f'parameter "{name}" has the values {", ".join(f"{value:g}" for value in values[:4])}: name one of its '
                "places, or give all of them one value"
            )
        self.name, self.value, self._scene = name, values[0], scene

    def scene_at(self, value: float) -> Scene:
        """The scene with another value."""
        return self.scene_with({self.name: value})

    def scene_with(self, values: Mapping[str, float]) -> Scene:
        """The scene with other values of several of its numbers, by name."""
        changed: Scene = with_values(self._scene, values)
        return changed

    @property
    def own_scene(self) -> Scene:
        """The scene to which it belongs."""
        return self._scene

    @property
    def nearby_value(self) -> float:
        """A value that is a little larger."""
        return self.value + NEARBY * self.scale

    @kept
    def nearby(self) -> Scene:
        """The scene with this value: what differs in it depends on the number."""
        return self.scene_at(self.nearby_value)

    @property
    def scale(self) -> float:
        """A size of the number: its own magnitude or that of its largest neighbour in an array; 1 if all are zero.

        In a matrix of a station, whose elements have several units, that of the diagonal elements beside it.
        """
        steps = self.name.split(".")
        neighbours = [0.0]
        if steps[-5:-4] == ["stations"] and steps[-2].isdecimal() and steps[-1].isdecimal():
            i, j = map(int, steps[-2:])
            matrices = values_at(self._scene, ".".join(steps[:-2]))
            neighbours += [math.sqrt(abs(matrix[i][i] * matrix[j][j])) for matrix in matrices]
        elif steps[-1].isdecimal():
            arrays = values_at(self._scene, ".".join(steps[:-1]))
            neighbours += [abs(number) for array in arrays for number in array if isinstance(number, float)]
        return max(abs(self.value), *neighbours) or 1.0


def _real(value: Any, name: str) -> float:
    if isinstance(value, tuple):
        raise PathError(f'parameter "{name}" is an array of {len(value)}: name one of its numbers, as "{name}.0"')
    if value is None:
        raise PathError(f'parameter "{name}" has no value: write it into the scene first')
    if isinstance(value, bool | str) or not isinstance(value, float | int):
        raise PathError(
            f'parameter "{name}" is {value!r}, and nothing is differentiated by that: give the path of a real number'
        )
    if isinstance(value, int):
        raise PathError(
            f'parameter "{name}" is the whole number {value}, such as a count, and nothing can be differentiated by '
            f"that: give the path of a real number (or write {value}.0 if one is meant)"
        )
    if not math.isfinite(value):
        raise PathError(f'parameter "{name}" is {value}: give it a finite value')
    return value


def numbers(scene: Scene, names: Sequence[str]) -> tuple[Number, ...]:
    """The numbers of these names; ValueError or TypeError where there is none, or one twice."""
    if isinstance(names, str):
        raise TypeError(f"parameters are a list of names, not the string {names!r}: write [{names!r}]")
    numbers = tuple(Number(scene, name) for name in names)
    if not numbers:
        raise ValueError("no parameters are named: give at least one, such as rod.mass_kg")
    twice = sorted({number.name for number in numbers if sum(other.name == number.name for other in numbers) > 1})
    if twice:
        raise ValueError(f'parameter "{twice[0]}" is named twice: name it once')
    return numbers
