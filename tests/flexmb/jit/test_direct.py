"""Kernels called by address: as by their dispatchers, for bundles of any type, which are held."""

import gc
import threading

import numpy as np
import pytest

from flexmb.jit.bundle import bundle
from flexmb.jit.direct import at_address, direct, nothing_at, status_at
from flexmb.jit.kernel import kernel
from flexmb.jit.pointer import MATRIX, REAL, STATUS, VECTOR, VOID
from tests.flexmb.jit.test_bundle import Other, pair


@kernel
def weighed(t, y, pair, dy, other):
    """dy = t y + the sum of the counts of both; returns how many there are."""
    total = 0
    for i in range(pair.counts.shape[0]):
        total += pair.counts[i]
    for i in range(other.counts.shape[0]):
        total += other.counts[i]
    for i in range(y.shape[0]):
        dy[i] = t * y[i] + total
    return pair.counts.shape[0] + other.counts.shape[0]


@kernel
def filled(pair, values):
    for i in range(values.shape[0]):
        for j in range(values.shape[1]):
            values[i, j] = pair.values[i, j]


def call(other=None):
    return direct(weighed, STATUS, REAL, VECTOR, pair(), VECTOR, Other(np.array([5])) if other is None else other)


def test_a_direct_call_does_what_the_kernel_does():
    y, expected, found = np.arange(3.0), np.empty(3), np.empty(3)
    other = Other(np.array([5]))
    assert weighed(0.5, y, pair(), expected, other) == call(other)(0.5, y, found) == 6
    assert np.array_equal(found, expected)


def test_a_kernel_that_returns_nothing():
    values, source = np.zeros((2, 3)), pair()
    assert direct(filled, VOID, source, MATRIX)(values) is None
    assert np.array_equal(values, source.values[:2])


def test_one_entry_serves_all_bundles():
    one, another = call(), direct(weighed, STATUS, REAL, VECTOR, pair(), VECTOR, pair())
    assert one.func is another.func
    assert one(0.0, np.zeros(1), np.empty(1)) == 6
    assert another(0.0, np.zeros(1), np.empty(1)) == 10
    assert len(one.func.overloads) == 1


@pytest.mark.parametrize(
    "wrong",
    [
        (0.5, np.arange(3), np.empty(3)),
        (0.5, np.arange(3.0), np.empty((3, 1))),
        (0.5, np.arange(6.0)[::2], np.empty(3)),
        (0.5, np.arange(3.0, dtype=np.float32), np.empty(3)),
        (0.5, [1.0, 2.0], np.empty(3)),
        (1j, np.arange(3.0), np.empty(3)),
        (None, np.arange(3.0), np.empty(3)),
        (0.5, np.arange(3.0)),
    ],
)
def test_arguments_of_other_types_are_refused_and_nothing_is_compiled_for_them(wrong):
    function = call()
    with pytest.raises(TypeError):
        function(*wrong)
    assert len(function.func.overloads) == 1


def test_a_kernel_that_returns_something_else_is_refused():
    with pytest.raises(TypeError, match="weighed returns int64, not none"):
        direct(weighed, VOID, REAL, VECTOR, pair(), VECTOR, pair())


def test_bundles_are_held():
    """Their arrays too: what nothing else holds is still there."""
    function, found = call(), np.empty(1)
    for _ in range(3):
        gc.collect()
        _ = [np.full(5, -7) for _ in range(1000)]  # would take the place of arrays that were let go
        assert function(0.0, np.zeros(1), found) == 6
        assert found[0] == 15.0


def test_threads_call_it_at_once():
    function = call()
    found = np.empty((8, 3))
    threads = [threading.Thread(target=function, args=(float(i), np.ones(3), found[i])) for i in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert np.array_equal(found, np.repeat(np.arange(8.0)[:, None] + 15.0, 3, axis=1))


@bundle
class Inner:
    y: np.ndarray  # (n,)
    values: np.ndarray  # (n,m)


inner_at = at_address(Inner(np.zeros(1), np.zeros((1, 1))))


@kernel
def scaled(factor, y):
    for i in range(y.shape[0]):
        y[i] *= factor
    return y.shape[0]


@kernel
def cleared(values):
    for i in range(values.shape[0]):
        values[i, values.shape[1] - 1] = 0.0


@kernel
def through(function, other, address):
    """Calls two kernels with tables of the bundle at an address."""
    inner = inner_at(address)
    nothing_at(other, (inner.values,))
    return status_at(function, (2.0, inner.y))


def test_kernels_call_by_address_with_the_tables_of_a_bundle():
    inner = Inner(np.arange(3.0), np.ones((2, 3)))
    scaling, clearing = (
        direct(each, *given).args[0] for each, given in ((scaled, (STATUS, REAL, VECTOR)), (cleared, (VOID, MATRIX)))
    )
    assert through(scaling, clearing, inner.kernel_address) == 3
    assert inner.y.tolist() == [0.0, 2.0, 4.0]
    assert inner.values.tolist() == [[1.0, 1.0, 0.0]] * 2
