"""All rows of the table of what must hold, in the order of the page."""

from __future__ import annotations

from functools import cache

from tests.benchmarks.must_hold import (
    charts,
    derivatives,
    evaluation,
    exact,
    exact_runs,
    first_use,
    floating_frames,
    growth,
    implicit,
    missions,
    modes,
    runs,
    runs_at_equal_error,
    sensitivity,
    start,
)
from tests.benchmarks.must_hold.row import Row

SOURCES = (
    evaluation, derivatives, runs, runs_at_equal_error, missions, sensitivity, implicit, modes, floating_frames, exact,
    exact_runs, growth, charts, start, first_use,
)  # fmt: skip


@cache
def all_rows() -> dict[str, Row]:
    """By name."""
    rows = [row for source in SOURCES for row in source.rows()]
    found = {row.name: row for row in rows}
    assert len(found) == len(rows), "two rows of one name"
    return found
