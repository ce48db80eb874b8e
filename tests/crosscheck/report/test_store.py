"""Series come back digit for digit, and what is the same is stored once."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from crosscheck.report.store import Store
from tests.crosscheck.report.reading import series_of

TABLES = arrays(np.float32, array_shapes(min_dims=2, max_dims=2, max_side=12), elements=st.floats(width=32))


@given(st.lists(TABLES, min_size=1, max_size=5))
def test_every_series_comes_back(tables: list[np.ndarray]) -> None:
    store = Store()
    numbers = [store.samples(table.astype(float)) for table in tables]
    found = series_of(store.packed())
    for number, table in zip(numbers, tables, strict=True):
        np.testing.assert_array_equal(found[number], table)


def test_the_same_is_stored_once() -> None:
    store = Store()
    values = np.linspace(0.0, 1.0, 50)[:, None]
    first = store.samples(values)
    before = len(store.packed()["data"])
    assert store.samples(values.copy()) == store.times(values[:, 0].copy()) == first
    assert len(store.packed()["data"]) == before
    assert store.samples(values.reshape(25, 2)) != first


def test_smooth_signals_take_less_than_their_numbers() -> None:
    store = Store()
    t = np.linspace(0.0, 10.0, 201)
    store.samples(np.stack([np.sin(t + phase) for phase in range(12)], axis=1))
    assert len(store.packed()["data"]) < 0.8 * 4 * 201 * 12 * 4 / 3


def test_no_series_no_data() -> None:
    assert Store().packed() == {"shapes": [], "data": ""}
