"""Speed against accuracy of a whole session, for the first page of the report: all charts of all cases in one.

Times of different cases can be laid over each other once they are relative to their chart's unit of time: the fastest
run whose error is at most `REACHED`, or, where none is as accurate, the most accurate one. It is drawn by
`templates/speed.js`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from statistics import median
from typing import Any

from crosscheck.judging.results import CaseResults, Session
from crosscheck.library.efforts import TARGETS, WITHIN, is_met
from crosscheck.report.html import CasePlace
from crosscheck.report.workprecision import Point, WorkPrecision, work_precision

REACHED = 1e-6
LEVELS = (1e-2, 1e-3, 1e-4, REACHED, 1e-9)  # errors at which engines are compared in the table


@dataclass(frozen=True)
class ChartOfCase:
    """A chart with its case: `link` leads from the index to it, `unit_s` is the time that others are relative to."""

    family: str
    case: str
    link: str
    chart: WorkPrecision
    unit_s: float

    @property
    def name(self) -> str:
        return f"{self.case}: {self.chart.title}"


@dataclass(frozen=True)
class Standing:
    """An engine at one level of error: its median time relative to the fastest engine of each chart (None if it never
    was as accurate), the charts in which it was, in how many of them it was the fastest, and in how many it has a run
    that is not more than ten times as accurate: in the others it is *at most* so slow."""

    ratio: float | None
    reached: int
    first: int
    met: int = 0


@dataclass(frozen=True)
class EngineRow:
    engine: str
    charts: int
    standings: tuple[Standing, ...]  # one for each of `LEVELS`


@dataclass(frozen=True)
class SpeedView:
    charts: tuple[ChartOfCase, ...]
    rows: tuple[EngineRow, ...]

    @property
    def families(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(chart.family for chart in self.charts))

    @property
    def data(self) -> dict[str, Any]:
        """What the script needs."""
        engines = [row.engine for row in self.rows]
        return {"reached": REACHED, "engines": engines, "charts": [_drawn(chart) for chart in self.charts]}


def speed_view(session: Session, places: Mapping[str, CasePlace]) -> SpeedView:
    """All charts of a session in which something can be drawn, and how the engines stand in them."""
    charts = []
    for case in session.cases:
        for asked in case.case.run.charts:
            if asked.engines:  # of models, and no comparison of engines
                continue
            chart = work_precision(case, asked)
            unit = None if chart is None else unit_of_time(chart)
            if chart is not None and unit is not None:
                family = case.case.case.rpartition("/")[0].rpartition("/")[2].replace("_", " ") or "cases"
                link = places[case.case.case].link("speed")
                charts.append(ChartOfCase(family.capitalize(), case.case.run.title, link, chart, unit))
    return SpeedView(tuple(charts), tuple(_rows([chart.chart for chart in charts])))


def unit_of_time(chart: WorkPrecision) -> float | None:
    """Wall time of the fastest run with an error of at most `REACHED`, else of the most accurate one; None if no run
    with an error took any time."""
    drawn = [(point.error, point.wall_s) for point in chart.points if point.error is not None and point.wall_s > 0.0]
    if not drawn:
        return None
    enough = max(REACHED, min(error for error, _ in drawn))
    return min(seconds for error, seconds in drawn if error <= enough)


def _drawn(each: ChartOfCase) -> dict[str, Any]:
    """A chart for the script: what is below the uncertainty of the reference is shown there, and runs without an error
    only on the page of their case."""
    chart = each.chart
    points = [
        {
            "engine": point.engine,
            "variant": point.variant,
            "method": point.method,
            "effort": point.effort,
            "wall_s": point.wall_s,
            "error": max(point.error, chart.reference_uncertainty),
            "best": point.best,
        }
        for point in chart.points
        if point.error is not None and max(point.error, chart.reference_uncertainty) > 0.0 and point.wall_s > 0.0
    ]
    about = {"family": each.family, "name": each.name, "link": each.link, "unit_s": each.unit_s}
    return {**about, "reference": chart.reference, "doubt": chart.reference_uncertainty, "points": points}


def _rows(charts: Iterable[WorkPrecision]) -> list[EngineRow]:
    """Engines by the number of charts in which they reach `REACHED`, the most first."""
    found: dict[str, list[WorkPrecision]] = {}
    for chart in charts:
        for engine in dict.fromkeys(point.engine for point in chart.points):
            found.setdefault(engine, []).append(chart)
    rows = [
        EngineRow(engine, len(group), tuple(standing(group, engine, error) for error in LEVELS))
        for engine, group in found.items()
    ]
    return sorted(rows, key=lambda row: (-row.standings[LEVELS.index(REACHED)].reached, -row.charts))


def standing(charts: Iterable[WorkPrecision], engine: str, error: float) -> Standing:
    """How an engine stands at one level of error."""
    ratios, met = [], 0
    for chart in charts:
        times = fastest(chart, error)
        if engine in times:
            ratios.append(times[engine] / min(times.values()))
            met += any(point.engine == engine and meets(chart, point, error) for point in chart.points)
    first = sum(ratio == 1.0 for ratio in ratios)
    return Standing(median(ratios) if ratios else None, len(ratios), first, met)


def meets(chart: WorkPrecision, point: Point, target: float) -> bool:
    """Whether a run is as accurate as a target and at most ten times more so, as far as the reference can tell."""
    return point.error is not None and is_met(max(point.error, chart.reference_uncertainty), target)


@dataclass(frozen=True)
class ErrorCost:
    """What an error costs: the time (s) of the fastest run that is as accurate, None if none is; `most` where all of
    these are more than ten times as accurate, so that a coarser effort may be faster."""

    solve_s: float | None
    most: bool = False


@dataclass(frozen=True)
class SpeedRow:
    """An engine on a variant in a chart: a cell for each of the targets, and why some are not met."""

    engine: str
    variant: str
    cells: tuple[ErrorCost, ...]
    why: str


@dataclass(frozen=True)
class SpeedTable:
    """What each target error costs in one chart; targets that the reference cannot tell are left out."""

    title: str
    targets: tuple[float, ...]
    rows: tuple[SpeedRow, ...]


def speed_tables(case: CaseResults) -> list[SpeedTable]:
    """The tables of a case, one for each of its charts."""
    drawn = (work_precision(case, asked) for asked in case.case.run.charts)
    return [_table(case, chart) for chart in drawn if chart is not None]


def _table(case: CaseResults, chart: WorkPrecision) -> SpeedTable:
    targets = tuple(target for target in TARGETS if chart.reference_uncertainty <= target / WITHIN)
    rows = []
    for engine, variant in dict.fromkeys((point.engine, point.variant) for point in chart.points):
        own = [point for point in chart.points if (point.engine, point.variant) == (engine, variant)]
        record = case.charted.get((variant, engine))
        cells = tuple(_cell(chart, own, target) for target in targets)
        rows.append(SpeedRow(engine, variant, cells, "" if record is None else record.message))
    return SpeedTable(chart.title, targets, tuple(rows))


def _cell(chart: WorkPrecision, own: Iterable[Point], target: float) -> ErrorCost:
    enough = [point for point in own if point.error is not None and point.error <= target and point.wall_s > 0.0]
    if not enough:
        return ErrorCost(None)
    met = any(meets(chart, point, target) for point in enough)
    return ErrorCost(min(point.wall_s for point in enough), not met)


def fastest(chart: WorkPrecision, error: float) -> dict[str, float]:
    """For each engine the wall time (s) of its fastest run whose error is at most `error`."""
    times: dict[str, float] = {}
    for point in chart.points:
        if point.error is not None and point.error <= error and point.wall_s > 0.0:
            times[point.engine] = min(times.get(point.engine, point.wall_s), point.wall_s)
    return times
