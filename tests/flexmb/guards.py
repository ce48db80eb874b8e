"""Bundles whose arrays lie between guards, because kernels do not check indices.

A kernel that writes beyond an array changes a guard, and what it reads there is no number.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from flexmb.jit.lanes import BYTES

SIGNALLING = np.uint64(0xFFF7FFFFFFFFFFFF)
"""A NaN that any operation changes to another one, so that a number added to it in place is noticed, too."""

NOTHING = np.uint64(0xFFFFFFFFFFFFFFFF)
"""A NaN, and the integer -1: for tables that are only read."""

_SOME = 64 * BYTES


@dataclass(frozen=True, repr=False)
class Guarded:
    """A copy of a bundle; of each of its arrays the name, the words before it and those after it."""

    bundle: Any
    guards: list[tuple[str, np.ndarray, np.ndarray]]
    word: np.uint64

    def written(self) -> list[str]:
        """Names of the arrays beyond which something was written."""
        return [name for name, *around in self.guards if np.any(np.concatenate(around) != self.word)]


def guarded(bundle: Any, word: np.uint64 = SIGNALLING, name: str = "") -> Guarded:
    """A copy of a bundle and of the bundles in it; each guard has room for one row of its array and more."""
    parts, guards = dict[str, Any](), list[tuple[str, np.ndarray, np.ndarray]]()
    for field in fields(bundle):
        value, own = getattr(bundle, field.name), f"{name}.{field.name}".removeprefix(".")
        if isinstance(value, np.ndarray):
            parts[field.name], before, after = _between(value, word)
            guards.append((own, before, after))
        else:
            inner = guarded(value, word, own)
            parts[field.name] = inner.bundle
            guards += inner.guards
    return Guarded(type(bundle)(**parts), guards, word)


def _between(array: np.ndarray, word: np.uint64) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A copy of an array, as aligned as arrays of strips, and its guards."""
    size = _SOME + -(-array[:1].nbytes // BYTES) * BYTES
    room = np.full((2 * size + array.nbytes + 2 * BYTES) // 8, word)
    start = (size + -room.ctypes.data % BYTES) // 8
    stop = start + -(-array.nbytes // 8)
    copy = room[start:stop].view(np.uint8)[: array.nbytes].view(array.dtype).reshape(array.shape)
    copy[...] = array
    return copy, room[:start], room[stop:]
