"""Objects that half belong: refused, or without effect. In a process of their own, for they did crash."""

import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from tests.flexmb.system.altered_objects import Kind, faults, of_array


def _run(*options: str) -> tuple[list[str], int]:
    """Faults, and the number of calls."""
    program = [sys.executable, "-W", "ignore", "-m", "tests.flexmb.system.altered_objects", *options]
    done = subprocess.run(program, cwd=Path(__file__).parents[3], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-4000:]
    *found, summary = done.stdout.splitlines()
    return [line for line in found if line], int(summary.split()[0])


def test_altered_objects_are_refused_or_what_they_were():
    """A crash names its place by faulthandler, the last line before it the call."""
    found, count = _run()
    assert not found, "\n".join(found)
    assert count > 1700


@pytest.mark.slow
def test_so_are_they_by_calls_that_take_their_time():
    found, count = _run("--thorough")
    assert not found, "\n".join(found)
    assert count > 6000


@dataclass(frozen=True)
class Row:
    x: np.ndarray


def _failing(row):
    raise AttributeError("no such thing")


@pytest.mark.parametrize(
    ("use", "fault"),
    [(lambda row: float(np.sum(np.ravel(row.x)[:1])) + len(row.x), "another result"), (_failing, "AttributeError")],
)
def test_faults_are_seen(use, fault):
    """Negative controls: a use that takes another number of rows, and one that ends in an error of another kind."""
    sound = Row(np.array([1.0, 2.0]))
    changes = {"x: long": of_array("x")["x: long"]}
    kind = Kind(sound, changes, {"use": lambda row: 3.0 if row is sound else use(row)})
    found = list(faults("Row", kind))
    assert len(found) == 1 and fault in found[0]


def test_a_refusal_says_something():
    def silent(row):
        if len(row.x) != 2:
            raise ValueError
        return 1.0

    kind = Kind(Row(np.zeros(2)), {"short": lambda row: replace(row, x=row.x[:-1])}, {"use": silent})
    assert list(faults("Row", kind)) == ["use(Row, short): refused without a word"]
