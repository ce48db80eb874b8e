"""The picture of a map: every cell in the colour of its class or status, the overlay as a line, the verdict below."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator, NullFormatter

from crosscheck.stability.boundary import label
from crosscheck.stability.map import Axis, StabilityMap
from crosscheck.stability.run import Finished
from flexmb.output.files import save_figure

STATUSES = {"failed": "#756bb1", "did not finish": "#fdd835", "did not run": "#969696"}
LINE_POINTS = 400
FEW_DECADES = 60.0  # ratio of an axis's ends below which its ticks are plain numbers
NUMBERED = (1.0, 2.0, 5.0)  # of a decade: more would be printed over each other
STYLE = {"svg.hashsalt": "crosscheck", "svg.fonttype": "none", "font.size": 9}


def draw(done: Finished, path: Path) -> Path:
    """Write the picture (SVG with the cells as an image in it, or what the suffix says); returns the path."""
    what = done.map
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 4.8), layout="constrained")
        axes = figure.add_subplot()
        _cells(axes, done)
        _overlay(axes, what)
        _frame(axes, what)
        _legend(figure, done)
        return save_figure(figure, path, dpi=150, metadata={"Date": None} if path.suffix == ".svg" else None)


def _cells(axes: Axes, done: Finished) -> None:
    what, mesh = done.map, done.mesh
    colours = {kind.name: kind.colour for kind in what.kinds} | STATUSES
    shapes, fills = [], []
    for cell in mesh.labels:
        left, right = what.x.edges(cell.level)[cell.i : cell.i + 2]
        low, high = what.y.edges(cell.level)[cell.j : cell.j + 2]
        shapes.append([(left, low), (right, low), (right, high), (left, high)])
        fills.append(colours[label(what, done.records[cell])])
    axes.add_collection(
        PolyCollection(shapes, facecolors=fills, edgecolors="white", linewidths=0.25, rasterized=True, zorder=1)
    )


def _overlay(axes: Axes, what: StabilityMap) -> None:
    """The line where the prediction passes its levels; with categories a stroke across the row for each passage."""
    style = {"colors": "black", "linewidths": 1.6, "linestyles": "dashed" if what.overlay.bound else "solid"}
    fractions = (np.arange(LINE_POINTS) + 0.5) / LINE_POINTS
    if not (what.x.categories or what.y.categories):
        x, y = np.meshgrid(what.x.values(fractions), what.y.values(fractions))
        values = np.clip(what.overlay.predict(x, y), -1e300, 1e300)
        axes.contour(x, y, values, levels=what.overlay.levels, zorder=2, **style)
        return
    rows, along = (what.y, what.x) if what.y.categories else (what.x, what.y)
    strokes = axes.vlines if what.y.categories else axes.hlines
    fine = along.values(fractions)
    for row in range(rows.cells):
        across = np.full(LINE_POINTS, float(row))
        classes = what.overlay.classes(fine, across) if what.y.categories else what.overlay.classes(across, fine)
        changes = np.flatnonzero(np.diff(classes))
        strokes(0.5 * (fine[changes] + fine[changes + 1]), row - 0.5, row + 0.5, zorder=2, **style)
    for edge in range(1, rows.cells):
        (axes.axhline if what.y.categories else axes.axvline)(edge - 0.5, color="black", linewidth=0.6, zorder=3)


def _frame(axes: Axes, what: StabilityMap) -> None:
    for axis, limits, scale, title in (
        (what.x, axes.set_xlim, axes.set_xscale, axes.set_xlabel),
        (what.y, axes.set_ylim, axes.set_yscale, axes.set_ylabel),
    ):
        if axis.log:
            scale("log")
            if axis.high / axis.low < FEW_DECADES:
                ticks = axes.xaxis if axis is what.x else axes.yaxis
                ticks.set_major_locator(LogLocator(subs=NUMBERED))
                ticks.set_major_formatter("{x:g}")
                ticks.set_minor_formatter(NullFormatter())
        limits(axis.low, axis.high)
        title(axis.label)
    if what.y.categories:
        axes.set_yticks(range(what.y.cells), what.y.categories)
    if what.x.categories:
        axes.set_xticks(range(what.x.cells), what.x.categories)
    axes.set_title(what.title, fontsize="medium")


def _legend(figure: Figure, done: Finished) -> None:
    """Classes and statuses that occur, the overlay, and below it the verdict."""
    what, verdict = done.map, done.verdict
    entries = [Patch(color=kind.colour, label=kind.name) for kind in what.kinds if kind.name in verdict.cells]
    entries += [Patch(color=colour, label=name) for name, colour in STATUSES.items() if name in verdict.cells]
    style = "--" if what.overlay.bound else "-"
    entries.append(Line2D([], [], color="black", linewidth=1.6, linestyle=style, label=what.overlay.name))
    figure.legend(handles=entries, loc="outside lower center", ncols=3, fontsize="small", title=_sentence(done))


def _sentence(done: Finished) -> str:
    verdict, what = done.verdict, done.map
    cells = sum(verdict.cells.values())
    size = " x ".join(_size(axis, verdict.depth) for axis in (what.x, what.y) if not axis.categories)
    outcome = {
        "agree": "no cell exceeds the bound" if what.overlay.bound else "the boundary is within a cell of the line",
        "differ": "the boundary is not where the line is",
        "did not run": "some cells did not run",
    }
    return f"{what.quantity}\n{cells} cells, the finest {size}: {outcome[verdict.status]}"


def _size(axis: Axis, depth: int) -> str:
    edges = axis.edges(depth)
    return f"{100 * (edges[1] / edges[0] - 1):.2g} %" if axis.log else f"{edges[1] - edges[0]:.2g} {axis.unit}".strip()
