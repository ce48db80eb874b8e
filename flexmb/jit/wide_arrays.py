"""Arrays whose floats are lanes, duals or complex: each float gets a last axis, aligned for vector instructions.

Integers get none: the structure of a scene is the same in all lanes.
"""

from __future__ import annotations

from math import prod
from typing import Any

import numpy as np

from flexmb.jit.complex_numbers import WIDTH
from flexmb.jit.duals import DualType
from flexmb.jit.lanes import BYTES, LANES
from flexmb.jit.tables import PADDING


def wide_dtype(dtype: np.dtype, width: int = LANES) -> np.dtype:
    """Type of the records: floats first, so that each lane value is aligned to BYTES, then integers."""
    if dtype == np.float64:
        return dtype
    floats, others = list[Any](), list[Any]()
    for name in dtype.names or ():
        base, shape = dtype[name].subdtype or (dtype[name], ())
        if base == np.float64:
            floats.append((name, base, (*shape, width)))
        else:
            others.append((name, base, shape))
    if not dtype.names or not floats:
        return dtype
    size = np.dtype([*floats, *others]).itemsize
    return np.dtype([*floats, *others, (PADDING, np.uint8, (BYTES - size % BYTES,))])


def wide_zeros(shape: tuple[int, ...], dtype: Any = np.float64, width: int = LANES) -> Any:
    """Zeros (*shape, width) of floats, or (*shape,) of records or integers."""
    dtype = wide_dtype(np.dtype(dtype), width)
    shape = (*shape, width) if dtype == np.float64 else shape
    size = prod(shape) * dtype.itemsize
    room = np.zeros(size + BYTES, np.uint8)
    start = -room.ctypes.data % BYTES
    return room[start : start + size].view(dtype).reshape(shape)


def in_lanes(copies: list[Any]) -> Any:
    """The lane array of arrays of equal shape, one for each of LANES copies; integers are those of the first."""
    first = copies[0]
    out = wide_zeros(first.shape, first.dtype)
    if first.dtype == np.float64:
        np.stack(copies, axis=-1, out=out)
    elif first.dtype.names is None:
        out[...] = first
    else:
        for name in first.dtype.names:
            base = (first.dtype[name].subdtype or (first.dtype[name],))[0]
            out[name] = np.stack([each[name] for each in copies], axis=-1) if base == np.float64 else first[name]
    return out


def as_duals(array: Any) -> Any:
    """The same numbers as duals with zero derivatives."""
    return _widened(array, DualType.width)


def as_complex(array: Any) -> Any:
    """The same numbers as complex ones with zero imaginary parts."""
    return _widened(array, WIDTH)


def _widened(array: Any, width: int) -> Any:
    """The same numbers, each the first of `width` floats, the others zero."""
    out = wide_zeros(array.shape, array.dtype, width)
    if array.dtype == np.float64:
        out[..., 0] = array
    elif array.dtype.names is None:
        out[...] = array
    else:
        for name in array.dtype.names:
            is_float = (array.dtype[name].subdtype or (array.dtype[name],))[0] == np.float64
            (out[name][..., 0] if is_float else out[name])[...] = array[name]
    return out
