"""States that are half right: made, replaced, copied or altered so that they do not fit their system. Names that a
result does not have, refused by its place, and statuses, which print theirs."""

from __future__ import annotations

import copy
import dataclasses
import pickle

import numpy as np
import pytest

import flexmb as fm
from flexmb.run.warm_up import pendulum
from flexmb.tables import arguments
from tests.flexmb.system.argument_kinds import W


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


def _results() -> list[tuple[object, str]]:
    run, tree, state = W.run, W.tree, W.state
    found = tree.evaluate(state.t, state.q, state.u), tree.evaluation_derivatives(state)
    kept = run, pickle.loads(pickle.dumps(run)), copy.deepcopy(run), run.then(run)
    return [(each, "elbow") for each in (*found, *kept)]


def test_a_name_that_is_not_there_is_refused_with_the_remedy():
    for result, hinge in _results():
        assert hinge in result.loads and isinstance(result.loads, dict)
        with pytest.raises(KeyError, match=r"loads\[.elbw.\].*did you mean \"elbow\""):
            result.loads["elbw"]
        with pytest.raises(KeyError, match=r"markers\[.nobody.\].*use one of: centre"):
            result.markers["nobody"]
        with pytest.raises(KeyError, match=r"energy\[5\].*use one of: gravity, kinetic"):
            result.energy[5]
        assert result.loads.get("nobody") is None and "nobody" not in result.loads


def test_an_argument_of_the_builder_that_does_not_exist_is_refused_with_the_remedy():
    builder = fm.SceneBuilder("s")
    with pytest.raises(TypeError, match=r"rigid_body\(\) has no argument \"mas\": did you mean \"mass\""):
        builder.rigid_body("a", mas=2.0, inertia=(1.0, 1.0, 1.0))
    with pytest.raises(TypeError, match="agle.*angle"):
        builder.revolute("h", "ground", "a", agle=0.5)


def test_a_status_prints_its_name() -> None:
    assert str(fm.Status.MAX_STEPS) == f"{fm.Status.MAX_STEPS}" == "MAX_STEPS"
    assert f"{fm.Status.MAX_STEPS:>10}" == " MAX_STEPS"
    assert f"{fm.Status.MAX_STEPS:02d}" == "04"
    assert fm.Status.MAX_STEPS == 4 and int(fm.Status.MAX_STEPS) == 4
    assert np.array([fm.Status.MAX_STEPS]).dtype.kind == "i"


def test_of_single_states_and_of_many() -> None:
    system = fm.compile(pendulum())
    state = system.initial_state
    assert str(system.precision(state).status) == "OK"
    assert system.accelerations_batch(state.q[None], state.u[None]).statuses == (fm.Status.OK,)
    assert fm.simulate_batch(system, 0.1, q=state.q[None], u=state.u[None]).statuses == (fm.Status.OK,)
