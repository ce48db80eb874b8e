"""A line for who waits for the compiler, and none for who does not."""

import logging
import os
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

from numba import njit
from numba.core import event

from flexmb.jit import progress
from flexmb.jit.progress import announced

ROOT = Path(__file__).parents[3]
PROGRAM = """
import logging, sys, time
from pathlib import Path
from flexmb.jit import cache, hooks, progress
from flexmb.jit.kernel import helper, kernel

hooks.cache_directory = lambda: Path(sys.argv[1])
progress.unfit = lambda: "they are for another processor" if "foreign" in sys.argv else ""
progress.AFTER = float(sys.argv[2])
if "silent" in sys.argv:
    logging.getLogger("flexmb.jit").setLevel(logging.ERROR)

@helper
def inner(x):
    return 2.0 * x

@kernel
def slow(x):
    "Twice a number.\\n\\nAnd more."
    return inner(x)

plain = slow._compiler.compile

def slowly(*arguments):
    time.sleep(0.5)
    return plain(*arguments)

slow._compiler.compile = slowly
assert slow(1.5) == 3.0
if "whole" in sys.argv:
    assert slow(2) == 4
"""


def lines(folder: Path, after: float, *options: str) -> list[str]:
    """On stderr, of a process of its own."""
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", PROGRAM, str(folder), str(after), *options]
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, ""), done.stderr
    return done.stderr.splitlines()


def test_a_slow_kernel_is_announced_once(tmp_path):
    """What, for what, and that it is once."""
    [line] = lines(tmp_path, 0.1)
    assert line == (
        f"flexmb is compiling __main__.slow (Twice a number) for scenes of this kind, once: it is kept in {tmp_path}"
    )
    assert lines(tmp_path, 0.1) == []  # it is found


def test_of_another_version_of_a_kernel_the_line_is_another(tmp_path):
    """As of a recursion, which is compiled for one state and for eight at once."""
    first, second = lines(tmp_path, 0.1, "whole")
    assert second == first.replace("compiling ", "compiling version 2 of ")


def test_the_line_says_why_no_general_kernel_does_instead(tmp_path):
    [line] = lines(tmp_path, 0.1, "foreign")
    assert line.endswith(f"kept in {tmp_path} (no general kernel can be taken: they are for another processor)")


def test_a_fast_one_is_not(tmp_path):
    assert lines(tmp_path, 100.0) == []


def test_the_logger_silences_it(tmp_path):
    assert lines(tmp_path, 0.1, "silent") == []


def test_where_nothing_is_kept_the_line_says_so(monkeypatch, caplog):
    progress.unfit()  # which takes its time once, on a loaded machine longer than the line is waited for
    monkeypatch.setattr(progress, "AFTER", 0.01)
    with caplog.at_level(logging.WARNING, "flexmb.jit"), announced(lines, None):
        time.sleep(0.3)
    [record] = caplog.records
    assert "in every process: no folder is writable" in record.getMessage()


def test_an_error_ends_the_watch(monkeypatch, caplog):
    monkeypatch.setattr(progress, "AFTER", 0.2)
    with caplog.at_level(logging.WARNING, "flexmb.jit"):
        try:
            with announced(lines, None):
                raise ValueError
        except ValueError:
            time.sleep(0.4)
        assert caplog.records == []
        with announced(lines, None):
            time.sleep(0.4)
    assert len(caplog.records) == 1


def test_of_what_is_compiled_on_the_way_nothing_is_said(monkeypatch, caplog):
    """A kernel that a kernel calls; in another thread there may be one that somebody waits for."""
    monkeypatch.setattr(progress, "AFTER", 0.01)
    with caplog.at_level(logging.WARNING, "flexmb.jit"), announced(lines, None), announced(announced, None):
        time.sleep(0.3)
    [record] = caplog.records
    assert "test_progress.lines" in record.getMessage()
    with caplog.at_level(logging.WARNING, "flexmb.jit"), announced(announced, None):
        time.sleep(0.3)
    assert "progress.announced" in caplog.records[-1].getMessage()


def test_time_is_that_of_the_kernel_alone(monkeypatch):
    """Without what it calls, which has an entry of its own; what failed counts too."""
    monkeypatch.setattr(progress, "spent", spent := {})
    with announced(lines, None), suppress(ValueError):
        busy(0.02)
        with announced(busy, None):
            busy(0.1)
            raise ValueError
    assert spent["tests.flexmb.jit.test_progress.lines"] < 0.08 < spent["tests.flexmb.jit.test_progress.busy"]


def busy(seconds: float) -> None:
    start = time.thread_time()
    while time.thread_time() < start + seconds:
        pass


def test_a_process_that_only_compiles_tells_nobody_of_locks(monkeypatch) -> None:
    """Negative control: otherwise who listens is told."""

    def told() -> bool:
        with event.install_recorder("numba:compiler_lock") as recorder:
            njit(lambda x: x + 1)(1)
        return bool(recorder.buffer)

    monkeypatch.setattr(event, "start_event", event.start_event)
    monkeypatch.setattr(event, "end_event", event.end_event)
    assert told()
    progress.unheard()
    assert not told()
