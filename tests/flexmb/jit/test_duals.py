"""Numbers that carry their derivatives, against derivatives by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numba.core.errors import TypingError

from flexmb.jit.bundle import bundle
from flexmb.jit.duals import DUAL, nonzero, rate, seeded
from flexmb.jit.kernel import kernel
from flexmb.jit.lanes import LANE, LANES, select, some
from flexmb.jit.wide_arrays import as_duals, wide_zeros
from flexmb.spatial.scalar import atan2, cos, sin, sincos, sqrt
from tests.bounds import gamma

ROW = np.dtype([("number", np.int64), ("x", np.float64), ("v", np.float64, (3,))])


@bundle
class Duals:
    numbers = DUAL

    x: np.ndarray  # (n,) the first LANES of them have unit rates along their own directions
    out: np.ndarray  # (m,)
    rows: np.ndarray  # (r,) ROW


def duals(*values: float) -> Duals:
    return Duals(as_duals(np.array(values)), as_duals(np.zeros(16)), wide_zeros((2,), ROW, DUAL.width))


@kernel
def functions(d):
    for i in range(d.x.shape[0]):
        d.x[i] = seeded(d.x[i], i)
    x, y, out = d.x[0], d.x[1], d.out
    out[0] = x * y
    out[1] = x / y
    out[2] = 2 * x - y / 3.0
    out[3] = 1.0 / x
    out[4] = -x + 3
    out[5] = sqrt(x * x + y * y)
    out[6] = sin(x)
    out[7] = cos(x)
    out[8] = atan2(y, x)
    s, c = sincos(y)
    out[9] = s * c
    out[10] = select(x.real > y.real, x, y)
    out[11] = 5.0 - x
    total = 0.0
    for _ in range(3):
        total += x
        total *= 2.0
    out[12] = total


def by_hand(x: float, y: float) -> list[tuple[float, float, float]]:
    """(value, by x, by y) of all of them."""
    r2 = x * x + y * y
    larger = (x, 1.0, 0.0) if x > y else (y, 0.0, 1.0)
    return [
        (x * y, y, x),
        (x / y, 1 / y, -x / y**2),
        (2 * x - y / 3, 2, -1 / 3),
        (1 / x, -1 / x**2, 0),
        (3 - x, -1, 0),
        (math.sqrt(r2), x / math.sqrt(r2), y / math.sqrt(r2)),
        (math.sin(x), math.cos(x), 0),
        (math.cos(x), -math.sin(x), 0),
        (math.atan2(y, x), -y / r2, x / r2),
        (math.sin(y) * math.cos(y), 0, math.cos(2 * y)),
        larger,
        (5 - x, -1, 0),
        (14 * x, 14, 0),
    ]


@pytest.mark.parametrize(("x", "y"), [(0.3, -1.7), (2.5, 0.1), (-0.4, 0.9)])
def test_every_operation_carries_its_derivatives(x, y):
    found = duals(x, y)
    functions(found)
    for got, (value, by_x, by_y) in zip(found.out, by_hand(x, y), strict=False):
        expected = np.array([value, by_x, by_y])
        np.testing.assert_allclose(got[:3], expected, rtol=0.0, atol=gamma(8) * (1.0 + np.max(np.abs(expected))))
        assert not got[3:].any()


def test_eight_directions_do_not_mix():
    values = np.linspace(0.5, 1.9, LANES)
    found = duals(*values)
    product(found)
    whole = np.prod(values)
    np.testing.assert_allclose(found.out[0], [whole, *(whole / values)], rtol=gamma(3 * LANES))
    assert rates(found) == found.out[0, 1 + 5]


@kernel
def product(d):
    total = 1.0
    for i in range(d.x.shape[0]):
        total *= seeded(d.x[i], i)
    d.out[0] = total


@kernel
def rates(d):
    return rate(d.out[0], 5)


@kernel
def through_rows(d):
    x = seeded(d.x[0], 0)
    for i in range(d.rows.shape[0]):
        row = d.rows[i]
        row.number = i + 1
        row.x = x * x
        row.v[2] = row.x * row.number
        row.v[1] = 1.5
    d.out[0] = d.rows[1].v[2]


def test_floats_of_records_are_duals():
    found = duals(3.0)
    through_rows(found)
    assert found.rows["number"].tolist() == [1, 2]
    np.testing.assert_array_equal(found.rows["v"][1, 2], [18.0, 12.0, *[0.0] * (LANES - 1)])
    np.testing.assert_array_equal(found.rows["v"][1, 1], [1.5, *[0.0] * LANES])
    np.testing.assert_array_equal(found.out[0, :2], [18.0, 12.0])


@kernel
def there(d):
    for i in range(d.x.shape[0]):
        d.out[i] = 1.0 if nonzero(d.x[i]) else 0.0


@kernel
def there_in_lanes(d):
    return some(nonzero(d.x[0]))


@bundle
class Lanes:
    numbers = LANE

    x: np.ndarray


def test_a_term_is_left_out_only_if_its_derivatives_vanish_too():
    found = duals(0.0, -0.0, 1e-300, 0.0, np.nan)
    found.x[3, 1 + 5] = 1e-300
    there(found)
    assert found.out[:5, 0].tolist() == [0.0, 0.0, 1.0, 1.0, 1.0]
    lanes = Lanes(wide_zeros((1,)))
    assert not there_in_lanes(lanes)
    lanes.x[0, 6] = 1.0
    assert there_in_lanes(lanes)
    assert nonzero(1.0) and not nonzero(0.0)


@kernel
def compares(d):
    return d.x[0] > 1.0


def test_only_the_number_itself_is_compared():
    """Negative control: a comparison that does not say so is refused."""
    with pytest.raises(TypingError):
        compares(duals(1.0))
