"""Strips: eight neighbours of a row at once, against numpy; in lanes one element each, with the same results."""

import numpy as np
import pytest
from numba.core.errors import TypingError

from flexmb.jit.bundle import bundle
from flexmb.jit.counting import count
from flexmb.jit.kernel import helper, kernel
from flexmb.jit.lanes import BYTES, LANE, LANES
from flexmb.jit.strips import (
    ROW,
    add_across,
    after,
    part,
    put,
    put_across,
    start,
    strip,
    strip_zeros,
    total,
    whole,
    width,
    with_seventh,
)
from flexmb.jit.wide_arrays import in_lanes

ULP = 2.0**-52


@bundle
class Rows:
    a: np.ndarray  # (8,24)
    out: np.ndarray  # (24,24)


@bundle
class LaneRows(Rows):
    numbers = LANE


def rows(seed: int = 0) -> Rows:
    a, out = strip_zeros((8, 24)), strip_zeros((24, 24))
    a[:] = np.random.default_rng(seed).uniform(-1.0, 1.0, a.shape)
    return Rows(a, out)


def lane_rows(seed: int = 0) -> LaneRows:
    one = rows(seed)
    return LaneRows(in_lanes([one.a] * LANES), in_lanes([one.out] * LANES))


@helper
def _sum_of_products(w, n):
    found = 0.0
    for i in range(0, n, width(w)):
        found += strip(w, w.a[0], i) * strip(w, w.a[1], i)
    return total(w, found)


@kernel
def everything(n, i, w):
    w.out[0, 0] = _sum_of_products(w, n)
    for k in range(0, n, width(w)):
        put(w, w.out[1], k, 2.0 * strip(w, w.a[0], k) + 1.0)
    for k in range(start(w, i), n, width(w)):
        put(w, w.out[2], k, after(w, strip(w, w.a[0], k), k, i))
    for k in range(0, n, width(w)):
        a, b, c = strip(w, w.a[0], k), strip(w, w.a[1], k), strip(w, w.a[2], k)
        put_across(w, w.out[3:], k, ((a, b, c), (c, b, 0.5)))
        add_across(w, w.out[3:], k, ((a, a, a), (a, a, a)))
    return width(w)


def expected(a: np.ndarray, n: int, i: int) -> np.ndarray:
    out = np.zeros((24, 24))
    out[0, 0] = a[0, :n] @ a[1, :n]
    out[1, :n] = 2.0 * a[0, :n] + 1.0
    out[2, i + 1 : n] = a[0, i + 1 : n]
    out[3 : 3 + n, :6] = np.stack([a[0], a[1], a[2], a[2], a[1], np.full(24, 0.5)], axis=1)[:n] + a[0, :n, None]
    return out


@pytest.mark.parametrize(("n", "i"), [(8, 0), (8, 7), (16, 3), (16, 8), (16, 12)])
def test_strips_are_what_numpy_says(n, i):
    w = rows()
    assert everything(n, i, w) == LANES
    np.testing.assert_allclose(w.out, expected(w.a, n, i), rtol=0.0, atol=n * ULP)


@pytest.mark.parametrize(("n", "i"), [(5, 0), (8, 7), (13, 9)])
def test_of_lanes_a_strip_is_one_element(n, i):
    w = lane_rows()
    assert everything(n, i, w) == 1
    for lane in range(LANES):
        np.testing.assert_allclose(w.out[..., lane], expected(rows().a, n, i), rtol=0.0, atol=n * ULP)


def test_interpreted_a_strip_is_one_element():
    found = count(everything, 8, 2, rows())
    assert found.result == 1
    out = found.arguments[2].out.astype(float)
    np.testing.assert_allclose(out, expected(rows().a, 8, 2), rtol=0.0, atol=8 * ULP)


@kernel
def taken(first, count, w):
    for n in range(0, count, width(w)):
        put(w, w.out[0], n, part(w, w.a[0], first, n, count))


@pytest.mark.parametrize(("first", "count"), [(0, 8), (3, 1), (5, 11), (16, 8), (21, 3), (0, 0)])
def test_a_part_of_a_row_has_zeros_beyond_it_whatever_is_there(first, count):
    """Numbers that are not finite, or nothing: the last ones are at the end of the row."""
    w, lanes = rows(), lane_rows()
    for each in (w, lanes):
        each.out[0] = np.nan
        each.a[0, :first], each.a[0, first + count :] = np.inf, np.nan
        taken(first, count, each)
    wanted = w.a[0, first : first + count]
    np.testing.assert_array_equal(w.out[0, :count], wanted)
    np.testing.assert_array_equal(w.out[0, count : whole(count)], 0.0)
    np.testing.assert_array_equal(lanes.out[0, :count], np.repeat(wanted[:, None], LANES, axis=1))


@kernel
def seventh(x, w):
    put(w, w.out[0], 0, with_seventh(w, strip(w, w.a[0], 0), x))


def test_the_seventh_element_is_replaced():
    w = rows()
    seventh(3.0, w)
    np.testing.assert_array_equal(w.out[0, :8], [*w.a[0, :6], 3.0, w.a[0, 7]])
    with pytest.raises(TypingError):
        seventh(3.0, lane_rows())


def test_rows_hold_whole_strips_and_begin_where_one_does():
    assert [whole(n) for n in (0, 1, 8, 9)] == [0, ROW, ROW, 2 * ROW]
    assert strip_zeros((3, 2, ROW)).ctypes.data % BYTES == 0
    assert strip_zeros((3, 0)).shape == (3, 0)


def test_a_sum_that_leaves_out_an_element_is_noticed():
    """Negative control."""
    w = rows()
    everything(8, 0, w)
    assert abs(w.out[0, 0] - expected(w.a, 7, 0)[0, 0]) > 1e3 * ULP
