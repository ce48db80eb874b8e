"""Arrays whose floats are lanes, duals or complex: each float gets a last axis, aligned for vector instructions.

Integers get none: the structure of a scene is the same in all lanes.
"""

from __future__ import annotations

from math import prod
from typing import Any

import numpy as np

from flexmb.jit.complex_numbers import COMPLEX, WIDTH
from flexmb.jit.duals import DUAL
from flexmb.jit.lanes import BYTES, LANE
from flexmb.jit.tables import PADDING


def wide_dtype(dtype: np.dtype, number: Any = LANE) -> np.dtype:
    """Type of the records: floats first, so that each lane value or dual is aligned to BYTES, then integers."""
    if dtype == np.float64:
        return dtype
    floats, others = list[Any](), list[Any]()
    for name in dtype.names or ():
        base, shape = dtype[name].subdtype or (dtype[name], ())
        if base == np.float64:
            floats.append((name, base, (*shape, _width(number))))
        else:
            others.append((name, base, shape))
    if not dtype.names or not floats:
        return dtype
    size = np.dtype([*floats, *others]).itemsize
    return np.dtype([*floats, *others, (PADDING[number], np.uint8, (BYTES - size % BYTES,))])


def wide_zeros(shape: tuple[int, ...], dtype: Any = np.float64, number: Any = LANE) -> Any:
    """Zeros (*shape, width) of floats of such numbers, or (*shape,) of records or integers; aligned to BYTES."""
    dtype = wide_dtype(np.dtype(dtype), number)
    shape = (*shape, _width(number)) if dtype == np.float64 else shape
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
    return _widened(array, DUAL)


def as_complex(array: Any) -> Any:
    """The same numbers as complex ones with zero imaginary parts."""
    return _widened(array, COMPLEX)


def _width(number: Any) -> int:
    """Floats in a number."""
    return WIDTH if number == COMPLEX else int(number.width)


def _widened(array: Any, number: Any) -> Any:
    """The same numbers, each the first of the floats of such a number, the others zero."""
    out = wide_zeros(array.shape, array.dtype, number)
    if array.dtype == np.float64:
        out[..., 0] = array
    elif array.dtype.names is None:
        out[...] = array
    else:
        for name in array.dtype.names:
            is_float = (array.dtype[name].subdtype or (array.dtype[name],))[0] == np.float64
            (out[name][..., 0] if is_float else out[name])[...] = array[name]
    return out
