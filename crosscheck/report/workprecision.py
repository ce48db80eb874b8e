"""Speed against accuracy: the error of every engine, variant and effort in one observable, against wall time.

One chart has one reference for all: the most certain result of its reference variant, if possible of an engine that
represents the scene exactly. Among results that are equally certain within a factor `RESOLVED`, it is that of the
engine named first. The error of a run is its largest distance from the reference over the run, relative to the
reference's range. The reference cannot judge errors below its own uncertainty; its own finest run is shown at that
uncertainty. Runs that failed have no error and are kept as such.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from crosscheck.judging.results import CaseResults, Result
from crosscheck.library.case import Chart
from crosscheck.records.kinds import RunRecord
from flexmb.run.channels import distance, signal_range

RESOLVED = 2.0  # factor to which estimates of U are accurate


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
    """The chart, or None if no engine finished the reference variant in this observable."""
    reference = _reference(case, chart)
    if reference is None:
        return None
    scale = signal_range(chart.observable, reference.values(chart.observable))
    if scale <= 0.0:
        return None
    doubt = reference.uncertainty(chart.observable).value / scale
    points = [
        _point(run, chart.observable, reference, scale, doubt)
        for (variant, _, role), result in case.results.items()
        if role == "main" and variant in chart.variants
        for run in result.runs
    ]
    return WorkPrecision(
        title=chart.title or f"{chart.observable} of {case.case.run.title}",
        observable=chart.observable,
        reference=f"{reference.engine} on {reference.variant}, {reference.finest.effort}",
        reference_uncertainty=doubt,
        scale=scale,
        points=tuple(_with_front(points, doubt)),
    )


def _reference(case: CaseResults, chart: Chart) -> Result | None:
    """The finished result of the reference variant with the smallest U in the observable, exact engines first."""
    variant = case.case.run.variant(chart.reference)
    found = [case.get(variant.name, engine) for engine in variant.engines]
    finished = [result for result in found if chart.observable in result.channels]
    exact = [result for result in finished if not result.finest.support] or finished
    doubts = [result.uncertainty(chart.observable).value for result in exact]
    close = (result for result, doubt in zip(exact, doubts, strict=True) if doubt <= RESOLVED * min(doubts))
    return next(close, None)


def _point(run: RunRecord, observable: str, reference: Result, scale: float, doubt: float) -> Point:
    error, message = None, run.message
    if run.status == "finished" and observable in run.channels:
        values, target = reference.values(observable, run), reference.values(observable)
        if values.shape == target.shape:
            error = doubt if run is reference.finest else float(np.max(distance(observable, values, target))) / scale
        else:
            message = "its sample times are not those of the reference"
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
    smallest = np.inf
    marked = []
    for point in sorted(points, key=lambda point: point.wall_s):
        error = np.inf if point.error is None else max(point.error, doubt)
        best = error < smallest
        if best:
            smallest = error
        marked.append(replace(point, best=best))
    return marked
