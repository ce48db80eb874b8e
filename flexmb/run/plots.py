"""The charts of a run as PNG files by matplotlib; `flexmb.run.charts` says what is drawn."""

from __future__ import annotations

from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexmb.output.files import save_figure
from flexmb.output.printable import chart_text
from flexmb.view.charting import Charts, Panel, RunChart

_SIZE = (9.0, 5.5)  # inches
_WIDER = (12.0, 7.0)  # of a chart with two columns
_RESOLUTION = 120  # dots per inch
STYLES = {"": {}, "sum": {"color": "black"}, "applied": {"linestyle": "--"}}
"""Settings of matplotlib by the kind of a curve."""


def write_plots(drawn: Charts, folder: Path) -> list[Path]:
    """Write each chart to a file of its name; returns the paths."""
    return [_write(drawn, chart, folder / f"{chart.name}.png") for chart in drawn.charts]


def _write(drawn: Charts, chart: RunChart, path: Path) -> Path:
    columns = max(map(len, chart.rows))
    figure = Figure(figsize=_SIZE if columns == 1 else _WIDER, layout="constrained")
    grid = figure.subplots(len(chart.rows), columns, sharex=True, squeeze=False)
    panels = list(zip(grid.ravel(), chart.panels, strict=True))
    for axes, panel in panels:
        _draw(axes, panel, drawn)
    if len({tuple(curve.name for curve in panel.curves) for panel in chart.panels}) == 1:  # one legend tells them all
        figure.legend(*grid[0, 0].get_legend_handles_labels(), fontsize="small", loc="outside right upper")
    else:
        for axes, _ in panels:
            axes.legend(fontsize="small", loc="best")
    figure.suptitle(chart_text("\n".join(filter(None, (drawn.title, chart.note)))), fontsize="medium")
    for axes in grid[-1]:
        axes.set_xlabel("t (s)")
    return save_figure(figure, path, dpi=_RESOLUTION)


def _draw(axes: Axes, panel: Panel, drawn: Charts) -> None:
    axes.set_ylabel(panel.label)
    for curve in panel.curves:
        if curve.shown:
            axes.plot(drawn.t, curve.values, label=chart_text(curve.name), **STYLES[curve.kind])
    times = [event.t for event in drawn.events]
    if times:
        across = axes.get_xaxis_transform()
        axes.vlines(times, 0.0, 1.0, transform=across, colors="0.5", linewidth=0.8, linestyle=":", label="event")
    axes.grid(alpha=0.3)
