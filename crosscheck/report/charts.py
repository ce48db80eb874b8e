"""The data of the charts and the animation of a case's page.

Signals are thinned and stored once each (see store.py); distances and drifts are computed here in double precision, and
thinned by taking the largest of each bin so that no peak is lost. templates/charts.js draws them.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from crosscheck.judging.against_reference import REFERENCE
from crosscheck.judging.case_verdicts import drift_of
from crosscheck.judging.question import SYMBOL
from crosscheck.judging.results import CaseResults, Result
from crosscheck.judging.verdict import Verdict
from crosscheck.library.channels import CONSERVED, KINDS
from crosscheck.report.animation import animations
from crosscheck.report.workprecision import WorkPrecision, work_precision
from flexmb.output.printable import printable
from flexmb.run.channels import distance, family, matches, norms, signal_range, unit
from flexmb.typing import Real
from flexmb.view.store import Store

COMPONENTS = {1: [""], 2: ["1", "2"], 3: ["x", "y", "z"], 4: ["w", "x", "y", "z"]}
RUNAWAY = 20.0  # ratio of two signals beyond which the larger one does not determine the scale
STRAIGHT = 100.0  # limits of a channel that is zero but for rounding, over the bound of that
STILL, BAND = 1e-3, 0.05  # a signal whose range is below this part of its size counts as constant; its drawn band


def payload(case: CaseResults, verdicts: list[Verdict]) -> dict[str, Any]:
    """The data for the scripts of a case's page: panels, drifts, charts, animations, and their series."""
    store = Store()
    return {
        "panels": _panels(store, case, verdicts),
        "drifts": _drifts(store, case),
        "work": [_work(chart) for item in case.case.run.charts if (chart := work_precision(case, item)) is not None],
        "animations": animations(store, case),
        "series": store.packed(),
    }


def _panels(store: Store, case: CaseResults, verdicts: list[Verdict]) -> list[dict[str, Any]]:
    """One panel for each comparison and kind of channel; each has a choice of channels."""
    groups: dict[str, dict[str, list[Verdict]]] = {}
    for verdict in verdicts:
        if verdict.kind == "comparison" and verdict.engine_b != REFERENCE:  # the reference has no run to draw
            for channel in _drawn(case, verdict):
                groups.setdefault(verdict.comparison, {}).setdefault(channel, []).append(verdict)
    panels = []
    for name, channels in groups.items():
        for kind in KINDS:
            chosen = {key: value for key, value in channels.items() if family(key).partition(".")[0] == kind.name}
            if chosen and kind.panel:
                views = [_channel(store, case, channel, pairs) for channel, pairs in chosen.items()]
                whose = {"comparison": printable(name), "title": kind.panel}
                panels.append({**whose, "channels": views, "first": _first(views)})
    return panels


def _drawn(case: CaseResults, verdict: Verdict) -> list[str]:
    """Channels to draw for a verdict: its own, or those of its pattern if the run did not finish."""
    if verdict.E is not None:
        return [verdict.channel]
    results = [result for result in _sides(case, verdict) if result.runs]
    is_open = case.undetermined(verdict.variant_a, verdict.variant_b)
    stored = {name: packed.shape[1] for result in results for name, packed in result.finest.channels.items()}
    return [
        name
        for name, width in stored.items()
        if matches(verdict.channel, name) and not is_open.is_whole(name, width)
    ]


def _sides(case: CaseResults, verdict: Verdict) -> tuple[Result, Result]:
    return case.get(verdict.variant_a, verdict.engine_a), case.get(verdict.variant_b, verdict.engine_b)


def _first(views: list[dict[str, Any]]) -> int:
    """Number of the channel to show first: the one with the largest range among those of the first channel's kind."""
    alike = [i for i, view in enumerate(views) if family(view["name"]) == family(views[0]["name"])]
    still = all(views[i]["size"] == 0.0 for i in alike)
    return max(range(len(views)) if still else alike, key=lambda i: views[i]["size"])


