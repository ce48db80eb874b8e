"""Threads may share everything that is public: the same numbers to the bit, from the first call of a process on."""

from __future__ import annotations

import gc
import multiprocessing
import os
import pickle
import re
import subprocess
import sys
import threading
import time
import weakref
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba.core.compiler_lock import global_compiler_lock

import flexmb as fm
from flexmb.closure.closures import Closures
from flexmb.jit.direct import Direct
from flexmb.kept import kept
from flexmb.run.warm_up import looped
from flexmb.system.evaluator import Evaluator
from flexmb.tables.features import asking
from flexmb.tables.per_thread import per_thread
from tests.benchmarks.rivals import rigid_chain
from tests.flexmb.system.argument_kinds import W
from tests.flexmb.system.system_calls import of_any

ROOT = Path(__file__).parents[3]


def program(name: str, *words: str, **environment: str) -> str:
    """What a module of this folder prints."""
    done = subprocess.run(
        [sys.executable, "-m", f"tests.flexmb.system.{name}", *words],
        cwd=ROOT, capture_output=True, text=True, env=os.environ | environment,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-4000:]
    return done.stdout + done.stderr[-2000:]


def first_word(printed: str) -> str:
    """What a program says on stdout: on stderr it may say that it compiles."""
    return next(iter(printed.split()), "nothing")


def wrong(printed: str) -> tuple[int, int]:
    """Wrong answers, and all."""
    found = re.findall(r"(\d+) wrong of (\d+)", printed)
    return sum(int(each) for each, _ in found), sum(int(count) for _, count in found)


def test_threads_share_all_objects():
    """All that is public: `test_public_calls.py` has a method that is not called turn red by its name."""
    printed = program("shared_calls", "whole")
    bad, count = wrong(printed)
    assert bad == 0 and count > 2500, printed


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["whole", "connected", "closed", "controlled", "long"])
def test_threads_share_all_objects_for_longer(scene):
    printed = program("shared_calls", scene, "--span", "0.5", "--thorough")
    bad, count = wrong(printed)
    print(printed)
    assert bad == 0 and count > 50000, printed


def test_what_is_shared_and_should_not_be_is_noticed():
    """Negative control: without workspaces of their own, threads get wrong numbers."""
    assert any(wrong(program("shared_calls", "--spoiled", "long"))[0] for _ in range(5))


@pytest.mark.parametrize("kernels", [pytest.param("exact", marks=pytest.mark.slow), "general"])  # 14 s to compile
def test_the_first_calls_of_a_process_may_be_those_of_threads(kernels):
    assert first_word(program("first_calls", "shared", FLEXMB_KERNELS=kernels)) == "right"


@pytest.mark.slow
@pytest.mark.parametrize("whose", ["shared", "own"])
@pytest.mark.parametrize("kernels", ["exact", "general"])
def test_the_first_calls_of_twenty_processes(kernels, whose):
    assert {first_word(program("first_calls", whose, FLEXMB_KERNELS=kernels)) for _ in range(20)} == {"right"}


def test_a_thread_that_forbids_what_another_compiles_is_noticed():
    """Negative control."""
    assert any("compilation disabled" in program("first_calls", "shared", "--spoiled") for _ in range(5))


# Evaluators


def in_a_thread(work: Callable[[], Any]) -> Any:
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(work).result()


def test_each_thread_has_an_array_of_a_shared_evaluator():
    evaluator, start = W.tree.evaluator(), W.tree.initial_state
    q, u = start.q, W.state.u
    mine = evaluator(0.0, q, u)
    expected = mine.copy()

    def other() -> bool:
        theirs = evaluator(0.0, q, 2.0 * u)
        again = evaluator(0.0, q, 2.0 * u)
        return theirs is again is evaluator.accelerations and theirs is not mine and not np.array_equal(theirs, mine)

    assert in_a_thread(other)
    assert np.array_equal(mine, expected) and evaluator(0.0, q, u) is mine is evaluator.accelerations


def test_an_evaluator_belongs_to_the_thread_that_calls_it_first():
    """Not to the one that made it, as where a pool is given its evaluators."""
    evaluator = W.tree.evaluator()
    theirs = in_a_thread(lambda: evaluator(0.5, W.state.q, W.state.u))
    mine = evaluator(0.5, W.state.q, W.state.u)
    assert theirs is not mine and np.array_equal(theirs, mine)


