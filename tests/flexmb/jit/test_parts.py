"""Helpers as parts of what calls them: linked once, whoever calls, and written out where that pays."""

import random
from collections import Counter

import numba
import numpy as np
import pytest

from flexmb.jit import hooks, parts
from flexmb.jit.bundle import bundle
from flexmb.jit.features import GENERAL
from flexmb.jit.kernel import helper, kernel


@bundle
class Few:
    numbers: np.ndarray

    def features(self):
        return frozenset({"few"})


@bundle
class All:
    numbers: np.ndarray

    def features(self):
        return frozenset({GENERAL})


@helper
def lowest(x, i):
    return x.numbers[i] + 1.0


@helper
def left(x, i):
    return 2.0 * lowest(x, i)


@helper
def right(x, i):
    return 3.0 * lowest(x, i) + left(x, i)


@kernel
def highest(x):
    return left(x, 0) + right(x, 0) + lowest(x, 0)


VALUE = 2.0 * 2.0 + (3.0 * 2.0 + 2.0 * 2.0) + 2.0  # where the number is 1


@pytest.fixture
def fresh(tmp_path, monkeypatch):
    """Kernels that are compiled in this test, for only then there are parts."""
    monkeypatch.setattr(hooks, "cache_directory", lambda: tmp_path)
    return kernel(highest.py_func)


def test_every_part_is_linked_once_on_however_many_ways_it_is_called(fresh, monkeypatch):
    linked, alone = Counter(), parts._PartLibrary.alone

    def counted(self):
        linked[self] += 1
        return alone(self)

    monkeypatch.setattr(parts._PartLibrary, "alone", counted)
    assert fresh(Few(np.ones(1))) == VALUE
    assert list(linked.values()) == [1, 1, 1]


def test_what_numba_compiles_by_itself_may_call_a_helper():
    called = numba.njit(lambda x: left(x, 0) + right(x, 0) + lowest(x, 0))
    assert called(Few(np.ones(1))) == VALUE


@pytest.mark.parametrize("kind", [Few, All])
def test_helpers_are_written_out(fresh, kind):
    assert fresh(kind(np.ones(1))) == VALUE
    [signature] = fresh.signatures
    for each in (lowest, left, right):
        [text] = [text for of, text in each.inspect_llvm().items() if of[0] == signature[0]]
        assert "alwaysinline" in text


@pytest.mark.parametrize("seed", range(20))
def test_callers_come_before_what_they_call(seed):
    """A linker that meets a function before it is asked for leaves it out."""
    draw = random.Random(seed)
    libraries = [object.__new__(parts._PartLibrary) for _ in range(12)]
    for k, library in enumerate(libraries):
        later = libraries[k + 1 :]
        library._linking_libraries = draw.choices(later, k=3) if later else []
    found = parts._callers_first(libraries[0])
    assert len(set(found)) == len(found)
    place = {library: i for i, library in enumerate([libraries[0], *found])}
    for library in place:
        assert all(place[library] < place[called] for called in library._linking_libraries)
