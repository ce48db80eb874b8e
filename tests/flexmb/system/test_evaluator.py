"""Evaluators: the accelerations of a system to the bit, in one array, and with all its refusals."""

import copy
import gc
import pickle
import sys
import tracemalloc
import warnings
import weakref
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress

import numpy as np
import pytest

import flexmb as fm
from flexmb.entry.object_access import SWITCH
from flexmb.system import evaluator as evaluator_module
from flexmb.system.algorithms import ALGORITHMS
from tests.benchmarks.rivals import rigid_chain
from tests.flexmb.system.argument_kinds import World
from tests.trees import random_scene


@pytest.fixture(scope="module")
def system() -> fm.System:
    """A tree with a quaternion, a flexible body and a wheel, which the paper's print knows too."""
    return fm.compile(World().scene)


def moving(system: fm.System, seed: int) -> fm.State:
    start, rng = system.initial_state, np.random.default_rng(seed)
    return system.state(start.q, start.u + 0.1 * rng.normal(size=system.nu), 0.25)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_it_gives_the_accelerations_to_the_bit(system, algorithm):
    evaluator = system.evaluator(algorithm)
    for seed in range(3):
        state = moving(system, seed)
        found = evaluator(state.t, state.q, state.u)
        assert np.array_equal(found, system.accelerations(state, algorithm))
        assert np.array_equal(found, system.evaluate(state.t, state.q, state.u, algorithm).accelerations)


def test_the_array_is_used_again_and_only_read(system):
    evaluator, state, other = system.evaluator(), moving(system, 0), moving(system, 1)
    first = evaluator(state.t, state.q, state.u)
    kept = first.copy()
    assert evaluator(other.t, other.q, other.u) is first is evaluator.accelerations
    assert not np.array_equal(first, kept)
    with pytest.raises(ValueError, match="read-only"):
        first[:] = 0.0
    assert system.accelerations(state).flags.writeable


def test_a_call_allocates_no_array():
    system = fm.compile(rigid_chain(50))
    evaluator, state = system.evaluator(), moving(system, 0)
    q, u = state.q, state.u
    evaluator(state.t, q, u)
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    tracemalloc.reset_peak()
    for _ in range(100):
        evaluator(0.25, q, u)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak - before < 8 * system.nu


def test_neither_state_nor_evaluators_disturb_each_other(system):
    one, another = system.evaluator(), system.evaluator()
    state, other = moving(system, 0), moving(system, 1)
    q, u = state.q.copy(), state.u.copy()
    found = one(state.t, state.q, state.u)
    expected = found.copy()
    another(other.t, other.q, other.u), system.accelerations(other), system.mass_matrix(other)
    assert np.array_equal(found, expected)
    assert np.array_equal(state.q, q) and np.array_equal(state.u, u)


@pytest.fixture
def roads(system, monkeypatch) -> list[str]:
    """What evaluations were done step by step by, from now on: the gate lets the others pass."""
    taken = list[str]()
    careful = evaluator_module._Careful.__call__

    def noted(self, *args, **kwargs):
        taken.append("careful")
        return careful(self, *args, **kwargs)

    monkeypatch.setattr(evaluator_module._Careful, "__call__", noted)
    return taken


class OwnFloat(float):
    pass


def unaligned(x: np.ndarray) -> np.ndarray:
    room = np.zeros(8 * len(x) + 1, np.uint8)[1:]
    found = room.view(np.float64)
    found[:] = x
    return found


PLAIN = {
    "as it is": lambda x: x,
    "only read": lambda x: np.require(x, requirements=["C"]).copy().view(),
    "part of a larger one": lambda x: np.concatenate([x, x])[len(x) :],
    "column-wise as well": np.asfortranarray,
}
OTHERS = {
    "a list": list,
    "float32": np.float32,
    "complex": lambda x: x + 0j,
    "whole": lambda x: np.zeros(len(x), int),
    "swapped": lambda x: x.astype(">f8"),
    "strided": lambda x: np.repeat(x, 2)[::2],
    "backward": lambda x: x[::-1],
    "unaligned": unaligned,
    "a matrix": lambda x: x[None],
    "a number": lambda x: np.array(1.0),
    "a subclass": lambda x: x.view(np.recarray),
    "masked": np.ma.masked_invalid,
    "objects": lambda x: x.astype(object),
    "records": lambda x: x.view([("x", float)]),
    "too short": lambda x: x[1:],
    "None": lambda x: None,
}


