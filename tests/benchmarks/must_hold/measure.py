"""Measuring rows: one that fails says why and stops nobody else."""

from __future__ import annotations

import math
import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager

from flexmb.jit.progress import spent
from flexmb.run import beside
from tests.benchmarks.must_hold.kept import Kept, Special, now, this_commit, this_machine
from tests.benchmarks.must_hold.row import Measured, Row

VARIABLE = "FLEXMB_KERNELS"


def measured_row(row: Row, special: bool = False) -> Kept:
    """The row's measurement by what a user gets who sets no variable, or the reason why there is none.

    special: measure it by special kernels, too.
    """
    with _by(None):
        found, failure = _found(row)
    other = None
    if special and found is not None:
        before = sum(spent.values())
        with _by("special"):
            measured, failure = _found(row)
        other = None if measured is None else Special(measured, sum(spent.values()) - before)
    return Kept(row.name, now(), this_commit(), this_machine(), found, failure, "auto", other)


@contextmanager
def _by(kernels: str | None) -> Iterator[None]:
    """Rows take these kernels, or those of the default, whatever this process was told. None are compiled beside: the
    default is measured as it is at once, and what it becomes after a while by special kernels."""
    told, enough = os.environ.pop(VARIABLE, None), beside.ENOUGH
    beside.ENOUGH = math.inf
    if kernels is not None:
        os.environ[VARIABLE] = kernels
    try:
        yield
    finally:
        beside.ENOUGH = enough
        os.environ.pop(VARIABLE, None)
        if told is not None:
            os.environ[VARIABLE] = told


def _found(row: Row) -> tuple[Measured | None, str]:
    try:
        return row.measure(), ""
    except subprocess.CalledProcessError as problem:
        return None, f"exit code {problem.returncode}: {_last_line(problem.stderr or problem.stdout)}"
    except Exception as problem:  # whatever a rival or a missing peer raises: it is what the row has to say
        return None, f"{type(problem).__name__}: {_last_line(str(problem))}"


def _last_line(text: str | None) -> str:
    lines = (text or "").strip().splitlines()
    return lines[-1] if lines else ""
