"""Lanes: eight copies of a number, against numpy on the arrays that they come from."""

import numpy as np
import pytest
from numba.core.errors import TypingError

from flexmb.jit.bundle import bundle
from flexmb.jit.kernel import helper, kernel
from flexmb.jit.lanes import BYTES, LANE, LANES, every, kept, select, some
from flexmb.jit.wide_arrays import in_lanes, wide_dtype, wide_zeros
from flexmb.spatial.scalar import atan2, cos, sin, sincos, sqrt

ULP = 2.0**-52

ROW = np.dtype([("number", np.int64), ("x", np.float64), ("v", np.float64, (2, 3))])


@bundle
class Numbers:
    numbers = LANE

    a: np.ndarray  # (n,LANES)
    b: np.ndarray  # (n,LANES)
    out: np.ndarray  # (m,LANES)
    rows: np.ndarray  # (r,) ROW


def numbers(a, b=None, out=8) -> Numbers:
    a = np.atleast_2d(a)
    b = a if b is None else np.atleast_2d(b)
    return Numbers(in_lanes(list(a.T)), in_lanes(list(b.T)), wide_zeros((out,)), wide_zeros((3,), ROW))


def random(seed: int, rows: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-2.0, 2.0, (rows, LANES))


@kernel
def arithmetic(n):
    a, b, out = n.a[0], n.b[0], n.out
    out[0] = 2 * a + b / 3.0 - 1
    total = 0.0
    for i in range(3):
        total += a * i
        total /= 2.0
    out[1] = -total
    v = (0.0, a, 1.0)
    out[2] = v[0] + v[1] * v[2]
    out[3] = 4.0
    out[3] *= b
    out[4] = sqrt(abs(a))
    out[5] = a.real


def test_arithmetic_of_lanes_is_that_of_each():
    a, b = random(0)[0], random(1)[0]
    found = numbers(a, b)
    arithmetic(found)
    expected = [2 * a + b / 3 - 1, -(((0.0 / 2 + a) / 2 + 2 * a) / 2), a, 4 * b, np.sqrt(np.abs(a)), a]
    np.testing.assert_allclose(found.out[:6], expected, rtol=0.0, atol=8 * ULP)


@kernel
def comparisons(n):
    a, b, out = n.a[0], n.b[0], n.out
    out[0] = select(a < b, a, b)
    out[1] = select((a > 0.0) & (b > 0.0), 1.0, 0.0)
    out[2] = select((a > 0.0) | (b > 0.0), 1.0, 0.0)
    out[3] = select(~(a >= b), 1.0, 0.0)
    out[4] = select(a != a, 1.0, 0.0)
    out[5] = kept(a <= b, a)
    out[6] = select(True, a, b)
    return every(a < b), some(a < b), every(a == a)


def test_masks_are_truths_of_each_lane():
    a, b = random(2)[0], random(3)[0]
    a[2], b[5] = np.nan, np.nan
    found = numbers(a, b)
    assert comparisons(found) == (False, True, False)
    np.testing.assert_array_equal(found.out[0], np.where(a < b, a, b))
    np.testing.assert_array_equal(found.out[1], (a > 0) & (b > 0))
    np.testing.assert_array_equal(found.out[2], (a > 0) | (b > 0))
    np.testing.assert_array_equal(found.out[3], ~(a >= b))
    np.testing.assert_array_equal(found.out[4], np.isnan(a))
    np.testing.assert_array_equal(found.out[5], np.where(a <= b, a, np.nan))
    np.testing.assert_array_equal(found.out[6], a)


def test_all_lanes_or_none():
    assert comparisons(numbers(np.zeros(LANES), np.ones(LANES))) == (True, True, True)
    assert comparisons(numbers(np.ones(LANES), np.zeros(LANES))) == (False, False, True)


@helper
def smaller(a, b):
    if every(a <= b):
        return kept(a <= b, a), True
    return select(a < b, a, b), some(a < b)


@kernel
def of_floats(a, b):
    return smaller(a, b)


def test_of_floats_they_are_the_plain_words():
    assert of_floats(1.0, 2.0) == (1.0, True)
    assert of_floats(2.0, 1.0) == (1.0, False)
    assert smaller.py_func(2.0, 1.0) == (1.0, False)
    assert smaller.py_func(1.0, 2.0) == (1.0, True)


@kernel
def branch(n):
    if n.a[0] > 0.0:
        return 1
    return 0


def test_no_branch_can_follow_a_mask():
    """Negative control: a kernel that asks a lane as if it were a float is refused, not compiled wrongly."""
    with pytest.raises((TypingError, NotImplementedError)):
        branch(numbers(random(4)))


@kernel
def circular(n):
    for i in range(n.a.shape[0]):
        s, c = sincos(n.a[i])
        n.out[2 * i] = s
        n.out[2 * i + 1] = c


def sines(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    found = numbers(x, out=2 * len(x))
    circular(found)
    return found.out[::2], found.out[1::2]


def test_a_lane_does_not_depend_on_its_neighbours():
    x = np.random.default_rng(3).uniform(-9.0, 9.0, (50, LANES))
    disturbed = x.copy()
    disturbed[:, 3] = 1e9
    disturbed[::2, 6] = np.nan
    own = np.array([0, 1, 2, 4, 5, 7])
    for one, other in zip(sines(x), sines(disturbed), strict=True):
        np.testing.assert_array_equal(one[:, own], other[:, own])


@kernel
def others(n):
    n.out[0] = atan2(n.a[0], n.b[0])
    n.out[1] = sin(n.a[0])
    n.out[2] = cos(n.a[0])
    n.out[3] = atan2(n.a[0], 1.0)


def test_other_functions_lane_by_lane():
    a, b = random(5)[0], random(6)[0]
    found = numbers(a, b)
    others(found)
    expected = [np.arctan2(a, b), np.sin(a), np.cos(a), np.arctan(a)]
    np.testing.assert_allclose(found.out[:4], expected, rtol=4 * ULP, atol=0.0)


@kernel
def through_rows(n):
    for i in range(n.rows.shape[0]):
        row = n.rows[i]
        row.number = i + 5
        row.x = n.a[0] * i
        for j in range(3):
            row.v[1, j] = row.x + j
        n.out[i] = row.v[1, 2] + row.number


def test_floats_of_records_are_lanes_and_integers_are_shared():
    a = random(7)[0]
    found = numbers(a)
    through_rows(found)
    assert found.rows["number"].tolist() == [5, 6, 7]
    for i in range(3):
        np.testing.assert_allclose(found.out[i], a * i + 2 + i + 5, rtol=0.0, atol=16 * ULP)
        np.testing.assert_array_equal(found.rows["x"][i], a * i)


def test_arrays_of_lanes_stand_where_vector_instructions_ask():
    for n in (1, 3):
        rows = wide_zeros((n,), ROW)
        assert rows.ctypes.data % BYTES == 0
        assert rows.dtype.itemsize % BYTES == 0
        assert all(rows.dtype.fields[name][1] % BYTES == 0 for name in ("x", "v"))
        assert wide_zeros((n, 2)).shape == (n, 2, LANES)
    assert wide_dtype(np.dtype(np.int64)) == np.int64


def test_copies_become_lanes():
    copies = [np.array([(k, 0.5 * k, np.full((2, 3), k))], ROW) for k in range(LANES)]
    found = in_lanes(copies)
    np.testing.assert_array_equal(found["x"][0], 0.5 * np.arange(LANES))
    np.testing.assert_array_equal(found["v"][0, 1, 2], np.arange(LANES))
    assert found["number"].tolist() == [0]
