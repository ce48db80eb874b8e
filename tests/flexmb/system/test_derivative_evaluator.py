"""Derivatives in a loop: of trees those of `acceleration_derivatives` to the bit, in arrays of each thread; of closed
chains against those by dense factors, dual numbers and identities; refusals."""

from __future__ import annotations

import copy
import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import flexmb as fm
from flexmb.run.warm_up import looped
from flexmb.system.derivative_evaluator import DerivativeEvaluator
from tests.flexmb.closure import mechanisms as m
from tests.flexmb.closure.dense_variation import dense
from tests.flexmb.closure.test_jacobian import MOVING, Linearised
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


# Initial values of random loops do not close them: the nearest ones that do are taken, and told.
CORRECTED = pytest.mark.filterwarnings("ignore:.*the nearest values that they allow are taken:flexmb.SceneWarning")
NAMES = "by_displacement", "by_speed", "by_force"
# Both routes round the mass matrix of the tree, whose condition is up to 1e4 here, and the rows, with another 1e2.
TOLERANCE = 1e-9


def moved(system: fm.System, t: float) -> fm.State:
    """A closed state of a motion, the initial one at t = 0."""
    if t == 0.0:
        return system.initial_state
    run = fm.simulate(system, t, samples=2, rtol=1e-12, atol=1e-12)
    return fm.State(run.q[-1], run.u[-1], run.t[-1])


def scales(system: fm.System, state: fm.State) -> dict[str, float]:
    """What the derivatives of the tree's accelerations are of, at this state: sizes that rounding is relative to."""
    inverse = np.linalg.inv(system.mass_matrix(state))
    found = system.inverse_dynamics_derivatives(state, system.accelerations(state))
    sizes = {name: np.abs(inverse) @ np.abs(getattr(found, name)) for name in NAMES[:2]} | {NAMES[2]: inverse}
    return {name: max(1.0, float(np.abs(size).max())) for name, size in sizes.items()}


@pytest.mark.parametrize("t", [0.0, 0.1])
@pytest.mark.parametrize("name", MOVING)
@CORRECTED
def test_it_gives_what_dense_factors_give(name: str, t: float) -> None:
    """In all directions, also those that closures do not allow, for the same choice of rows; loads of rows as well."""
    system = fm.compile(MOVING[name]())
    evaluator, state = system.derivative_evaluator(), moved(system, t)
    expected, public = dense(system, state), system.acceleration_derivatives(state)
    rates = evaluator(state.t, state.q, state.u)
    # With light bodies few digits are left, by an estimate, and dense factors lose those of the condition of M.
    condition = np.linalg.cond(system.mass_matrix(state))
    tolerance = max(TOLERANCE, 10.0 * 10.0 ** -system.digits_left(state), np.finfo(float).eps * condition)
    assert np.abs(expected.balance).max() < tolerance * max(1.0, np.abs(rates).max())
    size = scales(system, state)
    for each in NAMES:
        found, wanted = getattr(evaluator, each), getattr(expected, each)
        np.testing.assert_array_equal(found, getattr(public, each))
        assert np.abs(found - wanted).max() < tolerance * size[each], each
    assert np.abs(public.by_time - expected.by_time).max() < tolerance * max(1.0, np.abs(expected.by_time).max())
    assert np.abs(system.closure_operators(state).J @ evaluator.by_force).max() < tolerance * size["by_force"]
    assert np.abs(evaluator.by_force - evaluator.by_force.T).max() < tolerance * size["by_force"]
    of_loads = system.linearisation._variation(*system.layout.entering(state)).rows.of_loads
    for found, wanted in zip(of_loads, expected[4:8], strict=True):
        assert np.abs(found - wanted).max() < tolerance * max(1.0, np.abs(wanted).max())


@pytest.mark.parametrize("name", ["flexible four-bar", "exact four-bar", "connected", "slider-crank", "coupled"])
@CORRECTED
def test_it_gives_what_dual_numbers_give(name: str) -> None:
    system = fm.compile(MOVING[name]())
    evaluator, state = system.derivative_evaluator(), moved(system, 0.1)
    evaluator(0.0, state.q, state.u)  # duals are taken at t = 0
    state = fm.State(state.q, state.u, 0.0)
    J = Linearised(system, state.y.copy()).by_duals(system)[system.nq : -1]
    # Rows that depend on others change only what closures do not allow.
    allowed = np.eye(system.nu) - np.linalg.pinv(rows := system.closure_operators(state).J) @ rows
    by_displacement = J[:, : system.nq] @ system.acceleration_derivatives(state).motion
    size = scales(system, state)
    assert np.abs((evaluator.by_speed - J[:, system.nq : -1]) @ allowed).max() < TOLERANCE * size["by_speed"]
    off = np.abs((evaluator.by_displacement - by_displacement) @ allowed)
    assert off.max() < TOLERANCE * size["by_displacement"]
    assert np.abs((1.0 + 1e-6) * by_displacement @ allowed - by_displacement @ allowed).max() > off.max()


@CORRECTED
def test_singular_positions_are_told() -> None:
    """All bars of a four-bar on one line: fewer rows are independent; the states before and after it answer again."""
    system = fm.compile(m.windows(1, 30.0))
    evaluator, start = system.derivative_evaluator(), system.initial_state
    evaluator(start.t, start.q, start.u)
    before = evaluator.by_force.copy()
    flat = [0.0, 0.0, 0.0]  # the feet and the corner
    assert max(max(gap) for gap in system.closure_gaps(system.state(flat, [1.0, 1.0, -1.0], 0.0)).values()) < 1e-12
    with pytest.raises(fm.DynamicsError, match='"window 0"') as told:
        evaluator(0.0, flat, [1.0, 1.0, -1.0])
    assert told.value.status is fm.Status.CLOSURE_SINGULAR
    evaluator(start.t, start.q, start.u)
    np.testing.assert_array_equal(evaluator.by_force, before)
