"""Squares of rows to lanes and back, against numpy's transposition."""

import numpy as np
import pytest
from numba.core.errors import TypingError

from flexmb.jit.bundle import bundle
from flexmb.jit.kernel import kernel
from flexmb.jit.lanes import LANES
from flexmb.jit.transposition import square_to_lanes, square_to_rows
from flexmb.jit.wide_arrays import wide_zeros


@bundle
class Held:
    values: np.ndarray  # (n,LANES)


@kernel
def into(rows, first, i, held):
    square_to_lanes(rows, first, i, held.values)


@kernel
def back(rows, first, i, held):
    square_to_rows(rows, first, i, held.values)


def held(n: int) -> Held:
    return Held(wide_zeros((n,)))


def rows(copies: int, n: int) -> np.ndarray:
    """At an address that is no multiple of a vector's length."""
    room = np.arange(copies * n + 1.0)[1:]
    return room.reshape(copies, n)


@pytest.mark.parametrize(("copies", "n", "first", "i"), [(8, 8, 0, 0), (8, 11, 0, 3), (20, 13, 12, 5), (9, 29, 1, 16)])
def test_a_square_is_transposed_there_and_back(copies, n, first, i):
    given, lanes, found = rows(copies, n), held(n), np.zeros((copies, n))
    into(given, first, i, lanes)
    square = (slice(first, first + LANES), slice(i, i + LANES))
    wanted = np.zeros((n, LANES))
    wanted[i : i + LANES] = given[square].T
    np.testing.assert_array_equal(lanes.values, wanted)
    back(found, first, i, lanes)
    only = np.zeros((copies, n))
    only[square] = given[square]
    np.testing.assert_array_equal(found, only)


def test_interpreted_it_is_the_same():
    given, lanes, found = rows(8, 9), held(9), held(9)
    into.py_func(given, 0, 1, lanes)
    into(given, 0, 1, found)
    np.testing.assert_array_equal(lanes.values, found.values)
    copy = np.zeros((8, 9))
    back.py_func(copy, 0, 1, lanes)
    np.testing.assert_array_equal(copy[:, 1:], given[:, 1:])


@pytest.mark.parametrize("wrong", [np.zeros((8, 8), np.float32), np.zeros((8, 9)).T, np.zeros(8)])
def test_other_rows_are_refused(wrong):
    with pytest.raises(TypingError):
        into(wrong, 0, 0, held(8))
