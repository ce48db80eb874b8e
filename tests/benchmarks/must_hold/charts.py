"""Work-precision charts of the canonical cases: no peer with the same model is faster and as accurate as native."""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from crosscheck.judging.results import collect
from crosscheck.records.archive import read
from crosscheck.report.workprecision import Point, WorkPrecision, work_precision
from tests.benchmarks.must_hold.row import Measured, Row
from tests.benchmarks.must_hold.start import crosscheck, run

PEERS = ("pinocchio", "mujoco", "exudyn")
EXCEPTIONS: dict[str, str] = {}  # "case, title of the chart": why a peer may be ahead there


def rows() -> list[Row]:
    """One for all charts: the number of native points that a peer's point dominates."""
    what = "native points that a peer's point of the same model dominates, all canonical cases"
    return [Row("charts", "Work-precision charts", what, 0.0, _charts, "at most", "points")]


def _charts() -> Measured:
    """By one worker, so that runs do not slow each other; what is compiled before a run is not part of its time.

    With the kernels that `simulate` runs by itself: of crosscheck's general ones there are fewer to compile, but they
    take up to three times as long.
    """
    with tempfile.TemporaryDirectory() as folder:
        run(crosscheck(Path(folder) / "out", "--jobs", "1"), FLEXMB_KERNELS="exact")
        charts = list(_drawn(Path(folder) / "out" / "records.jsonl"))
    if not charts:
        raise ValueError("the records hold no chart")
    found = Counter[str]()
    for case, chart in charts:
        found[f"{case}, {chart.title}"] += sum(1 for _ in dominated(chart))
    behind = [f"{name}: {count}" for name, count in found.items() if count and name not in EXCEPTIONS]
    excused = [f"{name}: {EXCEPTIONS[name]}" for name in found if found[name] and name in EXCEPTIONS]
    total = float(sum(count for name, count in found.items() if name not in EXCEPTIONS))
    return Measured(total, total, total, "; ".join([f"{len(charts)} charts", *behind, *excused]))


def _drawn(records: Path) -> Iterator[tuple[str, WorkPrecision]]:
    for case in collect(read(records)).cases:
        for chart in case.case.run.charts:
            drawn = work_precision(case, chart)
            if drawn is not None:
                yield case.case.case, drawn


def dominated(chart: WorkPrecision) -> Iterator[tuple[Point, Point]]:
    """Native points with a peer's point that is no slower and no less accurate, and better in one of both.

    Errors below the uncertainty of the reference count as that. The same model means the same variant. What failed
    dominates nothing, and a native run that failed is dominated by whatever finished.
    """
    doubt = chart.reference_uncertainty
    for mine in chart.points:
        for other in chart.points:
            if mine.engine != "native" or other.engine not in PEERS or mine.variant != other.variant:
                continue
            if other.error is None:
                continue
            mine_error = float("inf") if mine.error is None else max(mine.error, doubt)
            error = max(other.error, doubt)
            no_worse = error <= mine_error and other.wall_s <= mine.wall_s
            if no_worse and (error < mine_error or other.wall_s < mine.wall_s):
                yield mine, other
                break
