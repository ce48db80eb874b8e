"""Error against time: every engine over its ladder of efforts, per observable, with the Pareto front of each.

Besides the efforts that are judged, each engine has those that meet target errors (`crosscheck.running.tuned`).
Errors are distances from `reference.csv` up to its horizon, relative to the signal's size, of the timed solves
themselves. Errors below the reference's own uncertainty, the floor, cannot be distinguished: only their times count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf

import numpy as np

from crosscheck.engines.registry import PROVIDER
from crosscheck.library.case import CaseError
from crosscheck.library.efforts import on_front
from crosscheck.library.find import Case
from crosscheck.running.scheduler import Limits
from crosscheck.running.sweep import Listener
from crosscheck.timing.rivals import EngineFacts, Rival, Rivals, Rung, chart_channels, facts_of, find_rivals, timed
from crosscheck.timing.turns import Timed

ROUNDS = 5


@dataclass(frozen=True)
class ChartPoint:
    """One effort of a rival in one observable: the shortest solve (s) and the relative error, or why it has none.

    `quartiles_s` are of the solves. `best`: no faster point is as accurate, errors below the floor counting as equal.
    """

    variant: str
    engine: str
    integrator: str
    effort: str
    solve_s: float | None
    quartiles_s: tuple[float, float] | None
    error: float | None
    message: str = ""
    best: bool = False

    @property
    def series(self) -> str:
        """The name of its line in the chart."""
        return f"{self.engine}, {self.integrator}" if self.integrator else self.engine


@dataclass(frozen=True)
class ChartData:
    """One chart: an observable, the relative uncertainty of its reference, and all points, also those without error."""

    observable: str
    floor: float
    points: tuple[ChartPoint, ...]


@dataclass(frozen=True)
class CaseCharts:
    """The charts of a case, and for each rival its verdict on the reference. `problem` says why there are no charts."""

    case: str
    title: str
    variant: str
    horizon_s: float
    rounds: int
    charts: tuple[ChartData, ...] = ()
    verdicts: tuple[tuple[str, str, str], ...] = ()
    facts: tuple[tuple[str, EngineFacts], ...] = ()
    problem: str = ""


def chart(
    case: Case,
    engines: Sequence[str],
    variants: Sequence[str],
    *,
    rounds: int = ROUNDS,
    provider: str = PROVIDER,
    limits: Limits,
    listener: Listener = lambda jobs, event: None,
) -> CaseCharts:
    """Run, judge and time all efforts of a case. Problems are part of the result; nothing is raised."""
    try:
        rivals = find_rivals(
            case, engines, variants, provider=provider, limits=limits, listener=listener, charted=True
        )
        observables = _observables(case, rivals)
    except CaseError as error:
        return CaseCharts(case.name, case.run.title, "", 0.0, rounds, problem=str(error))
    finished = ((rival, rung) for rival in rivals.found for rung in rival.rungs if rung.status == "finished")
    times = timed(finished, rounds)
    return CaseCharts(
        case=case.name,
        title=case.run.title,
        variant=rivals.variant,
        horizon_s=float(rivals.reference.times[-1]),
        rounds=rounds,
        charts=tuple(_chart(name, rivals, times) for name in observables),
        verdicts=tuple((rival.name, rival.status, rival.reason) for rival in rivals.found),
        facts=tuple(facts_of(rivals.engines, provider).items()),
    )


def _observables(case: Case, rivals: Rivals) -> list[str]:
    """The judged observables of the case's charts; if there are none, the first judged channel."""
    judged = list(dict.fromkeys(name for rival in rivals.found for name in rival.scales))
    if not judged:
        raise CaseError(f"{case.name}: no engine finished, so that there is nothing to draw: {_first(rivals)}")
    return chart_channels(case, judged)


def _first(rivals: Rivals) -> str:
    return "; ".join(f"{rival.name} {rival.status}: {rival.reason}" for rival in rivals.found[:1])


def _chart(observable: str, rivals: Rivals, times: dict[int, Timed]) -> ChartData:
    scale = next(rival.scales[observable] for rival in rivals.found if observable in rival.scales)
    floor = rivals.reference.uncertainties.get(observable, inf) / scale
    points = []
    for rival in rivals.found:
        if not rival.rungs:
            points.append(_without(rival, None, f"{rival.status}: {rival.reason}"))
        for rung in rival.rungs:
            points.append(_point(observable, rival, rung, times.get(id(rung)), rivals))
    return ChartData(observable, floor, tuple(with_front(points, floor)))


def _point(observable: str, rival: Rival, rung: Rung, measured: Timed | None, rivals: Rivals) -> ChartPoint:
    if measured is None:
        return _without(rival, rung, f"{rung.status}: {rung.message}")
    if measured.failure or measured.first is None or not measured.samples:
        return _without(rival, rung, measured.failure or "it was not timed")
    errors = rival.errors(measured.first.times, measured.first.channels, rivals.reference)
    if observable not in errors:
        return _without(rival, rung, f"it does not offer {observable}, or not at the reference's times")
    if not errors[observable] < inf:
        return _without(rival, rung, "its error is no number")
    solves = [sample.solve_s for sample in measured.samples]
    return ChartPoint(
        variant=rival.job.variant,
        engine=rival.job.engine,
        integrator=rung.effort.method,
        effort=rung.effort.label,
        solve_s=min(solves),
        quartiles_s=(float(np.quantile(solves, 0.25)), float(np.quantile(solves, 0.75))),
        error=errors[observable],
    )


def _without(rival: Rival, rung: Rung | None, message: str) -> ChartPoint:
    """A point without error, for the margin of the chart."""
    method, label = (rung.effort.method, rung.effort.label) if rung is not None else ("", "")
    return ChartPoint(rival.job.variant, rival.job.engine, method, label, None, None, None, message)


def with_front(points: Sequence[ChartPoint], floor: float) -> list[ChartPoint]:
    """The same points, with `best` set for those on the Pareto front; errors below the floor count as equal."""
    runs = [(inf, inf) if each.solve_s is None or each.error is None else (each.solve_s, each.error) for each in points]
    return [replace(point, best=best) for point, best in zip(points, on_front(runs, floor), strict=True)]
