"""Derivatives by interpolation: exact for polynomials, near it for analytic functions, refused where there is none."""

from __future__ import annotations

import numpy as np
import pytest

from flexmb.parameters.spectral import ENOUGH, NotSmooth, Parts, derivative

ONE = Parts([slice(0, 1)])


def of(f, x: float, scale: float = 1.0):
    return derivative(lambda value: np.array([f(value)]), x, scale, ONE)


@pytest.mark.parametrize(("f", "x", "scale", "expected"), [
    (lambda x: 3.0 * x + 1.0, 0.0, 1.0, 3.0),
    (lambda x: x**4 - x, 2.0, 2.0, 31.0),
    (lambda x: 1.0 / x**3, 2.0, 2.0, -3.0 / 16.0),
    (lambda x: np.sqrt(x), 5e-9, 5e-9, 0.5 / np.sqrt(5e-9)),
    (lambda x: np.sin(x), 0.3, 0.3, np.cos(0.3)),
    (lambda x: np.hypot(x - 1.0, 1e-2), 1.01, 1.0, 0.5**0.5),
])  # fmt: skip
def test_functions_with_known_derivatives(f, x, scale, expected):
    """The last one bends within a hundredth of the scale: a smaller interval is taken."""
    found = of(f, x, scale)
    assert found.values[0] == pytest.approx(expected, rel=1e-11)
    assert found.error <= ENOUGH


@pytest.mark.parametrize("f", [
    abs,
    lambda x: max(x, 0.0),
    lambda x: 1.0 if x > 0.0 else 0.0,
    lambda x: 0.0 if x == 0.0 else 1.0 + x,  # a jump at the middle alone, which no other point shows
    lambda x: np.sqrt(abs(x)),
    lambda x: np.nan if x > 1e-9 else x,
    lambda x: 2e-6 * abs(x) + x,
])  # fmt: skip
def test_what_is_not_smooth_is_refused(f):
    with pytest.raises(NotSmooth):
        of(f, 0.0)


def test_what_is_not_defined_nearby_needs_a_smaller_interval():
    def log(x: float) -> float:
        if x < 0.95:
            raise ValueError("too small")
        return np.log(x)

    assert of(log, 1.0).values[0] == pytest.approx(1.0, rel=1e-11)

    def nowhere(x: float) -> float:
        if x != 1.0:
            raise ValueError("only here")
        return x

    with pytest.raises(NotSmooth, match="only here"):
        of(nowhere, 1.0)


@pytest.mark.parametrize("size", [1e-14, 1e-9])
def test_a_part_that_is_zero_beside_its_table_is_rounding(size):
    """Noise of 1e-14 of the table is not asked for a derivative; a kink of 1e-9 of it is refused, as is the noise of a
    part that belongs to no table."""

    def table(x: float) -> np.ndarray:
        return np.array([5.0 + x, size * abs(np.sin(1e6 * x))])

    places = [slice(0, 1), slice(1, 2)]
    if size < 1e-11:
        found = derivative(table, 1.0, 1.0, Parts(places, np.full(2, 6.0)))
        assert found.values[0] == pytest.approx(1.0, rel=1e-11) and found.error <= ENOUGH
    else:
        with pytest.raises(NotSmooth, match="drowns in rounding"):
            derivative(table, 1.0, 1.0, Parts(places, np.full(2, 6.0)))
    with pytest.raises(NotSmooth, match="drowns in rounding"):
        derivative(table, 1.0, 1.0, Parts(places))
