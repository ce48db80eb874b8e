"""Kernels contain what their bundles have: branches on other features are cut before anything in them is compiled."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit
from numba.core.errors import TypingError

from flexmb.jit.bundle import bundle
from flexmb.jit.features import GENERAL, has
from flexmb.jit.kernel import helper, kernel
from flexmb.jit.numbered import numbered

WINGS = "wings"


@bundle
class Winged:
    values: np.ndarray  # (n,)

    def features(self) -> frozenset[str]:
        return frozenset({WINGS, "kind 1"})


@bundle
class Wingless:
    values: np.ndarray  # (n,)

    def features(self) -> frozenset[str]:
        return frozenset({"kind 0", "kind 2"})


@bundle
class Whatever:
    values: np.ndarray  # (n,)

    def features(self) -> frozenset[str]:
        return frozenset({GENERAL})


@bundle
class Nest:
    inner: Winged
    weights: np.ndarray  # (n,)


@helper
def cannot_be_compiled(b):
    return b.there_is_no_such_array[0]


@kernel
def fly(b):
    if has(b, WINGS):
        return b.values[0]
    return cannot_be_compiled(b)


@kernel
def fly_inside(nest):
    if not has(nest.inner, WINGS):
        return cannot_be_compiled(nest)
    return nest.inner.values[1]


def test_a_branch_that_is_not_taken_is_not_compiled():
    assert fly(Winged(np.arange(3.0) + 5.0)) == 5.0
    assert fly_inside(Nest(Winged(np.arange(3.0)), np.ones(2))) == 1.0
    with pytest.raises(TypingError, match="there_is_no_such_array"):
        fly(Wingless(np.arange(3.0)))


def test_everything_is_compiled_for_a_general_bundle():
    assert fly(Whatever(np.ones(1))) == 1.0


def test_python_and_a_compiler_without_the_pass_see_the_same():
    @njit
    def plain(b):
        return 1 if has(b, WINGS) else 2

    for made in (Winged, Wingless, Whatever):
        one = made(np.ones(1))
        assert plain(one) == (1 if has(one, WINGS) else 2) == plain.py_func(one)


def test_arrays_of_a_bundle_with_features_are_read_only():
    """A feature that comes later would be left out by kernels that are compiled for its absence."""
    with pytest.raises(ValueError, match="read-only"):
        Winged(np.ones(2)).values[0] = 2.0


@helper
def twice(x):
    return 2.0 * x


@helper
def square(x):
    return x * x


@helper
def broken(x):
    return x.there_is_no_such_member


chosen = numbered("chosen", "kind", [twice, square, broken])
sound = numbered("sound", "kind", [twice, square, square])


@kernel
def choose(b, number):
    return chosen(b, number, b.values[0])


@kernel
def choose_sound(b, number):
    return sound(b, number, b.values[0])


def test_only_numbers_that_are_there_are_compiled():
    assert choose(Winged(np.full(1, 3.0)), 1) == 9.0
    with pytest.raises(TypingError):
        choose(Wingless(np.full(1, 3.0)), 0)
    assert [choose_sound(Wingless(np.full(1, 3.0)), number) for number in (0, 2)] == [6.0, 9.0]
    assert [choose_sound(Whatever(np.full(1, 3.0)), number) for number in (0, 1, 2)] == [6.0, 9.0, 9.0]


def test_python_refuses_a_number_that_is_not_there():
    with pytest.raises(ValueError, match="no kind 0"):
        chosen(Winged(np.ones(1)), 0, 1.0)
