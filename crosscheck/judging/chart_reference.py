"""The reference of a chart of speed against accuracy: the best known one, the same for all of its runs.

That is the stored reference of the case where it holds the observable of the reference variant, for it stands on
independent routes (a closed form, several codes), while the estimate of a single engine knows nothing of an error that
all its efforts share; it must be certain to `STORED`, or as certain as the best result of the session. Otherwise it is
the most certain result of the reference variant, if possible of an engine that represents the scene exactly, and among
results that are equally certain within a factor `RESOLVED` that of another code before our own. The error of a run is
its largest distance from the reference over the times of the reference, relative to the reference's range.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crosscheck.engines.registry import OWN_CODE
from crosscheck.judging.against_reference import of_record, shared_times
from crosscheck.judging.results import CaseResults, Result
from crosscheck.library.case import Chart
from crosscheck.library.channels import relative_error
from crosscheck.records.kinds import RunRecord
from crosscheck.records.packing import unpack
from flexmb.run.channels import signal_range
from flexmb.typing import Real

RESOLVED = 2.0  # factor to which estimates of U are accurate
STORED = 1e-9  # relative uncertainty up to which a stored reference is taken whatever the session's runs estimate
CLOSED_FORM = "exact.py"  # how a route by a closed form begins (`crosscheck.references.routes`)


@dataclass(frozen=True)
class ChartReference:
    """What errors refer to: `values` (T, k) at `times` (T,), with their uncertainty (SI); the `run`, if it is one."""

    name: str
    times: Real
    values: Real
    uncertainty: float
    run: RunRecord | None = None

    def scale(self, observable: str) -> float:
        """The range (SI) that errors are relative to; 0 where nothing moves."""
        return signal_range(observable, self.values)

    def error(self, result: Result, observable: str, run: RunRecord) -> float | None:
        """The relative error of a run of a result; None if the times of the reference are not among its samples."""
        assert run.times is not None
        places = shared_times(self.times, unpack(run.times))
        if places is None:
            return None
        scale = self.scale(observable)
        if run is self.run:
            return self.uncertainty / scale
        return relative_error(observable, result.values(observable, run)[places], self.values, scale)


def chart_reference(case: CaseResults, chart: Chart) -> ChartReference | None:
    """The best known reference of a chart."""
    stored, best = _stored(case, chart), _most_certain(case, chart)
    if stored is None or best is None:
        return stored or best
    least = STORED * stored.scale(chart.observable)
    return stored if stored.uncertainty <= max(least, best.uncertainty) else best


def _stored(case: CaseResults, chart: Chart) -> ChartReference | None:
    """The stored reference of the case, if it holds the observable of the reference variant."""
    recorded, observable = case.case.reference, chart.observable
    if recorded is None or recorded.fault or recorded.variant != chart.reference:
        return None
    signals = of_record(recorded)
    if observable not in signals.channels or not np.isfinite(signals.uncertainties.get(observable, np.inf)):
        return None
    name = f"the stored reference{_by(recorded.routes)}"
    return ChartReference(name, signals.times, signals.channels[observable], signals.uncertainties[observable])


def _by(routes: tuple[str, ...]) -> str:
    """Who made a stored reference: a route is a name, a comma and its efforts."""
    names = ["closed form" if route.startswith(CLOSED_FORM) else route.partition(",")[0] for route in routes]
    return f" ({', '.join(dict.fromkeys(names))})" if names else ""


def _most_certain(case: CaseResults, chart: Chart) -> ChartReference | None:
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
    return ChartReference(name, best.times, best.values(chart.observable), doubt, best.finest)