@pytest.mark.parametrize("form", PLAIN)
def test_plain_arrays_take_the_short_road(system, roads, form):
    evaluator, state = system.evaluator(), moving(system, 0)
    expected = system.accelerations(state)
    q, u = PLAIN[form](state.q), PLAIN[form](state.u)
    u.flags.writeable = q.flags.writeable = False
    assert np.array_equal(evaluator(state.t, q, u), expected)
    assert not roads


@pytest.mark.parametrize("form", OTHERS)
def test_all_other_arguments_take_the_long_road(system, roads, form):
    """What is read where an array has its words must be an array, of these words."""
    evaluator, state = system.evaluator(), moving(system, 0)
    for q, u in ((OTHERS[form](state.q), state.u), (state.q, OTHERS[form](state.u))):
        before = len(roads)
        with suppress(ValueError, TypeError, fm.DynamicsError), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            evaluator(state.t, q, u)
        assert len(roads) == before + 1
    for t in (0, True, np.float64(0.25), OwnFloat(0.25), np.array(0.25), "0", None):
        before = len(roads)
        with suppress(ValueError, TypeError):
            evaluator(t, state.q, state.u)
        assert len(roads) == before + 1


def test_arguments_by_name_and_in_wrong_numbers(system, roads):
    evaluator, state = system.evaluator(), moving(system, 0)
    expected = system.accelerations(state)
    assert np.array_equal(evaluator(t=state.t, q=state.q, u=state.u), expected)
    assert np.array_equal(evaluator(state.t, u=state.u, q=state.q), expected)
    assert len(roads) == 2
    for args in ((), (0.0,), (0.0, state.q), (0.0, state.q, state.u, 1)):
        with pytest.raises(TypeError, match="argument"):
            evaluator(*args)
    with pytest.raises(TypeError, match="unexpected keyword"):
        evaluator(0.0, state.q, state.u, algorithm="composite")


def test_it_works_where_objects_cannot_be_read(system, roads, monkeypatch):
    monkeypatch.setenv(SWITCH, "off")
    evaluator, state = system.evaluator(), moving(system, 0)
    found = evaluator(state.t, state.q, state.u)
    assert np.array_equal(found, system.accelerations(state)) and found is evaluator.accelerations
    assert roads


def test_calls_leave_no_references(system):
    evaluator, state = system.evaluator(), moving(system, 0)
    t, q, u = 0.123, state.q.copy(), state.u.copy()
    held = [t, q, u, evaluator.accelerations]
    before = [sys.getrefcount(each) for each in held]
    for _ in range(100):
        evaluator(t, q, u)
        with pytest.raises(ValueError, match="finite"):
            evaluator(np.nan, q, u)
    assert [sys.getrefcount(each) for each in held] == before


def test_what_is_let_go_goes():
    system = fm.compile(rigid_chain(2))
    evaluator = system.evaluator()
    evaluator(0.0, np.zeros(2), np.zeros(2))
    gone = [weakref.ref(evaluator), weakref.ref(system)]
    call = evaluator.func
    del evaluator, system
    gc.collect()
    assert gone[0]() is None
    assert np.all(np.isfinite(call(0.0, np.zeros(2), np.zeros(2))))  # it holds what it needs
    del call
    gc.collect()
    assert gone[1]() is None


def test_long_ones_let_other_threads_run():
    """With so many speeds the interpreter is free meanwhile: threads, each with its own, agree."""
    system = fm.compile(rigid_chain(60))
    states = [moving(system, seed) for seed in range(4)]
    expected = [system.accelerations(state) for state in states]
    with ThreadPoolExecutor(4) as pool:
        evaluators = [system.evaluator() for _ in states]

        def work(i: int) -> bool:
            call, state = evaluators[i], states[i]
            return all(np.array_equal(call(state.t, state.q, state.u), expected[i]) for _ in range(500))

        assert all(pool.map(work, range(4)))


