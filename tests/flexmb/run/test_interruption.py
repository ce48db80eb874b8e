"""Ctrl-C ends compiled runs within a second and keeps what was reached: sent to processes of their own."""

import gc
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
import weakref
from pathlib import Path

import numpy as np
import pytest

import flexmb as fm
import flexmb.run.observing as observing
import flexmb.run.propagate as propagation
from flexmb.integrate.catalogue import INTEGRATORS
from flexmb.run.interruption import interruptible
from flexmb.run.warm_up import looped, pendulum
from flexmb.tables.status import Status

ROOT = Path(__file__).parents[3]
LIMIT_S = 600.0  # with cold kernels on a busy machine
pytestmark = pytest.mark.skipif(os.name == "nt", reason="sends signals as POSIX does")

# Presses Ctrl-C a while after the compiled loop began. Times are those of the processor: the machine may be busy.
PRESSED = """
import os, signal, sys, threading, time
import flexmb as fm
import flexmb.run.propagate as propagation
from flexmb.run.warm_up import pendulum

signal.signal(signal.SIGINT, signal.default_int_handler)  # who runs tests in the background ignores Ctrl-C

def press():
    global pressed
    pressed = time.process_time()
    os.kill(os.getpid(), signal.SIGINT)

def watched(*given):
    threading.Timer(0.3, press).start()
    return whole(*given)

whole, propagation.interruptible = propagation.interruptible, watched
"""
PROBE = """
for method, options in eval(sys.argv[1]).items():
    try:
        fm.simulate(pendulum(), 1e6, method, samples=10_001, max_steps=10**15, **options)
    except KeyboardInterrupt as stopped:
        run, lasted = stopped.trajectory, time.process_time() - pressed
        print(method, lasted, run.status.name, run.stopped_at, len(run.t), run.t[-1], " ".join(str(stopped).split()))
"""
METHODS = {
    name: {"step": 1e-6} if integrator.fixed else {"rtol": 1e-12, "atol": 1e-14}
    for name, integrator in INTEGRATORS.items()
}


def test_a_compiled_run_ends_within_a_second_and_keeps_what_it_reached():
    """By every method, one after the other: the process goes on."""
    program = [sys.executable, "-c", PRESSED + PROBE, repr(METHODS)]
    done = subprocess.run(program, cwd=ROOT, capture_output=True, text=True, timeout=LIMIT_S)
    assert done.returncode == 0, done.stderr
    lines = [line.split() for line in done.stdout.splitlines()]
    assert [line[0] for line in lines] == list(METHODS)
    for method, seconds, name, stopped_at, count, last, *message in lines:
        assert float(seconds) < 1.0, method
        assert name == "INTERRUPTED"
        assert 0.0 <= float(last) <= float(stopped_at) < 1e6
        assert 1 <= int(count) < 10_001
        assert "interrupted from the keyboard" in " ".join(message)


def test_the_command_line_writes_what_was_reached_and_says_130(tmp_path):
    scene = tmp_path / "scene.toml"
    fm.save_scene(pendulum(), scene)
    options = ["--t-end", "1e6", "--rtol", "1e-12", "--samples", "1001", "--no-plots", "--out", str(tmp_path)]
    words = ["flexmb", "simulate", str(scene), *options]
    program = f"{PRESSED}\nimport flexmb.cli\nsys.argv = {words!r}\nflexmb.cli.main()"
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, timeout=LIMIT_S)
    assert done.returncode == 130, done.stderr
    assert "interrupted from the keyboard" in done.stdout.replace("\n", " ")
    assert (tmp_path / "trajectory.csv").read_text().count("\n") >= 2


@pytest.mark.parametrize("algorithm", ["articulated", "composite"])
def test_outputs_that_are_evaluated_are_kept_too(algorithm, monkeypatch):
    """By the compiled loop, which Python calls again and again, and by single states."""
    system, seen = fm.compile(pendulum()), 0
    whole = type(system).observe_row

    def observe_row(self, *given):
        nonlocal seen
        seen += 1
        if seen == 4:
            raise KeyboardInterrupt
        return whole(self, *given)

    def nothing_at_once(times, states, rows):
        return 0

    monkeypatch.setattr(type(system), "observe_row", observe_row)
    monkeypatch.setattr(propagation, "batch", lambda *given: nothing_at_once)
    with pytest.raises(fm.Interrupted) as stopped:
        fm.simulate(system, 1.0, samples=11, algorithm=algorithm)
    run = stopped.value.trajectory
    assert run.status is Status.INTERRUPTED
    assert len(run.t) == len(run.q) == len(run.momentum) == 3
    assert "outputs were evaluated" in str(stopped.value)