def reshaped(array: np.ndarray) -> None:
    array.shape = (1, -1)


def retyped(array: np.ndarray) -> None:
    array.dtype = np.int64


def cut_into_columns(array: np.ndarray) -> None:
    array.dtype = np.dtype([("x", float)])


def strided(array: np.ndarray) -> None:
    array.strides = (0,)


@pytest.mark.filterwarnings("ignore:Setting the:DeprecationWarning")
@pytest.mark.parametrize("readable", [True, False], ids=["gate", "step by step"])
@pytest.mark.parametrize("spoil", [reshaped, retyped, cut_into_columns, strided])
def test_what_somebody_makes_of_the_array_harms_no_later_call(spoil, readable, monkeypatch):
    if not readable:
        monkeypatch.setenv("FLEXMB_READ_OBJECTS", "off")
    evaluator = W.tree.evaluator()
    expected = W.tree.accelerations(W.state)
    spoil(evaluator(W.state.t, W.state.q, W.state.u))
    for _ in range(2):
        assert np.array_equal(evaluator(W.state.t, W.state.q, W.state.u), expected)
    assert evaluator(W.state.t, W.state.q, W.state.u) is evaluator.accelerations
    spoil(evaluator.accelerations)
    assert evaluator.accelerations.shape == (W.tree.nu,) and evaluator.accelerations.dtype == float


def test_the_array_cannot_be_made_writeable():
    found = W.tree.evaluator()(W.state.t, W.state.q, W.state.u)
    with pytest.raises(ValueError, match="WRITEABLE"):
        found.flags.writeable = True


# What is kept for a thread


class Asked:
    @per_thread
    def place(self) -> list[int]:
        """Found once by each thread."""
        return []

    @per_thread
    def broken(self) -> int:
        raise AttributeError("no such thing")


def test_a_property_of_each_thread():
    asked = Asked()
    assert asked.place is asked.place and Asked().place is not asked.place
    assert in_a_thread(lambda: asked.place is asked.place)
    assert in_a_thread(lambda: asked.place) is not asked.place
    assert Asked.place.__doc__ == "Found once by each thread."
    with pytest.raises(AttributeError, match="no such thing"):
        asked.broken  # noqa: B018
    asked.place.append(1)
    assert pickle.loads(pickle.dumps(asked)).place == []


def test_what_a_thread_has_goes_with_it():
    system = fm.compile(rigid_chain(3))
    evaluator = system.evaluator()
    state = system.initial_state
    evaluator(state.t, state.q, state.u)
    kept: list[weakref.ref[Any]] = []

    def work() -> None:
        system.energy(state), system.accelerations(state), system.nested().reduced(0.0, state.y)
        own = system.own_workspace, system.own_recursion_workspace, system.nested().own_workspace
        kept.extend(map(weakref.ref, own))
        kept.append(weakref.ref(evaluator(state.t, state.q, state.u)))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    del thread
    gc.collect()
    assert [each() for each in kept] == [None] * 4


def written(kept: Any) -> bool:
    """Whether calls write into something that is kept."""
    if isinstance(kept, dict):
        return any(map(written, kept.values()))
    if isinstance(kept, list | tuple):
        return any(map(written, kept))
    name = type(kept).__name__
    return isinstance(kept, Direct | Evaluator) or name in WRITTEN or name.endswith("Workspace")


WRITTEN = {"Outputs", "Observation", "Matrices", "Joint", "Response"}


@pytest.mark.parametrize("made", [lambda: W.scene, looped], ids=["tree", "closed"])
def test_nothing_that_calls_write_into_is_kept_for_all_threads(made):
    """But what runs and batches take out of the list that it is kept in, while they use it."""
    system = fm.compile(made())
    for call in of_any(system, system.initial_state).values():
        call.function(**call.arguments)
    factors = system.factorise(system.initial_state)
    for each in (system, factors) if system.scene.closures else (system, system.nested(), factors):
        shared = {name: value for name, value in vars(each).items() if name not in ("own", "kept")}
        assert not [name for name, value in shared.items() if written(value)], each
        assert written(vars(each.own))  # negative control: it is there, for this thread


def test_closures_count_their_rows_for_all_threads():
    system = fm.compile(looped())
    assert in_a_thread(lambda: system.rank) == system.closures.rank == in_a_thread(lambda: system.closures.rank) > 0
    assert isinstance(in_a_thread(lambda: system.closures), Closures)


