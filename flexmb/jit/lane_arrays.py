"""Arrays whose floats are lanes: a last axis of eight beside each float, at addresses that vector instructions ask for.

Integers stand once: what a scene consists of is the same in all copies.
"""

from __future__ import annotations

from math import prod
from typing import Any

import numpy as np

from flexmb.jit.lanes import BYTES, LANES
from flexmb.jit.tables import PADDING


def lane_dtype(dtype: np.dtype) -> np.dtype:
    """Type of the records of a lane array: floats first, so that each begins at a multiple of BYTES, then integers."""
    if dtype == np.float64:
        return dtype
    floats, others = list[Any](), list[Any]()
    for name in dtype.names or ():
        base, shape = dtype[name].subdtype or (dtype[name], ())
        if base == np.float64:
            floats.append((name, base, (*shape, LANES)))
        else:
            others.append((name, base, shape))
    if not dtype.names or not floats:
        return dtype
    size = np.dtype(others).itemsize
    return np.dtype([*floats, *others, (PADDING, np.uint8, (BYTES - size % BYTES,))])


def lane_zeros(shape: tuple[int, ...], dtype: Any = np.float64) -> Any:
    """Zeros (*shape, LANES) of floats, or (*shape,) of records or integers."""
    dtype = lane_dtype(np.dtype(dtype))
    shape = (*shape, LANES) if dtype == np.float64 else shape
    size = prod(shape) * dtype.itemsize
    room = np.zeros(size + BYTES, np.uint8)
    start = -room.ctypes.data % BYTES
    return room[start : start + size].view(dtype).reshape(shape)


def in_lanes(copies: list[Any]) -> Any:
    """The lane array of equal arrays, one for each of LANES copies; integers are those of the first."""
    first = copies[0]
    out = lane_zeros(first.shape, first.dtype)
    if first.dtype == np.float64:
        np.stack(copies, axis=-1, out=out)
    elif first.dtype.names is None:
        out[...] = first
    else:
        for name in first.dtype.names:
            base = (first.dtype[name].subdtype or (first.dtype[name],))[0]
            out[name] = np.stack([each[name] for each in copies], axis=-1) if base == np.float64 else first[name]
    return out
