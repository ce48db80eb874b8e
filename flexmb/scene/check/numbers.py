"""The check of every number of a scene: finite, in the range that its type declares, and of unit length if it says so.

The types of the schema declare what is read here (`flexmb.scene.quantities`). All that is outside is reported with its
place and its remedy, whatever else is wrong. The numbers of many structs are compared at once, as arrays.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cache
from itertools import chain
from math import hypot
from operator import attrgetter
from typing import Any, NamedTuple

import msgspec
import numpy as np

from flexmb.scene.columns import Alike, alike
from flexmb.scene.keys import Key, number_keys
from flexmb.scene.problems import Defect, Doubt, Place
from flexmb.scene.quantities import FINITE, LARGEST, Range
from flexmb.scene.sizes import counted
from flexmb.typing import Real

# Data printed to ten digits are unit vectors to 1e-10; vectors with a larger error than this were not normalised.
UNIT_LENGTH = 1e-9

Outside = tuple[tuple[int, ...], float]
"""Index in nested tuples, and value, of a number that is outside of its range."""


class _Compiled(NamedTuple):
    """How the numbers of a kind of struct are found: those under keys that have one each, and under all others."""

    single: Callable[[Any], Any]
    least: Real
    most: Real
    excluded: Real
    others: tuple[Key, ...]


@cache
def _compiled(kind: type[msgspec.Struct]) -> _Compiled | None:
    keys = number_keys(kind).values()
    single = [key for key in keys if key.single]
    if not keys:
        return None
    excluded = [np.nan if key.range.excluded is None else key.range.excluded for key in single]
    least, most = np.array([key.range.least for key in single]), np.array([key.range.most for key in single])
    names = [key.name for key in single]
    getter = attrgetter(*names) if names else lambda _: ()
    others = tuple(key for key in keys if not key.single)
    return _Compiled(getter, least, most, np.array(excluded), others)


def outside(items: Sequence[Any]) -> set[int]:
    """Numbers of the items that have, in themselves or in structs inside them, a number that is to be looked at."""
    wrong: set[int] = set()
    for group in alike(items):
        compiled = _compiled(group.kind)
        if compiled is not None:
            if compiled.least.size:
                wrong.update(group.owners[i] for i in _single(compiled, group))
            for key in compiled.others:
                wrong.update(_off_unit(group, key.name) if key.unit_length else _nested(group, key))
    return wrong


def _single(compiled: _Compiled, group: Alike) -> Iterator[int]:
    rows = list(map(compiled.single, group.structs))
    try:
        table = np.array(rows, float).reshape(len(rows), -1)
    except OverflowError:  # whole numbers beyond all real ones
        yield from range(len(rows))
        return
    inside = (compiled.least <= table) & (table <= compiled.most) & (table != compiled.excluded)
    if not inside.all():
        for i, j in np.argwhere(~inside).tolist():
            row = rows[i]
            if (row[j] if isinstance(row, tuple) else row) is not None:
                yield i


def _nested(group: Alike, key: Key) -> list[int]:
    values = list(map(attrgetter(key.name), group.structs))
    if _all_inside(values, key.range):
        return []
    return [owner for owner, value in zip(group.owners, values, strict=True) if first_outside(value, key.range)]


def _all_inside(values: list[Any], allowed: Range) -> bool:
    """Whether numbers, or nested tuples of numbers of equal depth, are inside; False for anything else."""
    while values and isinstance(values[0], tuple):
        if not all(isinstance(value, tuple) for value in values):
            return False  # some have it, others nothing
        values = list(chain.from_iterable(values))
    try:
        table = np.array(values, float)
    except (TypeError, ValueError, OverflowError):
        return False
    return bool(np.all((allowed.least <= table) & (table <= allowed.most))) and allowed.excluded is None


def _off_unit(group: Alike, key: str) -> list[int]:
    values = list(map(attrgetter(key), group.structs))
    try:
        length = np.linalg.norm(np.array(values, float), axis=-1)
    except (TypeError, ValueError, OverflowError):  # tuples of several
        return [owner for owner, value in zip(group.owners, values, strict=True) if value]
    unit = np.abs(length - 1.0) <= 0.5 * UNIT_LENGTH  # half of it, because `hypot` rounds differently
    return [group.owners[i] for i in np.flatnonzero(~unit.reshape(len(values), -1).all(axis=1)).tolist()]


def first_outside(value: Any, allowed: Range = FINITE) -> Outside | None:
    """The first number in a value, or in nested tuples, that is not in the range; None also for other things."""
    if isinstance(value, float | int):
        return None if allowed.holds(value) else ((), value)
    if isinstance(value, tuple):
        for i, item in enumerate(value):
            if found := first_outside(item, allowed):
                return (i, *found[0]), found[1]
    return None


def in_range(struct: msgspec.Struct) -> bool:
    """Whether the numbers of a struct itself are those that its keys take; what is only doubtful is."""
    keys = [key for key in number_keys(type(struct)).values() if not key.range.waiver]
    return not any(first_outside(getattr(struct, key.name), key.range) for key in keys)


def wrong_numbers(place: Place, struct: msgspec.Struct) -> Iterator[Defect]:
    """What is wrong, or doubtful, with the numbers of a struct itself."""
    for key in number_keys(type(struct)).values():
        value, spot = getattr(struct, key.name), place.key(key.name)
        if found := first_outside(value, key.range):
            yield _problem(spot.key(*found[0]), key, found[1])
        elif key.unit_length:
            several = not value or isinstance(value[0], tuple)
            for i, vector in enumerate(value if several else (value,)):
                yield from _of_unit_length(spot.key(i) if several else spot, vector)


def _problem(place: Place, key: Key, number: float) -> Defect:
    """The message for a number outside, for which there is no other place."""
    if not key.whole and not FINITE.holds(number):
        return Defect(str(place), f"the number is {number}", f"give a finite number, of at most {LARGEST:g}")
    allowed, noun = key.range, key.noun
    size = counted(number) if isinstance(number, int) else f"{number:g}" + ("" if key.unit == "1" else f" {key.unit}")
    if key.whole:
        what = f"{size} {noun}"
    elif number < 0.0 <= allowed.least:
        what = f"negative {noun}: {size}"
    else:
        what = f"the {noun} is {size}, {'and must not be zero' if number == 0.0 else f'not {allowed}'}"
    remedy = allowed.remedy or allowed.words(noun)
    return Doubt(str(place), what, remedy, allowed.waiver) if allowed.waiver else Defect(str(place), what, remedy)


def _of_unit_length(place: Place, vector: tuple[float, ...]) -> Iterator[Defect]:
    """An axis or direction, or a quaternion, has unit length."""
    length = hypot(*vector)
    if abs(length - 1.0) <= UNIT_LENGTH:
        return
    quaternion = len(vector) == 4
    if length == 0.0 and quaternion:
        yield Defect(str(place), "the quaternion is zero", "for no rotation write (1, 0, 0, 0), scalar first")
    elif length == 0.0:
        yield Defect(str(place), "the axis has no direction: it is zero", "give a unit vector")
    else:
        what = f"quaternion: its norm is {length:.9g}" if quaternion else f"vector: its length is {length:.9g}"
        remedy = f"write ({', '.join(repr(component / length) for component in vector)})"
        yield Defect(str(place), f"not a unit {what}", remedy)
