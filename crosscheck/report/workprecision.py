"""Speed against accuracy: the error of every engine, variant and effort in one observable, against wall time.

All runs of a chart have one reference (`crosscheck.judging.chart_reference`), which cannot judge errors below its own
uncertainty; if it is a run of the session, that run is shown there. Besides the runs that are judged there are those
that were made for the chart. Runs that failed have no error and are kept as such.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf

from crosscheck.judging.chart_reference import ChartReference, chart_reference
from crosscheck.judging.results import CaseResults, Result
from crosscheck.library.case import Chart
from crosscheck.library.efforts import on_front
from crosscheck.records.kinds import RunRecord


@dataclass(frozen=True)
class Point:
    """One run: wall time of the solve (s), relative error (None if it failed), whether it is on the Pareto front."""

    engine: str
    variant: str
    effort: str
    method: str
    wall_s: float
    compile_s: float
    evaluations: int
    error: float | None
    message: str
    best: bool = False


@dataclass(frozen=True)
class WorkPrecision:
    """A chart: its points, and the reference with its relative uncertainty and the range (SI) that errors refer to."""

    title: str
    observable: str
    reference: str
    reference_uncertainty: float
    scale: float
    points: tuple[Point, ...]


def work_precision(case: CaseResults, chart: Chart) -> WorkPrecision | None:
    """The chart, or None if there is no reference for this observable of the reference variant."""
    reference = chart_reference(case, chart)
    if reference is None:
        return None
    scale = reference.scale(chart.observable)
    if not scale > 0.0:
        return None
    doubt = reference.uncertainty / scale
    points = [
        _point(run, result, chart.observable, reference)
        for (variant, engine, role), result in case.results.items()
        if role == "main" and chart.shows(variant, engine)
        for run in (*result.runs, *_charted(case, variant, engine))
    ]
    return WorkPrecision(
        title=chart.title or f"{chart.observable} of {case.case.run.title}",
        observable=chart.observable,
        reference=reference.name,
        reference_uncertainty=doubt,
        scale=scale,
        points=tuple(_with_front(points, doubt)),
    )


def _charted(case: CaseResults, variant: str, engine: str) -> tuple[RunRecord, ...]:
    """The runs that were made for the charts, of efforts that are not judged."""
    record = case.charted.get((variant, engine))
    return () if record is None else record.runs


def _point(run: RunRecord, result: Result, observable: str, reference: ChartReference) -> Point:
    error, message = None, run.message
    if run.status == "finished" and observable in run.channels and run.times is not None:
        error = reference.error(result, observable, run)
        if error is None:
            message = "the times of the reference are not among its sample times"
    return Point(
        engine=run.engine,
        variant=run.variant,
        effort=run.effort,
        method=run.effort_method,
        wall_s=run.wall_s,
        compile_s=run.compile_s,
        evaluations=run.evaluations,
        error=error,
        message=message,
    )


def _with_front(points: list[Point], doubt: float) -> list[Point]:
    """The points by wall time; a point is marked `best` if no faster one is known to be as accurate."""
    rising = sorted(points, key=lambda point: point.wall_s)
    best = on_front([(each.wall_s, inf if each.error is None else each.error) for each in rising], doubt)
    return [replace(point, best=is_best) for point, is_best in zip(rising, best, strict=True)]
