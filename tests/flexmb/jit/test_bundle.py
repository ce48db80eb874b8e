"""Bundles of arrays as arguments of kernels, and choices between kinds of them."""

import pickle

import numpy as np
import pytest

from flexmb.jit.bundle import AnyBundle, bundle
from flexmb.jit.counting import count
from flexmb.jit.kernel import by_bundle, helper, kernel
from flexmb.jit.pointer import REAL, STATUS, VECTOR, VOID, pointer


@bundle
class Pair:
    values: np.ndarray  # (n, 3)
    counts: np.ndarray  # (m,)


@helper
def scaled(pair, i, factor):
    return factor * pair.values[i, 2]


@bundle
class Other:
    counts: np.ndarray  # (m,)


@kernel
def fill(pair, factor):
    """Doubles the counts; returns the sum of the last column times `factor`."""
    return filled(pair, factor)


@helper
def filled(pair, factor):
    total = 0.0
    for i in range(pair.values.shape[0]):
        total += scaled(pair, i, factor)
    for i in range(pair.counts.shape[0]):
        pair.counts[i] *= 2
    return total


def pair(rows: int = 4) -> Pair:
    return Pair(values=np.arange(3.0 * rows).reshape(rows, 3), counts=np.arange(5))


@pytest.mark.parametrize("rows", [4, 7])
def test_kernels_read_and_write_the_arrays_of_a_bundle(rows):
    arrays = pair(rows)
    assert fill(arrays, 2.0) == 2.0 * arrays.values[:, 2].sum()
    assert arrays.counts.tolist() == [0, 2, 4, 6, 8]


@bundle
class Nested:
    inner: Pair
    weights: np.ndarray  # (k,)


@kernel
def fill_inner(nested, factor):
    """As `fill`, times the sum of the weights."""
    total = 0.0
    for i in range(nested.weights.shape[0]):
        total += nested.weights[i]
    return total * filled(nested.inner, factor)


def test_bundles_hold_bundles():
    arrays = pair()
    assert fill_inner(Nested(arrays, np.array([1.0, 3.0])), 2.0) == 8.0 * arrays.values[:, 2].sum()
    assert arrays.counts.tolist() == [0, 2, 4, 6, 8]


@kernel
def trebled(t, y, dy, first, second):
    for i in range(y.shape[0]):
        dy[i] = 3.0 * y[i] + first.counts[0]
    return second.counts[0]


@kernel
def call(function, y, dy, first, second):
    return function(0.5, y, dy, first, second)


def pointed(first, second):
    return pointer(trebled, STATUS, REAL, VECTOR, VECTOR, first, second)


def test_a_kernel_that_calls_by_address_is_compiled_once_for_all_bundles():
    plain = pair()
    plain.counts[0] = 7
    y, dy = np.arange(3.0), np.empty(3)
    assert call(pointed(plain, plain), y, dy, AnyBundle(plain), AnyBundle(plain)) == 7
    assert dy.tolist() == [7.0, 10.0, 13.0]
    other = Other(counts=np.array([5]))
    assert call(pointed(plain, other), y, dy, AnyBundle(plain), AnyBundle(other)) == 5
    assert len(trebled.signatures) == 2
    assert len(call.signatures) == 1


def test_an_address_refuses_a_kernel_that_returns_something_else():
    with pytest.raises(TypeError, match="trebled returns int64, not none"):
        pointer(trebled, VOID, REAL, VECTOR, VECTOR, pair(), pair())


def test_a_pickled_bundle_has_its_own_arrays():
    original = pair()
    copied = pickle.loads(pickle.dumps(original))
    fill(copied, 1.0)
    assert original.counts.tolist() == [0, 1, 2, 3, 4]
    assert copied.counts.tolist() == [0, 2, 4, 6, 8]


def test_bundles_refuse_arrays_they_cannot_describe():
    with pytest.raises(ValueError, match="values: a bundle holds C-contiguous arrays"):
        Pair(values=np.zeros((4, 6))[:, ::2], counts=np.zeros(2))


@helper
def last(x):
    return x.values[x.values.shape[0] - 1, 0]


@helper
def number(x):
    return 1.0 * x.counts.shape[0]


chosen = by_bundle(Pair, last, number)


@bundle
class Special(Pair):
    more: np.ndarray  # (k,)


@bundle
class Lookalike:
    values: np.ndarray
    counts: np.ndarray


@kernel
def choose(x):
    return chosen(x)


def test_a_choice_between_bundles_is_one_of_classes():
    """A class that is derived counts as what it is derived from, one with the same arrays does not."""
    arrays = pair()
    special = Special(values=arrays.values, counts=arrays.counts, more=np.zeros(1))
    lookalike = Lookalike(values=arrays.values, counts=arrays.counts)
    for call in (choose, lambda arrays: count(choose, arrays).result):
        assert call(arrays) == call(special) == 9.0
        assert call(lookalike) == call(Other(counts=arrays.counts)) == 5.0


class Elsewhere:
    @bundle
    class Other:
        counts: np.ndarray  # (m,)


def test_bundles_of_two_classes_of_one_name_have_two_types():
    counts = np.array([5])
    one, other = (each(counts=counts)._numba_type_ for each in (Other, Elsewhere.Other))
    assert one == Other(counts=counts + 1)._numba_type_
    assert one != other and str(one) != str(other)
