"""A budget as plain data, for JSON and for pages."""

from __future__ import annotations

from typing import Any

from crosscheck.validation.budget import Budget


def document(budget: Budget) -> dict[str, Any]:
    """Series with their verdicts, and each point with all parts of its budget, in the units of the series."""
    content, sampled = budget.of.content, budget.sampled
    return {
        "title": content.title,
        "sources": list(content.sources),
        "series": [
            {
                "name": verdict.series.name, "unit": verdict.series.unit, "standing": verdict.standing,
                "ok": verdict.ok, "fault": verdict.fault, "points": verdict.points, "within": verdict.within,
                "rms": verdict.rms, "largest": verdict.largest, "u_val": verdict.u_val,
            }
            for verdict in budget.verdicts()
        ],
        "points": [
            {
                "series": point.series, "conditions": dict(point.conditions), "measured": point.measured,
                "predicted": float(budget.predicted[i]), "E": float(budget.error[i]), "u_num": float(budget.u_num[i]),
                "u_input": float(budget.u_input[i]), "u_D": float(budget.u_D[i]), "u_val": float(budget.u_val[i]),
                "within": bool(budget.within[i]),
                "by_input": {each.name: float(budget.by_input[i, k]) for k, each in enumerate(content.inputs)},
            }
            | ({} if sampled is None else {"sampled": float(sampled[i])})
            for i, point in enumerate(budget.of.points)
        ],
    }  # fmt: skip