def test_the_keyboard_is_looked_at_between_the_samples_of_a_large_scene(monkeypatch):
    """Compiled code takes many samples at once where they are cheap, few where each takes long."""
    asked, clock = [], iter(range(10**6))
    monkeypatch.setattr(observing, "perf_counter", lambda: next(clock))  # a second passes at every look

    def batch(times, states, rows):
        asked.append(len(times))
        return len(times)

    system = fm.compile(pendulum())
    states = np.zeros((50, 3))
    assert observing.observe(system, "articulated", np.arange(50.0), states, batch).trouble is None
    assert asked == [1] * 50
    monkeypatch.setattr(observing, "perf_counter", lambda: 0.0)
    asked.clear()
    observing.observe(system, "articulated", np.arange(50.0), states, batch)
    assert asked == [1, 2, 4, 8, 16, 19]


@pytest.fixture
def keyboard():
    """Ctrl-C as at a terminal: who runs tests in the background ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("keyboard")
def test_ctrl_c_at_the_very_end_is_not_swallowed():
    """A loop over runs must end where one of them is interrupted, even if that one finished."""
    stop = np.zeros(1, np.int64)

    def last_moment() -> str:
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.05)
        return "finished"

    assert interruptible(last_moment, (), stop) == ("finished", True)
    assert stop[0] == 1


def test_errors_of_a_run_and_of_other_signals_come_through():
    with pytest.raises(ZeroDivisionError):
        interruptible(lambda: 1 / 0, (), np.zeros(1, np.int64))

    def alarm(number, frame):
        raise TimeoutError

    before, stop = signal.signal(signal.SIGALRM, alarm), np.zeros(1, np.int64)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.05)
        with pytest.raises(TimeoutError):
            interruptible(lambda: [time.sleep(0.01) for _ in range(100) if stop[0] == 0], (), stop)
    finally:
        signal.signal(signal.SIGALRM, before)
    assert stop[0] == 1


def test_runs_share_a_thread_and_one_within_another_has_its_own():
    """A handler of a signal may start a run of its own, while the main thread waits."""
    stop, inner = np.zeros(1, np.int64), list[int]()
    first, _ = interruptible(threading.get_ident, (), stop)
    assert interruptible(threading.get_ident, (), stop)[0] == first != threading.get_ident()

    def alarm(number, frame):
        inner.append(interruptible(threading.get_ident, (), stop)[0])

    before = signal.signal(signal.SIGALRM, alarm)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.05)
        outer, _ = interruptible(lambda: (time.sleep(0.3), threading.get_ident())[1], (), stop)
    finally:
        signal.signal(signal.SIGALRM, before)
    assert outer == first and len(inner) == 1 and inner[0] != first


def test_what_ran_is_let_go():
    class Something:
        pass

    def made():
        thing = Something()
        return weakref.ref(thing), lambda: id(thing)

    (gone, run), stop = made(), np.zeros(1, np.int64)
    interruptible(run, (), stop)
    assert gone() is not None
    del run
    interruptible(lambda: None, (), stop)
    gc.collect()
    assert gone() is None


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are not forked here")
def test_a_process_that_was_forked_off_has_a_thread_of_its_own():
    program = """
import os, signal
import numpy as np
from flexmb.run.interruption import interruptible
stop = np.zeros(1, np.int64)
assert interruptible(lambda: 1, (), stop) == (1, False)
child = os.fork()
if child == 0:
    signal.alarm(60)  # where it waits for a thread that is not there
    os._exit(interruptible(lambda: 7, (), stop)[0])
assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7
assert interruptible(lambda: 2, (), stop) == (2, False)
"""
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, timeout=LIMIT_S)
    assert done.returncode == 0, done.stderr


def test_in_another_thread_a_run_is_called_there():
    found = []
    thread = threading.Thread(
        target=lambda: found.append(interruptible(threading.get_ident, (), np.zeros(1, np.int64)))
    )
    thread.start()
    thread.join()
    assert found == [(thread.ident, False)]


def same(one: fm.Trajectory, other: fm.Trajectory) -> bool:
    """Whether the numbers of two runs are equal to the last bit, and what they have cost."""
    cost = ("evaluations", "accepted_steps", "rejected_steps", "jacobians", "factorisations")
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in ("t", "q", "u", "work")) and all(
        getattr(one.statistics, name) == getattr(other.statistics, name) for name in cost
    )


@pytest.fixture
def handed_over(monkeypatch):
    """The runs that were handed over to another thread: their bounds of steps."""
    found, whole = list[int](), propagation.interruptible

    def noted(run, given, stop):
        found.append(given[2].max_steps)
        return whole(run, given, stop)

    monkeypatch.setattr(propagation, "interruptible", noted)
    return found


@pytest.mark.parametrize("method", ["dop853", "rk4", "radau5", "exponential", "generalised_alpha"])
def test_a_run_that_is_short_by_the_one_before_is_integrated_where_it_is_called(method, handed_over):
    step = {"step": 0.01} if INTEGRATORS[method].fixed else {}
    system = fm.compile(pendulum())
    first = fm.simulate(system, 0.1, method, samples=3, **step)
    fm.simulate(system, 0.1, method, samples=3, **step)  # the first one may have waited for a kernel
    before = len(handed_over)
    assert before >= 1
    assert same(first, fm.simulate(system, 0.1, method, samples=3, **step))
    assert len(handed_over) == before


@pytest.mark.parametrize("made", [pendulum, looped])
def test_a_run_that_is_longer_than_expected_begins_anew(made, handed_over, monkeypatch):
    """By tolerances that take eight times the steps, after runs that took few; a bound of one's own is kept."""
    monkeypatch.setattr(propagation, "SHORT", 60.0)
    exact = {"rtol": 1e-13, "atol": 1e-13}
    expected = fm.simulate(fm.compile(made()), 3.0, samples=7, **exact)
    system = fm.compile(made())
    coarse = fm.simulate(system, 3.0, samples=7, rtol=1e-2, atol=1e-2).statistics
    fine = expected.statistics
    expected_steps = propagation.FEW_MORE + 2 * (coarse.accepted_steps + coarse.rejected_steps)
    assert fine.accepted_steps + fine.rejected_steps > expected_steps
    del handed_over[:]
    assert same(expected, fm.simulate(system, 3.0, samples=7, **exact))
    assert len(handed_over) == 1
    assert same(expected, fm.simulate(system, 3.0, samples=7, **exact))  # by now it is known how long it takes
    stopped = fm.simulate(system, 3.0, samples=7, max_steps=3, **exact)
    assert stopped.status is Status.MAX_STEPS and stopped.statistics.accepted_steps <= 3
    assert len(handed_over) == 1


@pytest.mark.usefixtures("keyboard")
def test_ctrl_c_during_a_short_run_is_not_swallowed(handed_over, monkeypatch):
    system, whole = fm.compile(pendulum()), propagation.Integration.__call__
    for _ in range(2):
        fm.simulate(system, 0.1)
    before = len(handed_over)

    def pressed(self, *given):
        found = whole(self, *given)
        if threading.current_thread() is threading.main_thread():
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.05)
        return found

    monkeypatch.setattr(propagation.Integration, "__call__", pressed)
    with pytest.raises(fm.Interrupted) as stopped:
        fm.simulate(system, 0.1)
    run = stopped.value.trajectory
    assert run.status is Status.INTERRUPTED and len(run.t) == 1 and run.stopped_at == 0.0
    assert len(handed_over) == before + 1
    monkeypatch.undo()
    whole_run, later = fm.simulate(system, 0.1), fm.simulate(system, 0.1, state=run.restart)
    assert np.array_equal(later.q, whole_run.q) and np.array_equal(later.u, whole_run.u)


def test_what_was_interrupted_survives_pickling():
    run = fm.simulate(pendulum(), 0.1, samples=3)
    assert pickle.loads(pickle.dumps(fm.Interrupted(run))).trajectory.stopped_at == run.stopped_at