def _channel(store: Store, case: CaseResults, channel: str, pairs: list[Verdict]) -> dict[str, Any]:
    """All sides of a channel in its determined components, and for each judged pair distance and uncertainty over time
    (SI)."""
    sides: dict[tuple[str, str], Result] = {}
    for verdict in pairs:
        for result in _sides(case, verdict):
            if result.runs and channel in result.finest.channels:
                sides[result.variant, result.engine] = result
    several = len({variant for variant, _ in sides}) > 1
    width = next(iter(sides.values())).values(channel).shape[1]
    drawn = ~case.undetermined(*(variant for variant, _ in sides)).flags(channel, width)
    names = COMPONENTS.get(width, [str(i + 1) for i in range(width)])
    curves = {key: _shown(channel, result.values(channel)[:, drawn]) for key, result in sides.items()}
    return {
        "name": channel,
        "unit": unit(channel),
        "components": ["norm"] if channel in SYMBOL else [names[i] for i in np.flatnonzero(drawn)],
        "size": min(signal_range(channel, result.values(channel)) for result in sides.values()),
        "events": sorted({t for result in sides.values() for _, t in result.finest.events}),
        "range": _shown_range(list(curves.values()), max(result.floor(channel) for result in sides.values())),
        "sides": [
            {
                "label": _label(result, several),
                "engine": result.engine,
                "times": store.times(result.times),
                "values": store.samples(curves[key]),
            }
            for key, result in sides.items()
        ],
        "pairs": [_pair(store, case, channel, verdict) for verdict in pairs if verdict.E is not None],
    }


def _shown(channel: str, values: Real) -> Real:
    """The curves (T, k) of a channel: of a matrix its norm, as its verdict names the entry that differs most."""
    return norms(values)[:, None] if channel in SYMBOL else values


def _pair(store: Store, case: CaseResults, channel: str, verdict: Verdict) -> dict[str, Any]:
    a, b = _sides(case, verdict)
    across = a.variant != b.variant
    doubt = a.doubt(channel, across).envelope + b.doubt(channel, across).envelope
    return {
        "a": _label(a, across),
        "b": _label(b, across),
        "times": store.times(a.times),
        "error": store.peaks(distance(channel, a.values(channel), b.values(channel))),
        "doubt": store.peaks(doubt),
    }


def _shown_range(signals: list[Real], rounding: float) -> list[float] | None:
    """Limits of the drawing if the automatic ones would be misleading, else None.

    If all signals are within the `rounding` of their arithmetic: limits between which they are straight lines. If one
    is much larger: twice the smallest signal. If all are constant: a band about them, not their round-off."""
    sizes = [float(np.max(np.abs(values))) for values in signals]
    smallest, largest = min(sizes), max(sizes)
    if 0.0 < largest <= rounding:
        return [-STRAIGHT * rounding, STRAIGHT * rounding]
    if 0.0 < smallest < largest / RUNAWAY:
        return [-2.0 * smallest, 2.0 * smallest]
    low, high = min(float(np.min(values)) for values in signals), max(float(np.max(values)) for values in signals)
    if high - low < STILL * largest:
        return [low - BAND * largest, high + BAND * largest]
    return None


def _drifts(store: Store, case: CaseResults) -> list[dict[str, Any]]:
    """Drift of energy (less work) and of momentum of the variants that claim to conserve them, relative."""
    drifts = []
    for item in case.case.run.conservations:
        curves = []
        for engine in item.engines:
            result = case.get(item.variant, engine)
            channel = CONSERVED[item.quantity]
            if channel not in result.channels:
                continue
            drift, scale = drift_of(result, channel)
            size = item.scale if item.scale is not None else scale
            if size > 0.0:
                values = store.peaks(np.abs(drift) / size)
                curves.append({"engine": engine, "times": store.times(result.times), "values": values})
        if curves:
            title = f"{item.quantity.replace('_', ' ').capitalize()}, {item.variant}"
            drifts.append({"title": title, "limit": item.limit, "curves": curves})
    return drifts


def _work(chart: WorkPrecision) -> dict[str, Any]:
    return {
        "title": chart.title,
        "observable": chart.observable,
        "reference": chart.reference,
        "doubt": chart.reference_uncertainty,
        "scale": chart.scale,
        "unit": unit(chart.observable),
        "points": [asdict(point) for point in chart.points],
    }


def _label(result: Result, several: bool) -> str:
    return f"{result.engine} · {result.variant}" if several else result.engine
