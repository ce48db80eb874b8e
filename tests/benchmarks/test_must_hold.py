"""Every row of what must hold as a benchmark of its own; docs/performance.md has the goals and what was measured.

python -m pytest tests/benchmarks/test_must_hold.py -k kernel_10 --benchmark-json FILE
"""

from __future__ import annotations

import pytest

from tests.benchmarks.must_hold.catalogue import all_rows


@pytest.mark.parametrize("name", all_rows())
def test_row(benchmark, name):
    """Red where the goal is missed; the figures are in the benchmark's extra information."""
    row = all_rows()[name]
    try:
        found = benchmark.pedantic(row.measure, rounds=1)
    except ModuleNotFoundError as missing:
        pytest.skip(f"the rival is not installed ({missing.name}): pip install flexmb[peers]")
    benchmark.extra_info.update(value=found.value, low=found.low, high=found.high, goal=row.goal, detail=found.detail)
    assert row.is_met(found.value), f"{row.what}: {found.value:.3g} ({found.detail}), goal {row.sense} {row.goal:g}"
