"""Measuring rows: one that fails says why and stops nobody else."""

from __future__ import annotations

import subprocess

from tests.benchmarks.must_hold.kept import Kept, now, this_commit, this_machine
from tests.benchmarks.must_hold.row import Row


def measured_row(row: Row) -> Kept:
    """The row's measurement, or the reason why there is none."""
    try:
        found, failure = row.measure(), ""
    except subprocess.CalledProcessError as problem:
        found, failure = None, f"exit code {problem.returncode}: {_last_line(problem.stderr or problem.stdout)}"
    except Exception as problem:  # whatever a rival or a missing peer raises: it is what the row has to say
        found, failure = None, f"{type(problem).__name__}: {_last_line(str(problem))}"
    return Kept(row.name, now(), this_commit(), this_machine(), found, failure)


def _last_line(text: str | None) -> str:
    lines = (text or "").strip().splitlines()
    return lines[-1] if lines else ""
