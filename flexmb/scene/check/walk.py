"""Every value of a scene with its place; checks that apply everywhere: finite numbers, unit axes and quaternions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from itertools import chain
from math import hypot
from operator import attrgetter
from typing import Any

import msgspec
import numpy as np

from flexmb.scene.columns import Alike, alike, number_keys
from flexmb.scene.convert import ROOT, label
from flexmb.scene.problems import Defect, Place
from flexmb.scene.schema import Scene

# Data printed to ten digits are unit vectors to 1e-10; vectors with a larger error than this were not normalised.
UNIT_LENGTH = 1e-9
# Larger than any quantity of mechanics in SI units; products of five such numbers are still finite.
LARGEST = 1e60
AXES = ("axis", "direction", "directions")


def entries(scene: Scene, collection: str, chosen: Iterable[int] | None = None) -> Iterator[tuple[Place, Any]]:
    """The items of one of the scene's collections with their places, all or those of the chosen numbers."""
    yield from _named_items(ROOT.key(collection), collection, getattr(scene, collection), chosen)


def sound(scene: Scene, collection: str, chosen: Iterable[int] | None = None) -> Iterator[tuple[Place, Any]]:
    """Like `entries`, without the items with a NaN or an infinity, for which physical checks are meaningless."""
    items = getattr(scene, collection)
    numbers = list(range(len(items)) if chosen is None else chosen)
    unsound = not_finite([items[i] for i in numbers])
    yield from entries(scene, collection, [number for i, number in enumerate(numbers) if i not in unsound])


def not_finite(items: Sequence[Any]) -> set[int]:
    """Numbers of the items with a number that `non_finite` reports."""
    return {
        owner
        for group in alike(items)
        for key in number_keys(group.kind)
        if not _all_finite(values := list(map(attrgetter(key), group.structs)))
        for owner, value in zip(group.owners, values, strict=True)
        if non_finite(value)
    }


def _all_finite(values: list[Any]) -> bool:
    """Whether numbers, or nested tuples of numbers of equal shape, are finite; False for anything else."""
    try:
        while values and isinstance(values[0], tuple):
            values = list(chain.from_iterable(values))
        return bool(np.all(np.abs(np.array(values, float)) <= LARGEST))
    except (TypeError, ValueError, OverflowError):
        return False


def suspicious(scene: Scene, suspects: Callable[[Sequence[Any]], Iterable[int]]) -> Iterator[tuple[Place, str, Any]]:
    """Place, key and value of every field of the scene itself, and of the items of its collections whose numbers
    `suspects` returns."""
    for key in scene.__struct_fields__:
        value, spot = getattr(scene, key), ROOT.key(key)
        if isinstance(value, tuple) and value and isinstance(value[0], msgspec.Struct):
            for place, item in _named_items(spot, key, value, suspects(value)):
                yield from values(place, item)
        else:
            yield spot, key, value


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
    """No number is NaN, infinite, or so large that its powers overflow."""
    for place, _, value in suspicious(scene, not_finite):
        if found := non_finite(value):
            remedy = f"give a finite number, of at most {LARGEST:g}"
            yield Defect(str(place.key(*found[0])), f"the number is {found[1]}", remedy)


def unit_vectors(scene: Scene) -> Iterator[Defect]:
    """Axes and directions have unit length."""
    for place, key, value in suspicious(scene, partial(_off_unit, wanted=AXES.__contains__)):
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
    for place, key, value in suspicious(scene, partial(_off_unit, wanted=_is_quaternion)):
        if _is_quaternion(key) and not non_finite(value):
            norm = hypot(*value)
            if norm == 0.0:
                yield Defect(str(place), "the quaternion is zero", "for no rotation write (1, 0, 0, 0), scalar first")
            elif abs(norm - 1.0) > UNIT_LENGTH:
                yield Defect(str(place), f"not a unit quaternion: its norm is {norm:.9g}", _unit(value, norm))


def _is_quaternion(key: str) -> bool:
    return "quaternion" in key


def holding(*kinds: type) -> Callable[[Sequence[Any]], set[int]]:
    """For `suspicious`: finds the items that contain structs of these kinds."""
    return lambda items: {owner for group in alike(items) if group.kind in kinds for owner in group.owners}


def _off_unit(items: Sequence[Any], wanted: Callable[[str], bool]) -> set[int]:
    """Items with a vector under a wanted key that may not have unit length."""
    return {
        owner
        for group in alike(items)
        for key in filter(wanted, group.kind.__struct_fields__)
        for owner in _not_unit(group, key)
    }


def _not_unit(group: Alike, key: str) -> list[int]:
    values = list(map(attrgetter(key), group.structs))
    try:
        length = np.linalg.norm(np.array(values, float), axis=-1)
    except (TypeError, ValueError, OverflowError):  # tuples of several
        return [owner for owner, value in zip(group.owners, values, strict=True) if value]
    unit = np.abs(length - 1.0) <= 0.5 * UNIT_LENGTH  # half of it, because `hypot` rounds differently
    return [group.owners[i] for i in np.flatnonzero(~unit.reshape(len(values), -1).all(axis=1)).tolist()]


def _named_items(
    spot: Place, key: str, items: Sequence[Any], chosen: Iterable[int] | None = None
) -> Iterator[tuple[Place, Any]]:
    for i in range(len(items)) if chosen is None else sorted(chosen):
        item = items[i]
        name = label(key, item)
        yield (spot.key(i).named(name) if name else spot.key(i)), item


def _unit(vector: tuple[float, ...], length: float) -> str:
    return f"write ({', '.join(repr(component / length) for component in vector)})"
