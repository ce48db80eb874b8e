"""Speed against accuracy: the error of every engine, variant and effort in one observable, against wall time.

One chart has one reference for all, the best known one. That is the stored reference of the case where it holds the
observable of the reference variant, for it stands on independent routes (a closed form, several codes), while the
estimate of a single engine knows nothing of an error that all its efforts share; it must be certain to `STORED`, or as
certain as the best result of the session. Otherwise it is the most certain result of the reference variant, if possible
of an engine that represents the scene exactly, and among results that are equally certain within a factor `RESOLVED`
that of another code before our own. The error of a run is its largest distance from the reference over the times of the
reference, relative to the reference's range. The reference cannot judge errors below its own uncertainty; if it is a
run of the session, that run is shown there. Runs that failed have no error and are kept as such.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from crosscheck.engines.registry import OWN_CODE
from crosscheck.judging.against_reference import of_record, shared_times
from crosscheck.judging.results import CaseResults, Result
from crosscheck.library.case import Chart
from crosscheck.records.kinds import RunRecord
from crosscheck.records.packing import unpack
from flexmb.run.channels import distance, signal_range
from flexmb.typing import Real

RESOLVED = 2.0  # factor to which estimates of U are accurate
STORED = 1e-9  # relative uncertainty up to which a stored reference is taken whatever the session's runs estimate
CLOSED_FORM = "exact.py"  # how a route by a closed form begins (`crosscheck.references.routes`)


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


@dataclass(frozen=True)
class _Reference:
    """What errors refer to: `values` (T, k) at `times` (T,), with their uncertainty (SI); the `run`, if it is one."""

    name: str
    times: Real
    values: Real
    uncertainty: float
    run: RunRecord | None = None


def work_precision(case: CaseResults, chart: Chart) -> WorkPrecision | None:
    """The chart, or None if there is no reference for this observable of the reference variant."""
    reference = _reference(case, chart)
    if reference is None:
        return None
    scale = signal_range(chart.observable, reference.values)
    if not scale > 0.0:
        return None
    doubt = reference.uncertainty / scale
    points = [
        _point(run, result, chart.observable, reference, scale)
        for (variant, _, role), result in case.results.items()
        if role == "main" and variant in chart.variants
        for run in result.runs
    ]
    return WorkPrecision(
        title=chart.title or f"{chart.observable} of {case.case.run.title}",
        observable=chart.observable,
        reference=reference.name,
        reference_uncertainty=doubt,
        scale=scale,
        points=tuple(_with_front(points, doubt)),
    )


def _reference(case: CaseResults, chart: Chart) -> _Reference | None:
    """The best known reference of a chart."""
    stored, best = _stored(case, chart), _most_certain(case, chart)
    if stored is None or best is None:
        return stored or best
    scale = signal_range(chart.observable, stored.values)
    return stored if stored.uncertainty <= max(STORED * scale, best.uncertainty) else best


def _stored(case: CaseResults, chart: Chart) -> _Reference | None:
    """The stored reference of the case, if it holds the observable of the reference variant."""
    recorded, observable = case.case.reference, chart.observable
    if recorded is None or recorded.fault or recorded.variant != chart.reference:
        return None
    signals = of_record(recorded)
    if observable not in signals.channels or not np.isfinite(signals.uncertainties.get(observable, np.inf)):
        return None
    name = f"the stored reference{_by(recorded.routes)}"
    return _Reference(name, signals.times, signals.channels[observable], signals.uncertainties[observable])


def _by(routes: tuple[str, ...]) -> str:
    """Who made a stored reference: a route is a name, a comma and its efforts."""
    names = ["closed form" if route.startswith(CLOSED_FORM) else route.partition(",")[0] for route in routes]
    return f" ({', '.join(dict.fromkeys(names))})" if names else ""


def _most_certain(case: CaseResults, chart: Chart) -> _Reference | None:
    """The finished result of the reference variant with the smallest U in the observable, exact engines first."""
    variant = case.case.run.variant(chart.reference)
    results = [case.get(variant.name, engine) for engine in variant.engines]
    finished = [result for result in results if chart.observable in result.channels]
    exact = [result for result in finished if not result.finest.support] or finished
    doubts = [result.uncertainty(chart.observable).value for result in exact]
    close = [result for result, doubt in zip(exact, doubts, strict=True) if doubt <= RESOLVED * min(doubts)]
    if not close:
        return None
    best = min(close, key=lambda result: result.engine in OWN_CODE)  # of equals the first
    name = f"{best.engine} on {best.variant}, {best.finest.effort}"
    doubt = best.uncertainty(chart.observable).value
    return _Reference(name, best.times, best.values(chart.observable), doubt, best.finest)


def _point(run: RunRecord, result: Result, observable: str, reference: _Reference, scale: float) -> Point:
    error, message = None, run.message
    if run.status == "finished" and observable in run.channels and run.times is not None:
        places = shared_times(reference.times, unpack(run.times))
        if places is None:
            message = "the times of the reference are not among its sample times"
        elif run is reference.run:
            error = reference.uncertainty / scale
        else:
            values = result.values(observable, run)[places]
            error = float(np.max(distance(observable, values, reference.values))) / scale
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
