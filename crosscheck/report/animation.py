"""The content of an animation: lines between points that markers carry, and the markers' motion."""

from __future__ import annotations

from typing import Any

from crosscheck.judging.results import CaseResults, Result
from crosscheck.records.drawing import Drawing, Line
from crosscheck.report.store import Store


def animations(store: Store, case: CaseResults) -> list[dict[str, Any]]:
    """One animation for each variant that can be drawn, by the first of its engines whose finest run has samples."""
    found = []
    for variant in case.case.run.variants:
        drawing = case.case.variants[variant.name].drawing
        if drawing is None or not drawing.lines:
            continue
        results = [case.get(variant.name, engine) for engine in variant.engines]
        shown = next((result for result in results if _drawable(result, drawing)), None)
        if shown is not None:
            found.append(_animation(store, shown, drawing))
    return found


def _animation(store: Store, result: Result, drawing: Drawing) -> dict[str, Any]:
    names = _carriers(drawing)
    number = {name: i for i, name in enumerate(names)}
    return {
        "title": f"{result.variant}, by {result.engine}",
        "times": store.times(result.times),
        "markers": [
            {
                "name": name,
                "position": store.signal(result, f"marker:{name}.position"),
                "orientation": store.signal(result, f"marker:{name}.orientation"),
            }
            for name in names
        ],
        "lines": [_line(line, number) for line in drawing.lines],
        "trails": [number[name] for name in drawing.trails if name in number],
    }


def _line(line: Line, number: dict[str, int]) -> dict[str, Any]:
    """A line with its points as [marker number or -1 for the World, x, y, z]."""
    points = [[number.get(point.marker, -1), *point.offset] for point in line.points]
    return {"body": line.body, "kind": line.kind, "points": points}


def _carriers(drawing: Drawing) -> list[str]:
    """Markers that carry a point or leave a trail, each once."""
    carrying = [point.marker for line in drawing.lines for point in line.points if point.marker]
    return list(dict.fromkeys((*carrying, *drawing.trails)))


def _drawable(result: Result, drawing: Drawing) -> bool:
    """Whether the result's last run stored all markers needed; a diverged run is drawn as far as it came."""
    if not result.runs:
        return False
    stored = result.finest.channels
    wanted = (f"marker:{name}.{part}" for name in _carriers(drawing) for part in ("position", "orientation"))
    return all(name in stored for name in wanted)
