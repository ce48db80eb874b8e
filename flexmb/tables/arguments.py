"""Conversion of the arguments of public calls to arrays of real numbers of the right shape, with clear errors.

Integers and single precision are cast, sequences become arrays. Anything but real numbers (complex numbers, strings,
booleans, None) is a TypeError; wrong lengths, masked entries, NaN and infinity are a ValueError.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from numbers import Integral, Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
_FLOAT = np.dtype(float)
_MOST_BITS = 128  # of integers; Python refuses to write those of 4300 digits
_DEEPEST = 3  # levels of nested sequences that are searched for masked arrays


def array(name: str, values: Any) -> Vector:
    """An array of floats of any shape, C-contiguous, aligned and writable; the array itself if it is all of that."""
    if type(values) is np.ndarray and values.dtype is _FLOAT and values.flags.carray:
        return values
    _refuse_masked(name, values)
    try:
        array = np.asarray(values)
    except ValueError:
        raise ValueError(f"{name}: rows of different lengths; give an array of numbers") from None
    if array.size == 0 and not isinstance(values, np.ndarray):
        array = array.astype(float)  # an empty list has no type
    if array.dtype.kind not in "iuf":
        raise TypeError(f"{name}: real numbers are needed, not {_kind(values, array)}")
    return np.array(array, float, order="C")


def shaped(name: str, values: Any, shape: tuple[int, ...]) -> Vector:
    """An array of floats of a given shape, not checked for finite numbers."""
    found = array(name, values)
    if found.shape != shape:
        raise ValueError(f"{name} has the shape {found.shape}, and {shape} is needed")
    return found


def held(name: str, values: Any, shape: tuple[int | None, ...], kinds: str = "iuf") -> None:
    """Check that a field of a result is still an array of this shape, None for any length; TypeError or ValueError.

    Results are created by the library, but users can replace their arrays, or change shapes in place.
    """
    if type(values) is np.ndarray and values.shape == shape and values.dtype.kind in kinds:
        return  # by far the most frequent case: the others take five times as long
    if not isinstance(values, np.ndarray) or values.dtype.kind not in kinds:
        wanted = "numbers" if "c" in kinds else "real numbers"
        kind = _kind(values, values) if isinstance(values, np.ndarray) else f"a {type(values).__name__}"
        raise TypeError(f"{name}: an array of {wanted} is needed, not {kind}")
    _refuse_masked(name, values)
    if len(values.shape) != len(shape) or any(n not in (None, m) for n, m in zip(shape, values.shape, strict=True)):
        wanted = ", ".join("any" if n is None else str(n) for n in shape)
        raise ValueError(f"{name} has the shape {values.shape}, and belongs to others that need ({wanted})")


def vector(name: str, values: Any, length: int) -> Vector:
    """An array (length,) of floats, not checked for finite numbers."""
    found = array(name, values)
    if found.shape != (length,):
        raise ValueError(f"{name}: {length} numbers in a row are needed, got an array of shape {found.shape}")
    return found


def finite(name: str, values: Vector) -> Vector:
    """The array itself; ValueError if an entry is NaN or infinite."""
    if not np.isfinite(values).all():
        place = np.unravel_index(int(np.argmin(np.isfinite(values))), values.shape)
        where = ", ".join(map(str, place))
        raise ValueError(f"{name}[{where}] is {values[place]}: give finite numbers")
    return values


def representable(result: Vector) -> Vector:
    """The array itself, computed from finite arguments; OverflowError if an entry is not finite."""
    if not np.isfinite(result).all():
        raise OverflowError("the result is not finite: the numbers given are so large that their products overflow")
    return result


def number(name: str, value: Any) -> float:
    """The value as a finite float; TypeError or ValueError."""
    if type(value) is not float:
        if not isinstance(value, Real) or isinstance(value, bool):
            raise TypeError(f"{name} is {value!r}: give a real number")
        try:
            value = float(value)
        except OverflowError:
            raise ValueError(f"{name} is beyond all floating-point numbers: give a finite number") from None
    if not math.isfinite(value):
        raise ValueError(f"{name} is {value}: give a finite number")
    return float(value)


def whole(name: str, value: Any) -> int:
    """The value as an integer; TypeError for others, ValueError for one beyond all counts."""
    if not isinstance(value, Integral) or isinstance(value, bool):
        raise TypeError(f"{name} is {value!r}: give a whole number")
    if (bits := (found := int(value)).bit_length()) > _MOST_BITS:
        raise ValueError(f"{name} is a number of {bits} bits: give one of {_MOST_BITS} bits at most")
    return found


def count(name: str, value: Any) -> int:
    """The value as an integer of at least 1; TypeError or ValueError."""
    number = whole(name, value)
    if number < 1:
        raise ValueError(f"{name} is {number}: at least 1 is needed")
    return number


def position(name: str, value: Any, length: int) -> int:
    """A place in a sequence, negative if counted from its end; TypeError, or IndexError where there is none."""
    number = whole(name, value)
    if not -length <= number < length:
        raise IndexError(f"{name} is {number}: there are {length}")
    return number


def index(name: str, value: Any, length: int) -> int:
    """An index from 0 to `length` - 1; TypeError or ValueError."""
    number = whole(name, value)
    if not 0 <= number < length:
        raise ValueError(f"{name} is {number}: there are {length}, counted from 0")
    return number


def one_of(name: str, value: Any, known: Iterable[str]) -> str:
    """The value if it is one of the known names; ValueError, which lists them, if not."""
    names = tuple(known)
    if not isinstance(value, str) or value not in names:
        raise ValueError(f"{name} is {value!r}: use one of {', '.join(map(repr, names))}")
    return value


def _refuse_masked(name: str, values: Any, place: tuple[int, ...] = ()) -> None:
    """ValueError for an array, or a sequence of arrays, with a masked entry, whose value is undefined."""
    if isinstance(values, np.ma.MaskedArray):
        if np.ma.is_masked(values):
            masked = np.argwhere(np.ma.getmaskarray(values))[0]
            where = ", ".join(map(str, (*place, *masked)))
            raise ValueError(f"{name}[{where}] is masked: give a number in its place, as values.filled(0.0) does")
    elif isinstance(values, list | tuple) and len(place) < _DEEPEST:
        for i, value in enumerate(values):
            if not isinstance(value, float | int):
                _refuse_masked(name, value, (*place, i))


def _kind(values: Any, found: NDArray[Any]) -> str:
    return "complex ones" if found.dtype.kind == "c" else f"{type(values).__name__} of {found.dtype}"
