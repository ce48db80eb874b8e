"""Arrays as text without loss: float64, deflated, in base64."""

from __future__ import annotations

import base64
import math
import zlib

import msgspec
import numpy as np

from flexmb.typing import Real


class Packed(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """An array of float64: little-endian, row-major, deflated, base64."""

    shape: tuple[int, ...]
    data: str


def pack(values: Real) -> Packed:
    """The array as text."""
    data = np.ascontiguousarray(values, dtype="<f8")
    return Packed(shape=data.shape, data=base64.b64encode(zlib.compress(data.tobytes(), 6)).decode())


def unpack(packed: Packed) -> Real:
    """The array of a text, with the same bits. ValueError if the data do not fill the shape.

    It needs no more memory than the shape says, however large the data would be when unpacked.
    """
    size = packed_bytes(packed)
    unpacker = zlib.decompressobj()
    try:
        deflated = base64.b64decode(packed.data, validate=True)
    except ValueError:
        raise ValueError("its array is damaged: the text is not base64") from None
    try:
        data = unpacker.decompress(deflated, size + 1)
    except zlib.error:
        raise ValueError("its array is damaged: the text was changed or cut off") from None
    if len(data) != size or not unpacker.eof:
        raise ValueError(f"its array of shape {packed.shape} does not hold the numbers that it should")
    return np.frombuffer(data, dtype="<f8").reshape(packed.shape).astype(np.float64)


def packed_bytes(packed: Packed) -> int:
    """Bytes of an array by its shape. ValueError for an invalid shape."""
    if not 1 <= len(packed.shape) <= 2 or any(length < 0 for length in packed.shape):
        raise ValueError(f"its array has the shape {packed.shape}, which no signal has")
    return 8 * math.prod(packed.shape)
