"""Derivatives in a loop: those of `acceleration_derivatives` to the bit, in arrays of each thread."""

from __future__ import annotations

import copy
import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import flexmb as fm
from flexmb.run.warm_up import looped
from flexmb.system.derivative_evaluator import DerivativeEvaluator
from tests.flexmb.system.argument_kinds import World
from tests.flexmb.system.shared_calls import own_states

Asked = tuple[fm.System, list[fm.State]]


@pytest.fixture(scope="module", params=[World().scene, looped()], ids=["tree", "closed"])
def asked(request: pytest.FixtureRequest) -> Asked:
    system = fm.compile(request.param)
    return system, own_states(system, system.initial_state)


def is_right(evaluator: DerivativeEvaluator, system: fm.System, state: fm.State) -> bool:
    expected = system.acceleration_derivatives(state)
    rates = evaluator(state.t, state.q, state.u)
    names = "by_displacement", "by_speed", "by_force"
    same = all(np.array_equal(getattr(evaluator, name), getattr(expected, name)) for name in names)
    return same and np.array_equal(rates, expected.accelerations)


def test_it_gives_the_derivatives_to_the_bit(asked: Asked) -> None:
    system, [state, *others] = asked
    evaluator = system.derivative_evaluator()
    assert all(is_right(evaluator, system, other) for other in others)
    before = evaluator(state.t, state.q, state.u).copy()
    np.testing.assert_array_equal(evaluator(state.t, state.q.tolist(), state.u.tolist()), before)


def test_arrays_are_used_again_and_only_read(asked: Asked) -> None:
    system, [_, state, other, *_] = asked
    evaluator = system.derivative_evaluator()
    evaluator(state.t, state.q, state.u)
    seen, kept = evaluator.by_speed, evaluator.by_speed.copy()
    evaluator(other.t, other.q, other.u)
    assert not np.array_equal(seen, kept) and np.array_equal(seen, evaluator.by_speed)
    with pytest.raises(ValueError, match="read-only"):
        seen[:] = 0.0


def test_threads_and_copies_have_arrays_of_their_own(asked: Asked) -> None:
    system, states = asked
    evaluator = system.derivative_evaluator()
    assert is_right(evaluator, system, states[0])
    here = evaluator.by_displacement.copy()
    with ThreadPoolExecutor(3) as pool:
        assert all(pool.map(lambda i: is_right(evaluator, system, states[1 + i % 5]), range(60)))
    for other in (copy.deepcopy(evaluator), pickle.loads(pickle.dumps(evaluator))):
        assert isinstance(other, DerivativeEvaluator) and is_right(other, system, states[2])
    np.testing.assert_array_equal(evaluator.by_displacement, here)
