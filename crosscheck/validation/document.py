"""A budget as plain data, for JSON and for pages."""

from __future__ import annotations

from typing import Any

import numpy as np

from crosscheck.sealed.stamp import stamped
from crosscheck.validation.budget import Budget, SeriesVerdict


def document(budget: Budget) -> dict[str, Any]:
    """Series with their verdicts, inputs, and each point with all parts of its budget, in the units of the series; with
    a stamp, by which it is evidence for a label."""
    content, sampled, verdicts = budget.of.content, budget.sampled, budget.verdicts()
    told = ("title", "physics", "read_from", "instrument", "licence", "digitised", "fitted", "left_out")
    found = {key: getattr(content, key) for key in told} | {
        "sources": list(content.sources),
        "ok": all(verdict.ok for verdict in verdicts),
        "within": int(np.sum(budget.within)),
        "samples": budget.samples,
        "series": [_series(budget, verdict) for verdict in verdicts],
        "inputs": [
            {
                "name": each.name, "value": each.value, "deviation": each.deviation, "unit": each.unit,
                "stated": each.stated, "why": each.why, "derivative": "exact" if exact else "differences",
            }
            for each, exact in zip(content.inputs, budget.exact, strict=True)
        ],
        "identified": _identified(budget),
        "points": [
            {
                "series": point.series, "conditions": dict(point.conditions), "measured": point.measured,
                "predicted": float(budget.predicted[i]), "E": float(budget.error[i]), "u_num": float(budget.u_num[i]),
                "u_input": float(budget.u_input[i]), "u_D": float(budget.u_D[i]), "u_val": float(budget.u_val[i]),
                "within": bool(budget.within[i]), "most_by": budget.most_by(i),
                "by_input": {each.name: float(budget.by_input[i, k]) for k, each in enumerate(content.inputs)},
            }
            | ({} if sampled is None else {"sampled": float(sampled[i])})
            for i, point in enumerate(budget.of.points)
        ],
    }  # fmt: skip
    return stamped(found, budget.of.folder)


def _identified(budget: Budget) -> dict[str, Any] | None:
    """By how many readings which inputs were identified, and what is left there; None where nothing was."""
    found, content = budget.identified, budget.of.content
    if found is None:
        return None
    return {
        "inputs": list(content.fit), "readings": found.readings, "misfit": found.misfit,
        "correlation": found.correlation.tolist(), "horizon": content.split.horizon if content.split else "",
    }  # fmt: skip


def _series(budget: Budget, verdict: SeriesVerdict) -> dict[str, Any]:
    """What a series is, what came out, and the share of each input in its u_input squared."""
    series = verdict.series
    return {
        "name": series.name, "what": series.what, "unit": series.unit, "over": series.over, "by": list(series.by),
        "reading": series.reading, "relative": series.relative, "stated": series.stated, "read_why": series.why,
        "standing": verdict.standing, "reason": series.reason, "ok": verdict.ok, "fault": verdict.fault,
        "points": verdict.points, "within": verdict.within, "rms": verdict.rms, "largest": verdict.largest,
        "u_val": verdict.u_val, "horizon": verdict.horizon, "shares": budget.shares(series.name).tolist(),
    }  # fmt: skip
