"""States that are half right: made, replaced, copied or altered so that they do not fit their system."""

from __future__ import annotations

import copy
import dataclasses
import pickle

import numpy as np
import pytest

import flexmb as fm
from flexmb.tables import arguments


@pytest.fixture(scope="module")
def system() -> fm.System:
    builder = fm.SceneBuilder("two").rigid_body("one", mass=1.0, inertia=(0.1, 0.2, 0.3))
    return fm.compile(builder.spherical("ball", "ground", "one").scene())


def test_a_state_is_as_long_as_its_layout_says(system):
    state = system.initial_state
    for changed in ({"q": np.zeros(1), "u": np.zeros(1)}, {"q": state.q[:-1]}, {"u": np.zeros(10**5)}, {"q": []}):
        with pytest.raises(ValueError, match="it belongs to another one"):
            dataclasses.replace(state, **changed)
        with pytest.raises(ValueError, match="it belongs to another one"):
            fm.State(**{"q": state.q, "u": state.u, "layout": system.layout, **changed})
    with pytest.raises(TypeError, match="layout is a System"):
        fm.State(state.q, state.u, layout=system)
    with pytest.raises(ValueError, match="t is nan"):
        dataclasses.replace(state, t=np.nan)


@pytest.mark.filterwarnings("ignore:Setting the .* on a NumPy array has been deprecated")
def test_what_is_done_to_its_arrays_is_not_done_to_the_state(system):
    """NumPy changes shape, type and strides in place; a state's own array has none of it."""
    state = system.initial_state
    expected = system.momentum(state)
    for name in ("q", "u", "y"):
        shown, size = getattr(state, name), len(getattr(state, name))
        shown.shape = (size, 1)
        shown.base.shape = (1, -1)
        shown.flags.writeable = False
        getattr(state, name).dtype = np.int64
        with pytest.raises(ValueError, match="resize"):
            getattr(state, name).resize(10**6)
        assert getattr(state, name).shape == (size,) and getattr(state, name).dtype == float
    state.u[0] = 0.5
    assert state.y[system.nq] == 0.5 and (system.momentum(state) != expected).any()


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda each: pickle.loads(pickle.dumps(each))])
def test_a_copy_is_a_state_of_its_own(system, copied):
    state = system.initial_state
    again = copied(state)
    state.u[:] = 7.0
    assert np.all(again.u == 0.0) and np.array_equal(system.momentum(again), np.zeros(6))


def test_a_state_of_a_class_of_its_own_is_made_anew(system):
    """What a class makes of q or y is not known: the kernels take what a State has made of it."""

    class Odd(fm.State):
        @property
        def y(self):
            return np.zeros(1)

    assert np.array_equal(system.momentum(Odd(system.initial_state.q, system.initial_state.u)), np.zeros(6))


@pytest.mark.parametrize(
    ("values", "place"),
    [
        (np.ma.array([1.0, 2.0, 3.0], mask=[False, True, False]), r"q\[1\]"),
        (np.ma.array([[1.0, 2.0]], mask=[[False, True]]), r"q\[0, 1\]"),
        ([1.0, np.ma.masked], r"q\[1\]"),
        ([np.ma.array([1.0], mask=[False]), np.ma.array([2.0], mask=[True])], r"q\[1, 0\]"),
        (np.ma.array([1, 2], mask=True), r"q\[0\]"),
    ],
)
def test_what_is_masked_is_no_number(values, place):
    with pytest.raises(ValueError, match=f"{place} is masked: give a number"):
        arguments.array("q", values)


def test_a_mask_that_hides_nothing_is_no_harm():
    assert arguments.array("q", np.ma.array([1.0, 2.0])).tolist() == [1.0, 2.0]
    endless: list = []
    endless.append(endless)
    with pytest.raises((TypeError, ValueError)):
        arguments.array("q", endless)
