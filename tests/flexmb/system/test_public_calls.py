"""Public calls with wrong arguments: no crash, no silent nonsense. In a process of their own, for they did crash."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.flexmb.system import public_calls, walk
from tests.flexmb.system.argument_kinds import Call, Variant, W, rows
from tests.flexmb.system.batch_calls import judge
from tests.flexmb.system.public_calls import faults


@pytest.mark.parametrize("words", [(), pytest.param(["--thorough"], marks=pytest.mark.slow)], ids=["some", "all"])
def test_every_public_call_refuses_what_is_wrong_and_casts_what_is_right(words):
    """Variants of all arguments of all public calls, thoroughly all; a crash names its place by faulthandler."""
    program = [sys.executable, "-m", "tests.flexmb.system.public_calls", *words]
    done = subprocess.run(program, cwd=Path(__file__).parents[3], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-4000:]
    *found, summary = done.stdout.splitlines()
    assert not [line for line in found if line], "\n".join(found)
    assert int(summary.split()[0]) > (2500 if words else 1000)


def test_a_public_name_that_is_not_called_is_found(monkeypatch):
    monkeypatch.setattr(public_calls.fm.System, "novel", lambda self, x: x, raising=False)
    assert "System.novel" in walk.public()
    walk.met()
    monkeypatch.setattr(public_calls, "calls", dict)
    assert {"System.novel", "System.accelerations", "NestedSystem.reduced"} <= walk.unlisted()


def test_a_class_that_an_attribute_leads_to_is_found(monkeypatch):
    """Negative control: a new kind of result, with a method that nobody calls."""
    novel = type("Novel", (), {"__module__": "flexmb.system.novel", "ask": lambda self, x: x})
    monkeypatch.setattr(public_calls.fm.System, "novel", property(lambda self: novel()), raising=False)
    assert novel in walk.reached() and "Novel.ask" in walk.unlisted()


def test_a_class_that_a_call_gives_is_found(monkeypatch):
    """Negative control: a result with a method that nobody calls, of a call that is public."""
    novel = type("Novel", (), {"__module__": "flexmb.system.novel", "ask": lambda self, x: x})
    monkeypatch.setattr(walk, "met", lambda: ({"answers": [novel()]},))
    assert walk.reached() == {novel} and "Novel.ask" in walk.unlisted()


def test_nothing_that_threads_may_share_holds_arrays_that_kernels_write():
    """Else two threads write them at once, and a test of threads sees it now and then."""
    assert "Closed" in walk.holders() <= set(walk.GUARDED)


def test_a_result_that_holds_arrays_that_kernels_write_is_seen(monkeypatch):
    """Negative control."""
    novel = type("Novel", (), {"__module__": "flexmb.system.novel"})()
    novel.__dict__["_w"] = W.tree.workspace()
    monkeypatch.setattr(walk, "met", lambda: ({"answers": [novel]},))
    assert walk.holders() == {"Novel"}


@pytest.mark.parametrize(
    ("function", "variant", "fault"),
    [
        (lambda q: 2.0, Variant("short", None), "no error"),
        (lambda q: float("nan"), Variant("huge", 1e308, open=True), "not finite"),
        (lambda q: float(q != 1), Variant("integer", 1, 1.5), "another result"),
        (lambda q: q.nothing, Variant("None", None), "AttributeError"),
    ],
)
def test_faults_are_seen(function, variant, fault):
    """Negative controls: calls that swallow, overflow, mistake types, or end in an error of another kind."""
    quiet = Call(lambda q: 1.0 if isinstance(q, str) else function(q), {"q": "sound"}, {"q": lambda _: [variant]})
    found = list(faults("call", quiet))
    assert len(found) == 1 and fault in found[0]


def test_what_a_refused_call_leaves_behind_is_seen():
    """Negative controls: a call that remembers what it has refused, by other numbers or by an error."""
    for kept, fault in ((3.0, "give other numbers"), (None, "give TypeError")):
        memory = [2.0]

        def call(q, memory=memory, kept=kept):
            if q == "wrong":
                memory[0] = kept
                raise ValueError("q")
            return 1.0 * memory[0]

        found = list(faults("call", Call(call, {"q": 0.5}, {"q": lambda _: [Variant("text", "wrong")]})))
        assert len(found) == 1 and fault in found[0]


@pytest.mark.parametrize(("kept", "fault"), [(3.0, "other numbers"), (None, "TypeError")])
def test_what_a_refused_call_leaves_to_another_is_seen(kept, fault):
    """Negative controls: one call spoils what another reads."""
    memory = [2.0]

    def spoiling(q):
        if q == "wrong":
            memory[0] = kept
            raise ValueError("q")
        return 1.0

    asked = {
        "Object.spoiling": Call(spoiling, {"q": 0.5}, {"q": lambda _: [Variant("NaN", "wrong")]}),
        "Object.reading": Call(lambda: 1.0 * memory[0], {}, {}),
        "Other.reading": Call(lambda: 1.0, {}, {}),
    }
    found = list(public_calls.left_behind(asked))
    assert len(found) == 1 and "Object.reading after Object.spoiling(q: NaN)" in found[0] and fault in found[0]


@pytest.mark.parametrize(
    ("failed", "rows"),
    [
        ([], [[np.nan], [1.0]]),  # nobody noticed
        ([0], [[2.0], [1.0]]),  # of a copy that failed there are numbers
        ([0, 1], [[np.nan], [np.nan]]),  # it failed another one
        ([], [[2.0], [1.0]]),  # what is not finite has a result
    ],
)
def test_faults_of_copies_are_seen(failed, rows):
    """Negative controls: of two copies the first is given NaN."""
    with pytest.raises(AssertionError):
        judge(np.array(failed, int), np.array(rows), [[np.nan], [0.0]])
    with pytest.raises(ArithmeticError):
        judge(np.array([0]), np.array([[np.nan], [1.0]]), [[np.nan], [0.0]])


def test_a_state_made_by_hand_shares_nothing_with_its_arrays():
    q = W.state.q.copy()
    state = public_calls.fm.State(q, W.state.u)
    q[:] = 0.0
    assert state.q[0] != 0.0
    assert any(variant.name == "column" for variant in rows(q))


def test_numbers_written_into_a_state_are_seen():
    state = W.tree.initial_state
    before = W.tree.accelerations(state)
    state.u[:] = 0.5
    assert not (before == W.tree.accelerations(state)).all()


@pytest.mark.parametrize("t", [0, 1])
def test_an_integer_time_compiles_nothing(t):
    from flexmb.entry import observation

    W.tree.evaluate(0.0, W.state.q, W.state.u)
    versions = len(observation.observe.signatures)
    W.tree.evaluate(t, W.state.q, W.state.u)
    assert len(observation.observe.signatures) == versions


@pytest.mark.parametrize("t", ["1", None, np.nan, 1j])
def test_what_observes_for_the_library_itself_refuses_a_time_that_is_none(t):
    """Users can call it all the same: by numba they would be told that no definition matches."""
    tree, chain, loads = W.tree, W.chain, W.tree.observation.out.loads.copy()
    row = np.zeros(1)
    for observe in (
        lambda: tree.observe_recursion(t, W.y), lambda: tree.observe_rates(t, W.y, W.rates),
        lambda: tree.observe_motion(t, W.y, W.rates, W.rates, loads),
        lambda: tree.turns(t, tree.initial_state.q, tree.initial_state.u),
        lambda: tree.observe_row(t, W.y, "articulated", row),
        lambda: chain.observe_row(t, np.append(chain.initial_state.y, 0.0), "articulated", row),
    ):  # fmt: skip
        with pytest.raises((TypeError, ValueError), match="t is"):
            observe()