def test_general_kernels_are_asked_for_by_one_thread_only():
    """What compiles ahead must not change what others are compiling."""
    before = os.environ.get("FLEXMB_KERNELS")
    try:
        os.environ["FLEXMB_KERNELS"] = "special"
        with asking("general"):
            assert fm.compile(looped()).kernels == "general"
            assert in_a_thread(lambda: fm.compile(looped()).kernels) == "special"
    finally:
        os.environ["FLEXMB_KERNELS"] = before or "general"


def forking(test: Callable[..., None]) -> Callable[..., None]:
    warned = pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")(test)
    return pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no forks")(warned)


def ends_well(work: Callable[[], None], seconds: float = 20) -> bool:
    """Whether a process that is forked off to do this ends in time and without a failure."""
    child = multiprocessing.get_context("fork").Process(target=work)
    child.start()
    child.join(seconds)
    if child.is_alive():
        child.kill()
        return False
    return child.exitcode == 0


@forking
def test_a_process_that_is_forked_off_while_threads_work_goes_on():
    """It has none of these threads, and no lock of theirs is held there."""
    system, state = W.tree, W.state
    expected, busy = system.accelerations(state), threading.Event()

    def work() -> None:
        while not busy.is_set():
            system.accelerations(state), system.evaluator()(state.t, state.q, state.u), system.energy(state)

    threads = [threading.Thread(target=work) for _ in range(3)]
    for thread in threads:
        thread.start()
    context = multiprocessing.get_context("fork")
    try:
        for _ in range(5):
            told = context.SimpleQueue()
            child = context.Process(target=_in_a_child, args=(system, state, told))
            child.start()
            child.join(60)
            assert child.exitcode == 0
            assert np.array_equal(told.get(), expected)
    finally:
        busy.set()
        for thread in threads:
            thread.join()


@forking
def test_a_process_that_is_forked_off_while_a_thread_compiles_can_compile():
    """It waits for the kernel, and does not inherit a lock that nobody there can release."""
    compiling, seconds = threading.Event(), 0.3

    def work() -> None:
        with global_compiler_lock:
            compiling.set()
            time.sleep(seconds)

    thread = threading.Thread(target=work)
    thread.start()
    compiling.wait()
    well = ends_well(_compile_in_a_child)
    thread.join()
    assert well


@forking
def test_a_process_that_is_forked_off_while_a_thread_finds_a_kept_value_finds_it_too():
    """For all that is kept in an object: the thread is inside the property, and is not there in the child."""
    finding, end = threading.Event(), threading.Event()

    class Kept:
        @kept
        def value(self) -> int:
            if not end.is_set():
                finding.set()
                end.wait(60)
            return 1

    thread = threading.Thread(target=lambda: Kept().value)
    thread.start()
    assert finding.wait(60)

    def work() -> None:
        end.set()
        sys.exit(Kept().value != 1)

    well = ends_well(work)
    end.set()
    thread.join()
    assert well


@forking
def test_a_process_that_is_forked_off_while_threads_import_and_read_first_scenes():
    """Of a module that they were importing, the child would wait for the rest; and none of their calls crashes."""
    assert program("forked_while_importing").split()[:2] == ["0", "0"]


@forking
def test_fifteen_processes_that_are_forked_off_while_threads_compile_scenes():
    """What threads find meanwhile is kept without locks, or forks wait for it: see `flexmb.kept`, `flexmb.forks`."""
    busy = threading.Event()

    def work() -> None:
        while not busy.is_set():
            _compile_and_evaluate()

    threads = [threading.Thread(target=work) for _ in range(3)]
    for thread in threads:
        thread.start()
    try:
        for _ in range(15):
            assert ends_well(_compile_and_evaluate, 30)
    finally:
        busy.set()
        for thread in threads:
            thread.join()


def _compile_in_a_child() -> None:
    with global_compiler_lock:
        pass


def _compile_and_evaluate() -> None:
    system = fm.compile(W.scene)
    system.accelerations(system.initial_state)


def _in_a_child(system: fm.System, state: fm.State, told: Any) -> None:
    system.evaluator()(state.t, state.q, state.u), system.energy(state), fm.simulate(system, 1e-3, samples=2)
    told.put(system.accelerations(state))