WRONG = {
    "q too short": lambda t, q, u: (t, q[1:], u),
    "q too long": lambda t, q, u: (t, np.append(q, 0.0), u),
    "u too long": lambda t, q, u: (t, q, np.append(u, 0.0)),
    "an entry of q in u": lambda t, q, u: (t, q[:-1], np.append(q[-1], u)),
    "a column": lambda t, q, u: (t, q[:, None], u),
    "complex": lambda t, q, u: (t, q + 0j, u),
    "words": lambda t, q, u: (t, "q", u),
    "None": lambda t, q, u: (t, q, None),
    "NaN": lambda t, q, u: (t, q * np.nan, u),
    "infinite": lambda t, q, u: (t, q, u + np.inf),
    "no orientation": lambda t, q, u: (t, 0.0 * q, u),
    "t NaN": lambda t, q, u: (np.nan, q, u),
    "t infinite": lambda t, q, u: (np.inf, q, u),
    "t a word": lambda t, q, u: ("0", q, u),
    "t true": lambda t, q, u: (True, q, u),
    "t complex": lambda t, q, u: (1j, q, u),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_what_is_wrong_is_refused_in_the_words_of_evaluate(system, wrong):
    assert len(system.layout.quaternions)
    evaluator, state = system.evaluator(), moving(system, 0)
    given = WRONG[wrong](state.t, state.q, state.u)
    with pytest.raises((ValueError, TypeError)) as ours:
        evaluator(*given)
    with pytest.raises(type(ours.value)) as theirs:
        system.evaluate(*given)
    assert str(ours.value) == str(theirs.value)
    assert np.array_equal(evaluator(state.t, state.q, state.u), system.accelerations(state))  # it goes on


def on_two_hinges(inertia: float, mass: float = 1e-30) -> fm.System:
    """A body turned twice about the same axis, by way of one that weighs next to nothing."""
    builder = fm.SceneBuilder("twice").rigid_body("link", mass=mass, inertia=(inertia,) * 3)
    builder.rigid_body("bob", mass=1.0, inertia=(0.1, 0.1, 0.1))
    return fm.compile(builder.revolute("a", "ground", "link").revolute("b", "link", "bob").scene())


def test_what_has_no_accelerations_or_hardly_any_says_so_as_ever():
    heavy = on_two_hinges(1e-3)
    assert np.all(np.isfinite(heavy.evaluator()(0.0, np.zeros(2), np.ones(2))))
    for inertia in (1e-14, 1e-17):
        system = on_two_hinges(inertia)
        said = [outcome(lambda s=system: s.accelerations(s.initial_state))]
        said.append(outcome(lambda s=system: s.evaluator()(0.0, np.zeros(2), np.zeros(2))))
        assert said[0] == said[1] and said[0][0]


def outcome(call) -> tuple[str, str]:
    """Class and text of the error or warning."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            call()
        except (fm.DynamicsError, fm.PrecisionWarning) as raised:
            return type(raised).__name__, str(raised)
    return "", ""


def test_results_that_overflow_are_refused(system):
    evaluator, state = system.evaluator(), moving(system, 0)
    with pytest.raises(fm.DynamicsError, match=r"the result at t = 0.25 s is not finite"):
        evaluator(0.25, state.q, np.full(system.nu, 1e200))


def test_it_holds_what_it_reads():
    """The system is let go, its arrays are not."""
    system = fm.compile(random_scene(5))
    state, expected = moving(system, 0), system.accelerations(moving(system, 0))
    evaluator = system.evaluator()
    del system
    for _ in range(3):
        gc.collect()
        _ = [np.full(1000, np.nan) for _ in range(1000)]
        assert np.array_equal(evaluator(state.t, state.q, state.u), expected)


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
def test_copies_have_addresses_of_their_own(system, copied):
    """A copy that kept an address would read freed memory, or write into the original."""
    state = moving(system, 0)
    expected = system.accelerations(state), system.mass_matrix(state), fm.simulate(system, 1e-3, samples=3).q
    other, evaluator = copied(system), copied(system.evaluator("composite"))
    assert not other._evaluators and not other.kept
    found = other.accelerations(state), other.mass_matrix(state), fm.simulate(other, 1e-3, samples=3).q
    assert all(np.array_equal(a, b) for a, b in zip(found, expected, strict=True))
    assert np.array_equal(evaluator(state.t, state.q, state.u), system.accelerations(state, "composite"))
    other.own_workspace.body["velocity"][:] = np.nan
    assert np.array_equal(system.mass_matrix(state), expected[1])
    with pytest.raises(TypeError, match="cannot be copied"):
        copied(system._invert)
