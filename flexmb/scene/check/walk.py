"""Every value of a scene with its place, and every number checked where it is."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import msgspec

from flexmb.scene.check.numbers import first_outside, outside, wrong_numbers
from flexmb.scene.columns import alike
from flexmb.scene.convert import ROOT, label
from flexmb.scene.keys import number_keys, struct_keys
from flexmb.scene.problems import Defect, Place
from flexmb.scene.schema import Scene

Suspects = Callable[[Sequence[Any]], Iterable[int]]
"""Returns the numbers of the items, of one collection, that are to be looked at."""


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
    """Numbers of the items with a NaN, an infinity, or a number beyond LARGEST."""
    return {i for i in outside(items) if not finite(items[i])}


def finite(struct: msgspec.Struct) -> bool:
    """Whether all real numbers of a struct, and of the structs inside it, are finite."""
    for _, each in structs(ROOT, struct):
        real = [key for key in number_keys(type(each)).values() if not key.whole]
        if any(first_outside(getattr(each, key.name)) for key in real):
            return False
    return True


def numbers(scene: Scene) -> Iterator[Defect]:
    """Every number is finite, in the range of its key, and of unit length with those beside it if the key says so."""
    for place, struct in _suspects(scene, outside):
        yield from wrong_numbers(place, struct)


def suspicious(scene: Scene, suspects: Suspects) -> Iterator[tuple[Place, str, Any]]:
    """Place, key and value of every field of the scene itself, and of the items of its collections whose numbers
    `suspects` returns."""
    for place, struct in _suspects(scene, suspects):
        yield from _fields(place, struct)


def _suspects(scene: Scene, suspects: Suspects) -> Iterator[tuple[Place, msgspec.Struct]]:
    yield ROOT, scene
    for key in struct_keys(Scene):
        for place, item in entries(scene, key, suspects(getattr(scene, key))):
            yield from structs(place, item)


def structs(place: Place, struct: msgspec.Struct) -> Iterator[tuple[Place, msgspec.Struct]]:
    """A struct with its place, and all structs inside it with theirs."""
    yield place, struct
    for key in struct_keys(type(struct)):
        value, spot = getattr(struct, key), place.key(key)
        if isinstance(value, msgspec.Struct):
            yield from structs(spot, value)
        elif isinstance(value, tuple):
            for inner, item in _named_items(spot, key, value):
                yield from structs(inner, item)


def values(place: Place, struct: msgspec.Struct) -> Iterator[tuple[Place, str, Any]]:
    """Place, key and value of every field of a struct, those of the structs inside it included."""
    for spot, each in structs(place, struct):
        yield from _fields(spot, each)


def _fields(place: Place, struct: msgspec.Struct) -> Iterator[tuple[Place, str, Any]]:
    return ((place.key(key), key, getattr(struct, key)) for key in struct.__struct_fields__)


def holding(*kinds: type) -> Suspects:
    """For `suspicious`: finds the items that contain structs of these kinds."""
    return lambda items: {owner for group in alike(items) if group.kind in kinds for owner in group.owners}


def _named_items(
    spot: Place, key: str, items: Sequence[Any], chosen: Iterable[int] | None = None
) -> Iterator[tuple[Place, Any]]:
    for i in range(len(items)) if chosen is None else sorted(chosen):
        item = items[i]
        name = label(key, item)
        yield (spot.key(i).named(name) if name else spot.key(i)), item
