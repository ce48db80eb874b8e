"""Numbers that carry their derivatives, against derivatives by hand."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest
from llvmlite import ir
from numba import njit
from numba.core.errors import TypingError

from flexmb.jit import duals as module
from flexmb.jit.bundle import bundle
from flexmb.jit.duals import DUAL, RATES, nonzero, rate, seeded
from flexmb.jit.hooks import SEMANTICS
from flexmb.jit.kernel import kernel
from flexmb.jit.lanes import BYTES, LANE, select, some
from flexmb.jit.wide_arrays import as_duals, wide_zeros
from flexmb.spatial.scalar import atan2, cos, sin, sincos, sqrt
from tests.bounds import gamma

ROW = np.dtype([("number", np.int64), ("x", np.float64), ("v", np.float64, (3,))])


@bundle
class Duals:
    numbers = DUAL

    x: np.ndarray  # (n,) the first RATES of them have unit rates along their own directions
    out: np.ndarray  # (m,)
    rows: np.ndarray  # (r,) ROW


def duals(*values: float) -> Duals:
    return Duals(as_duals(np.array(values)), as_duals(np.zeros(16)), wide_zeros((2,), ROW, DUAL))


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


def test_seven_directions_do_not_mix():
    values = np.linspace(0.5, 1.9, RATES)
    found = duals(*values)
    product(found)
    whole = np.prod(values)
    np.testing.assert_allclose(found.out[0], [whole, *(whole / values)], rtol=gamma(3 * RATES))
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
    np.testing.assert_array_equal(found.rows["v"][1, 2], [18.0, 12.0, *[0.0] * (RATES - 1)])
    np.testing.assert_array_equal(found.rows["v"][1, 1], [1.5, *[0.0] * RATES])
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


def sums(d):
    d.out[0] = d.x[0] + d.x[1]


def products(d):
    d.out[0] = d.x[0] * d.x[1]


def instructions(function: Any, name: str, of: str) -> int:
    """How often the optimised code of a kernel does this to that type; not through `kernel`, which keeps the code."""
    found = duals(2.0, 3.0)
    compiled = njit(**SEMANTICS)(function)
    compiled(found)
    [code] = compiled.inspect_llvm().values()
    return len(re.findall(rf" {name} [^\n]*?{re.escape(of)}", code))


def test_a_dual_is_one_vector():
    """It is loaded, stored and added by one instruction each; of a number apart from its derivatives there is none."""
    vector = f"<{1 + RATES} x double>"
    assert duals(1.0).x.nbytes == BYTES
    assert [instructions(sums, name, vector) for name in ("fadd", "store")] == [1, 1]
    assert [instructions(products, name, vector) for name in ("fmul", "fadd", "store")] == [2, 1, 1]
    for name in ("fadd", "fmul"):
        assert instructions(sums, name, "double %") == instructions(products, name, "double %") == 0
    assert instructions(lambda d: d.x.shape[0] * 2.0 * d.x[0].real + 1.0, "fmul", "double %") > 0  # they would be seen


NUMBERS = [0.0, -0.0, 1.5, -2.5, 5e-324, -1e308, 1.7e308, math.inf, -math.inf, math.nan]


def numbers(d, a, b):
    x, y, out = d.x[0], d.x[1], d.out
    out[0] = x + y
    out[1] = x - y
    out[2] = x * y
    out[3] = x / y
    out[4] = -x
    out[5] = sqrt(y)
    out[6] = a + y
    out[7] = a - y
    out[8] = a * y
    out[9] = a / y
    out[10] = x + b
    out[11] = x - b
    out[12] = x * b
    out[13] = x / b


def as_of_floats(function: Any) -> bool:
    """Whether numbers that are dual have the bits of floats, but for the signs of NaN; all have derivatives."""
    same = True
    for a in np.array(NUMBERS):
        for b in np.array(NUMBERS):
            found = duals(a, b)
            found.x[:, 1:] = 0.75, -0.25, 0.0, 3.0, -1.0, 2.0, 0.0
            function(found, a, b)
            with np.errstate(all="ignore"):
                two = [a + b, a - b, a * b, a / b]
                expected = np.array([*two, -a, np.sqrt(b), *two, *two])
            got = found.out[: len(expected), 0]
            same &= np.array_equal(got, expected, equal_nan=True)
            zero = expected == 0.0
            same &= bool(np.all(np.signbit(got[zero]) == np.signbit(expected[zero])))
    return same


def test_numbers_are_those_of_floats(monkeypatch):
    """At infinities, where they overflow, and at zeros with their signs. Negative control: products whose numbers are
    computed as derivatives are."""
    assert as_of_floats(njit(**SEMANTICS)(numbers))
    monkeypatch.setattr(module, "_OF_RATES", ir.Constant(module._OF_RATES.type, [1] * (1 + RATES)))
    assert not as_of_floats(njit(**SEMANTICS)(numbers))


def test_duals_need_no_alignment_but_have_it():
    """Arrays of them begin on lines of the cache, and so do the records that hold some; a kernel takes others too."""
    for count in range(1, 9):
        found = duals(*np.ones(count))
        assert not any(n % BYTES for n in (found.x.ctypes.data, found.rows.ctypes.data, found.rows.itemsize))
        assert not any(offset % BYTES for kind, offset in found.rows.dtype.fields.values() if kind.base == np.float64)
    found, room = duals(2.0, 3.0, 0.5), np.zeros((4, 1 + RATES))
    other = room.ravel()[1:25].reshape(3, 1 + RATES)
    other[:, 0] = 2.0, 3.0, 0.5
    apart = Duals(other, as_duals(np.zeros(16)), found.rows)
    assert other.ctypes.data % BYTES or room.ctypes.data % BYTES
    product(found)
    product(apart)
    np.testing.assert_array_equal(apart.out, found.out)
