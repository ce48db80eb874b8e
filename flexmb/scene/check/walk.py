"""Every value of a scene with its place; the checks that hold wherever a value stands: finite numbers, unit axes."""

from __future__ import annotations

from collections.abc import Iterator
from math import hypot
from typing import Any

import msgspec

from flexmb.scene.convert import ROOT, label
from flexmb.scene.problems import Defect, Place
from flexmb.scene.schema import Scene

# Data printed to ten digits are unit vectors to 1e-10; what is further off than this was never normalised.
UNIT_LENGTH = 1e-9
# No quantity of mechanics is near it in SI units, and products of five such numbers are still finite.
LARGEST = 1e60
AXES = ("axis", "direction", "directions")


def entries(scene: Scene, collection: str) -> Iterator[tuple[Place, Any]]:
    """The items of one of the scene's collections with their places, named."""
    yield from _named_items(ROOT.key(collection), collection, getattr(scene, collection))


def sound(scene: Scene, collection: str) -> Iterator[tuple[Place, Any]]:
    """Like `entries`, without the items that hold a NaN or an infinity: physical checks would mean nothing there."""
    for place, item in entries(scene, collection):
        if not any(non_finite(value) for _, _, value in values(place, item)):
            yield place, item


def values(place: Place, struct: msgspec.Struct) -> Iterator[tuple[Place, str, Any]]:
    """Place, key and value of every field of a struct, those of the structs inside it included."""
    for key in struct.__struct_fields__:
        value, spot = getattr(struct, key), place.key(key)
        yield spot, key, value
        if isinstance(value, msgspec.Struct):
            yield from values(spot, value)
        elif isinstance(value, tuple) and value and isinstance(value[0], msgspec.Struct):
            for inner, item in _named_items(spot, key, value):
                yield from values(inner, item)


def non_finite(value: Any) -> tuple[tuple[int, ...], float] | None:
    """Index and value of the first NaN, infinity, or size beyond LARGEST in a number or nested tuple of numbers."""
    if isinstance(value, float) and not abs(value) <= LARGEST:
        return (), value
    if isinstance(value, tuple):
        for i, item in enumerate(value):
            if found := non_finite(item):
                return (i, *found[0]), found[1]
    return None


def finite_numbers(scene: Scene) -> Iterator[Defect]:
    """No NaN, no infinity and nothing whose powers are infinite, anywhere."""
    for place, _, value in values(ROOT, scene):
        if found := non_finite(value):
            remedy = f"give a finite number, of at most {LARGEST:g}"
            yield Defect(str(place.key(*found[0])), f"the number is {found[1]}", remedy)


def unit_vectors(scene: Scene) -> Iterator[Defect]:
    """Axes and directions have unit length."""
    for place, key, value in values(ROOT, scene):
        if key in AXES and not non_finite(value):
            several = key == "directions"
            for i, vector in enumerate(value if several else (value,)):
                spot = place.key(i) if several else place
                length = hypot(*vector)
                if length == 0.0:
                    yield Defect(str(spot), "the axis has no direction: it is zero", "give a unit vector")
                elif abs(length - 1.0) > UNIT_LENGTH:
                    yield Defect(str(spot), f"not a unit vector: its length is {length:.9g}", _unit(vector, length))


def unit_quaternions(scene: Scene) -> Iterator[Defect]:
    """Quaternions have unit length."""
    for place, key, value in values(ROOT, scene):
        if "quaternion" in key and not non_finite(value):
            norm = hypot(*value)
            if norm == 0.0:
                yield Defect(str(place), "the quaternion is zero", "for no rotation write (1, 0, 0, 0), scalar first")
            elif abs(norm - 1.0) > UNIT_LENGTH:
                yield Defect(str(place), f"not a unit quaternion: its norm is {norm:.9g}", _unit(value, norm))


def _named_items(spot: Place, key: str, items: tuple[Any, ...]) -> Iterator[tuple[Place, Any]]:
    for i, item in enumerate(items):
        name = label(key, item)
        yield (spot.key(i).named(name) if name else spot.key(i)), item


def _unit(vector: tuple[float, ...], length: float) -> str:
    return f"write ({', '.join(repr(component / length) for component in vector)})"
