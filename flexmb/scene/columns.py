"""Structs grouped by kind, and the values of a key as an array.

Checks of scenes with 10^5 bodies use these, because a loop over single values would take too long.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from operator import attrgetter
from typing import Any, NamedTuple

import msgspec
import numpy as np

from flexmb.scene.keys import struct_keys
from flexmb.typing import Real


class Alike(NamedTuple):
    """Structs of one kind; `owners`: the indices of the items that they are, or that contain them."""

    kind: type[msgspec.Struct]
    owners: Sequence[int]
    structs: Sequence[Any]


def column(structs: Sequence[Any], key: str, *shape: int) -> Real:
    """Array (len, *shape) of the values of a key in structs of one kind."""
    values: Any = map(attrgetter(key), structs)
    for _ in shape:
        values = chain.from_iterable(values)
    return np.fromiter(values, float).reshape(len(structs), *shape)


def alike(items: Sequence[Any]) -> list[Alike]:
    """The items of a collection and all structs inside them, grouped by kind."""
    groups: list[Alike] = []
    waiting: list[tuple[Sequence[int], Sequence[Any]]] = [(range(len(items)), items)]
    while waiting:
        owners, structs = waiting.pop()
        kinds = list(map(type, structs))
        for kind in dict.fromkeys(kinds):
            at = range(len(kinds)) if kinds.count(kind) == len(kinds) else [i for i, k in enumerate(kinds) if k is kind]
            group = Alike(kind, [owners[i] for i in at], [structs[i] for i in at])
            groups.append(group)
            waiting += [inner for key in struct_keys(kind) if (inner := _inside(group, key))[0]]
    return groups


def _inside(group: Alike, key: str) -> tuple[list[int], list[Any]]:
    """Owners and structs below a key."""
    values = list(map(attrgetter(key), group.structs))
    if not any(values):  # all are None or empty tuples; a struct is true
        return [], []
    pairs = [
        (owner, each)
        for owner, value in zip(group.owners, values, strict=True)
        for each in (value if isinstance(value, tuple) else (value,))
        if isinstance(each, msgspec.Struct)
    ]
    return [owner for owner, _ in pairs], [each for _, each in pairs]
