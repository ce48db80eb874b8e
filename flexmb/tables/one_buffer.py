"""Workspaces whose numbers lie in one buffer, so that one loop copies all of them into a workspace of wider numbers.

A kernel that prepares a matrix for complex numbers, all of whose parts are real, is compiled and run for floats. What
it has left in its workspace is then copied, whatever the arrays are and the records in them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from typing import Any, TypeVar

import numpy as np

from flexmb.jit.wide_arrays import wide_zeros
from flexmb.typing import Index, Real

Bundle = TypeVar("Bundle")

_APART = 8  # floats: every array starts at a multiple of this, as strips, lanes and complex numbers need it


def in_one_buffer(tables: Bundle) -> tuple[Bundle, Real]:
    """A bundle with the same arrays, as parts of one buffer (n,), which is returned with it."""
    arrays = [getattr(tables, field.name) for field in fields(tables)]  # type: ignore[arg-type]
    starts = np.cumsum([0, *[-(-array.nbytes // (8 * _APART)) * _APART for array in arrays]])
    buffer = wide_zeros((int(starts[-1]) // _APART,)).ravel()
    parts = list[Any]()
    for start, array in zip(starts, arrays, strict=False):
        part = buffer[start : start + -(-array.nbytes // 8)].view(np.uint8)[: array.nbytes]
        parts.append(part.view(array.dtype).reshape(array.shape))
        parts[-1][...] = array
    return type(tables)(*parts), buffer


def places(tables: Any, buffer: Real, of: Any) -> Index:
    """Where in the buffer of a bundle its floats lie, (n,): of numbers that take several, the first.

    of: a bundle of the same arrays for plain floats, in whose order they come.
    """
    kept = buffer.copy()
    buffer[:] = np.arange(len(buffer))  # read through the arrays, every number says where it lies
    found = np.concatenate([
        array.ravel()
        for field in fields(of)
        for array in _floats(getattr(tables, field.name), getattr(of, field.name))
    ]).astype(np.int64)  # fmt: skip
    buffer[:] = kept
    return found


def _floats(array: Any, plain: Any) -> Iterator[Any]:
    """The floats of an array, field by field where it has records."""
    if plain.dtype == np.float64:
        yield array if array.shape == plain.shape else array[..., 0]
    for name in plain.dtype.names or ():
        if plain[name].dtype == np.float64:
            yield array[name] if array[name].shape == plain[name].shape else array[name][..., 0]
