"""The files of charts: for each case a folder with pictures, data as JSON and a page; and an index."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache
from itertools import cycle
from pathlib import Path
from typing import Any

import matplotlib
import msgspec
from jinja2 import Environment, PackageLoader
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from crosscheck.records.machine import environment
from crosscheck.timing.chart import CaseCharts, ChartData, ChartPoint
from flexmb.output.files import folder, save_figure, write_whole
from flexmb.output.printable import printable

# The picture of a chart: error against time, a line for each engine and integrator, the front, floor and failures.

# distinguishable with colour blindness
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#7a5c00", "#3f3f8f", "#8c2d04", "#00695c")
MARKERS = "osD^vPX*"
STYLE: dict[Any, Any] = {"svg.hashsalt": "crosscheck", "svg.fonttype": "none", "font.size": 9}
HUGE = 1e30  # a larger relative uncertainty is not drawn as a floor
ZERO_ERROR = 1e-17  # position of an error of zero if there is no floor, below the rounding of numbers


def draw_chart(charts: CaseCharts, chart: ChartData, path: Path) -> None:
    """Write the picture as SVG. Errors below the floor are drawn on it.

    Points without error are named on the right margin.
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(8.0, 5.2), layout="constrained")
        axes = figure.add_subplot()
        axes.set_xscale("log")
        axes.set_yscale("log")
        drawn = [point for point in chart.points if point.error is not None]
        _series(axes, chart, drawn, several_variants=len({point.variant for point in chart.points}) > 1)
        _front(axes, chart, drawn)
        _limits(axes, chart, drawn)
        _floor(axes, chart, drawn)
        _failures(axes, [point for point in chart.points if point.error is None])
        axes.set_xlabel(f"shortest solve in {charts.rounds} rounds [s], bars to the upper quartile")
        axes.set_ylabel(f"largest error up to {charts.horizon_s:g} s, of the signal's size")
        axes.set_title(f"{charts.title}: {chart.observable}", fontsize="medium")
        axes.grid(True, which="major", color="#dddddd", linewidth=0.6)
        axes.set_axisbelow(True)
        figure.legend(loc="outside lower center", ncols=2, fontsize="small")
        save_figure(figure, path, metadata={"Date": None})


def _series(axes: Axes, chart: ChartData, drawn: list[ChartPoint], several_variants: bool) -> None:
    looks = cycle(zip(COLOURS, MARKERS, strict=True))
    for name in dict.fromkeys((point.series, point.variant) for point in drawn):
        colour, marker = next(looks)
        points = [point for point in drawn if (point.series, point.variant) == name]
        points = sorted(points, key=lambda point: point.error or 0.0, reverse=True)
        seconds, errors = [point.solve_s or 0.0 for point in points], [_height(chart, point) for point in points]
        upper = [max(point.quartiles_s[1] - (point.solve_s or 0.0), 0.0) for point in points if point.quartiles_s]
        label = f"{name[0]} ({name[1]})" if several_variants else name[0]
        axes.errorbar(
            seconds, errors, xerr=[[0.0] * len(points), upper], color=colour, marker=marker, markersize=5,
            linewidth=1.0, elinewidth=0.7, label=label,
        )  # fmt: skip
        at = (points[-1].solve_s or 0.0, _height(chart, points[-1]))
        axes.annotate(label, at, (6, 0), textcoords="offset points", va="center", fontsize="small", color=colour)


def _front(axes: Axes, chart: ChartData, drawn: list[ChartPoint]) -> None:
    """The Pareto front as a staircase."""
    best = sorted((point for point in drawn if point.best), key=lambda point: point.solve_s or 0.0)
    seconds, errors = [point.solve_s or 0.0 for point in best], [_height(chart, point) for point in best]
    if best:  # the last step extends to the slowest point
        seconds.append(max(point.solve_s or 0.0 for point in drawn))
        errors.append(errors[-1])
    axes.step(
        seconds, errors, where="post", color="#333333", linewidth=4.0, alpha=0.25, zorder=1, label="Pareto front"
    )


def _floor(axes: Axes, chart: ChartData, drawn: list[ChartPoint]) -> None:
    if not (drawn and _has_floor(chart)):
        return
    axes.axhspan(ZERO_ERROR / 1e3, chart.floor, color="#999999", alpha=0.25, zorder=0, linewidth=0)
    axes.axhline(chart.floor, color="#555555", linewidth=1.0, linestyle="--", label="uncertainty of the reference")


def _limits(axes: Axes, chart: ChartData, drawn: list[ChartPoint]) -> None:
    """Axis limits with a margin around the points and the floor."""
    heights = [_height(chart, point) for point in drawn] or [1e-9, 1.0]
    heights += [chart.floor] if _has_floor(chart) else []
    seconds = [second for point in drawn for second in (point.solve_s, *(point.quartiles_s or ())) if second]
    seconds = seconds or [1e-3, 1.0]
    axes.set(xlim=(min(seconds) / 1.5, 1.5 * max(seconds)), ylim=(min(heights) / 3.0, 3.0 * max(heights)))


def _has_floor(chart: ChartData) -> bool:
    return 0.0 < chart.floor < HUGE


def _failures(axes: Axes, failed: list[ChartPoint]) -> None:
    """Names on the right margin, from the top; the page says why."""
    names = list(dict.fromkeys(f"{point.engine} {point.effort}".strip() for point in failed))
    if names:
        text = "no error to draw:\n" + "\n".join(f"✕ {name}" for name in names)
        axes.annotate(
            text, (1.02, 1.0), xycoords="axes fraction", va="top", ha="left", fontsize="small", color="#a00000"
        )


def _height(chart: ChartData, point: ChartPoint) -> float:
    return max(point.error or 0.0, chart.floor if _has_floor(chart) else ZERO_ERROR)


INDEX, DATA = "index.html", "charts.json"


def write_case(charts: CaseCharts, out: Path) -> Path:
    """Write the pictures, the data and the page of a case below `out`; returns the page."""
    place = folder(out / folder_name(charts.case))
    (place / INDEX).unlink(missing_ok=True)  # an old page must not remain beside new pictures
    pictures = [f"{folder_name(chart.observable)}.svg" for chart in charts.charts]
    for chart, name in zip(charts.charts, pictures, strict=True):
        draw_chart(charts, chart, place / name)
    machine = environment((charts.case,))
    write_whole(place / DATA, msgspec.json.format(msgspec.json.encode({"machine": machine, "charts": charts})))
    drawn = list(zip(charts.charts, pictures, strict=True))
    write_whole(place / INDEX, _page("case.html.j2", charts=charts, drawn=drawn, machine=machine))
    return place / INDEX


def write_index(cases: Sequence[CaseCharts], out: Path) -> Path:
    """Write the index of all cases; returns its path."""
    entries = [(case, folder_name(case.case)) for case in cases]
    write_whole(folder(out) / INDEX, _page("cases.html.j2", entries=entries, machine=environment()))
    return out / INDEX


def folder_name(name: str) -> str:
    """A name that is valid for files and folders on all systems."""
    return re.sub(r"[^\w.-]+", "_", name).strip(".") or "_"


def _page(template: str, **content: Any) -> bytes:
    return _templates().get_template(template).render(**content).encode()


@cache
def _templates() -> Environment:
    """The templates; their output is escaped and has no control characters."""
    return Environment(
        loader=PackageLoader("crosscheck.timing"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=lambda value: printable(value) if type(value) is str else value,
    )
