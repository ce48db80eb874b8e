"""Derivatives in a loop: those of `acceleration_derivatives` to the bit, in arrays of each thread."""

from __future__ import annotations

import copy
import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import flexmb as fm
from flexmb.system.derivative_evaluator import DerivativeEvaluator
from tests.flexmb.system.argument_kinds import World
from tests.flexmb.system.test_copies import controlled
from tests.flexmb.system.test_evaluator import moving


@pytest.fixture(scope="module")
def system() -> fm.System:
    return fm.compile(World().scene)


def is_right(evaluator: DerivativeEvaluator, system: fm.System, seed: int) -> bool:
    state = moving(system, seed)
    expected = system.acceleration_derivatives(state)
    rates = evaluator(state.t, state.q, state.u)
    names = "by_displacement", "by_speed", "by_force"
    same = all(np.array_equal(getattr(evaluator, name), getattr(expected, name)) for name in names)
    return same and np.array_equal(rates, expected.accelerations)


def test_it_gives_the_derivatives_to_the_bit(system: fm.System) -> None:
    evaluator = system.derivative_evaluator()
    assert all(is_right(evaluator, system, seed) for seed in range(3))
    state = moving(system, 5)
    before = evaluator(state.t, state.q, state.u).copy()
    np.testing.assert_array_equal(evaluator(state.t, state.q.tolist(), state.u.tolist()), before)


def test_arrays_are_used_again_and_only_read(system: fm.System) -> None:
    evaluator, state, other = system.derivative_evaluator(), moving(system, 0), moving(system, 1)
    evaluator(state.t, state.q, state.u)
    seen, kept = evaluator.by_speed, evaluator.by_speed.copy()
    evaluator(other.t, other.q, other.u)
    assert not np.array_equal(seen, kept) and np.array_equal(seen, evaluator.by_speed)
    with pytest.raises(ValueError, match="read-only"):
        seen[:] = 0.0


def test_each_thread_has_arrays_of_its_own(system: fm.System) -> None:
    evaluator = system.derivative_evaluator()
    assert is_right(evaluator, system, 0)
    here = evaluator.by_displacement.copy()
    with ThreadPoolExecutor(3) as pool:
        assert all(pool.map(lambda seed: is_right(evaluator, system, seed), [1 + i % 5 for i in range(60)]))
    np.testing.assert_array_equal(evaluator.by_displacement, here)


def test_copies_are_evaluators_of_copied_systems(system: fm.System) -> None:
    evaluator = system.derivative_evaluator()
    for other in (copy.deepcopy(evaluator), pickle.loads(pickle.dumps(evaluator))):
        assert isinstance(other, DerivativeEvaluator) and is_right(other, system, 2)


def test_what_is_refused(system: fm.System) -> None:
    evaluator, state = system.derivative_evaluator(), system.initial_state
    with pytest.raises(ValueError, match="give finite numbers"):
        evaluator(0.0, state.q, state.u + np.nan)
    with pytest.raises(ValueError, match="numbers in a row"):
        evaluator(0.0, state.q, state.u[:-1])
    with pytest.raises(fm.DynamicsError):
        evaluator(0.0, state.q, np.full(system.nu, 1e200))
    with pytest.raises(NotImplementedError, match="has controllers"):
        fm.compile(controlled()).derivative_evaluator()
