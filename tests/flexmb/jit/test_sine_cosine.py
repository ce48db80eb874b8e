"""Sine and cosine of floats, lanes and tables, against the library's in more digits."""

import math

import numpy as np
import pytest

from flexmb.jit.bundle import bundle
from flexmb.jit.counting import Operations, count
from flexmb.jit.kernel import kernel
from flexmb.jit.lanes import LANE, LANES
from flexmb.jit.sine_cosine import FARTHEST
from flexmb.jit.wide_arrays import wide_zeros
from flexmb.spatial.scalar import sincos, sines

LONG = np.longdouble
more_digits = pytest.mark.skipif(np.finfo(LONG).nmant < 60, reason="no numbers of more digits on this machine")


@bundle
class Angles:
    x: np.ndarray  # (n,)
    sine: np.ndarray  # (n,)
    cosine: np.ndarray  # (n,)


@bundle
class LaneAngles(Angles):
    numbers = LANE


@kernel
def one_by_one(a):
    for i in range(a.x.shape[0]):
        s, c = sincos(a.x[i])
        a.sine[i] = s
        a.cosine[i] = c


@kernel
def together(a, n):
    sines(a.x, a.sine, a.cosine, n)


def floats(x: np.ndarray) -> Angles:
    return Angles(np.array(x, float), np.full(len(x), 9.0), np.full(len(x), 9.0))


def lanes(x: np.ndarray) -> Angles:
    found = LaneAngles(*(wide_zeros((len(x) // LANES,)) for _ in range(3)))
    found.x.ravel()[:] = x
    return found


def of_floats(x: np.ndarray) -> Angles:
    one_by_one(found := floats(x))
    return found


def of_lanes(x: np.ndarray) -> Angles:
    one_by_one(found := lanes(x))
    return found


def of_a_table(x: np.ndarray) -> Angles:
    together(found := floats(x), len(x))
    return found


def of_a_table_of_lanes(x: np.ndarray) -> Angles:
    together(found := lanes(x), len(x) // LANES)
    return found


WAYS = (of_floats, of_lanes, of_a_table, of_a_table_of_lanes)


def last_places(found: np.ndarray, exact: np.ndarray) -> float:
    """Largest difference, in units of the last place."""
    return float(np.max(np.abs(found.ravel() - exact) / np.spacing(np.abs(exact.astype(float)))))


@more_digits
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("size", [1e-8, 1.0, 30.0, 1e3, 0.99 * FARTHEST])
def test_to_one_unit_in_the_last_place(way, size):
    x = np.random.default_rng(0).uniform(-size, size, 32000)
    found = way(x)
    assert last_places(found.sine, np.sin(x.astype(LONG))) <= 1.0
    assert last_places(found.cosine, np.cos(x.astype(LONG))) <= 1.0


@more_digits
@pytest.mark.parametrize("way", WAYS)
def test_next_to_their_zeros(way):
    x = np.arange(-60000, 60000) * (math.pi / 2.0)
    found = way(x)
    assert last_places(found.sine, np.sin(x.astype(LONG))) <= 1.0
    assert last_places(found.cosine, np.cos(x.astype(LONG))) <= 1.0


@more_digits
def test_a_reduction_by_a_shorter_pi_is_seen():
    """Negative control: an error of a rounding of pi/2 shows next to a zero."""
    x = np.arange(1, 9) * math.pi
    assert last_places(of_floats(x).sine * (1.0 + 2.0**-51), np.sin(x.astype(LONG))) > 1.0


@pytest.mark.parametrize("way", WAYS)
def test_of_whatever_there_is(way):
    """What is far away, or nowhere, goes to the library, and leaves its neighbours right."""
    x = np.array([0.0, -1.0, FARTHEST, 1e22, np.inf, -np.inf, np.nan, 3.0])
    with np.errstate(invalid="ignore"):
        expected = np.sin(x), np.cos(x)
    found = way(x)
    for each, right in zip((found.sine, found.cosine), expected, strict=True):
        np.testing.assert_allclose(each.ravel(), right, rtol=2.0**-51, atol=0.0)


@pytest.mark.parametrize("n", [0, 1, 8, 9])
def test_of_a_table_as_many_as_are_asked_for_in_eights(n):
    found = floats(np.linspace(-3.0, 3.0, 24))
    together(found, n)
    done = -(-n // LANES) * LANES
    np.testing.assert_allclose(found.sine[:done], np.sin(found.x[:done]), rtol=2.0**-51)
    assert np.all(found.sine[done:] == 9.0) and np.all(found.cosine[done:] == 9.0)


def test_all_ways_agree_to_the_bit():
    x = np.random.default_rng(1).uniform(-9.0, 9.0, 800)
    first, *others = (way(x) for way in WAYS)
    for other in others:
        assert np.array_equal(first.sine, other.sine.ravel()) and np.array_equal(first.cosine, other.cosine.ravel())


def test_they_are_counted():
    assert count(together, floats(np.ones(8)), 3).operations == Operations(elementary=6)
    assert count(one_by_one, floats(np.ones(3))).operations == Operations(elementary=6)
