"""Charts of one run as PNG files, for a first look."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexmb.output.files import save_figure
from flexmb.output.printable import chart_text
from flexmb.run.run_arrays import RunArrays
from flexmb.typing import Real

_SIZE = (9.0, 5.5)  # inches
_RESOLUTION = 120  # dots per inch
ROUNDING = 1e-12  # part of a panel's size: what varies by less is drawn as constant
_MOST = 10  # curves per panel: matplotlib has ten colours, and a longer legend would not fit


def write_plots(trajectory: RunArrays, folder: Path) -> list[Path]:
    """Write charts of markers, energy, momentum, loads and drives, if the run has them; returns the paths.

    Events are marked. Each `draw` returns the size to which rounding in its panels is proportional.
    """
    wanted: dict[str, tuple[Callable[[RunArrays, Figure], float], bool]] = {
        "markers": (_markers, bool(trajectory.markers)),
        "energy": (_energy, True),
        "momentum": (_momentum, True),
        "loads": (_loads, bool(trajectory.loads | trajectory.wheel_loads)),
        "drives": (_drives, bool(trajectory.drives)),
    }
    return [_write(trajectory, folder / f"{name}.png", draw) for name, (draw, present) in wanted.items() if present]


def _write(trajectory: RunArrays, path: Path, draw: Callable[[RunArrays, Figure], float]) -> Path:
    figure = Figure(figsize=_SIZE, layout="constrained")
    size = draw(trajectory, figure)
    stopped = "" if trajectory.finished else f": {trajectory.message.split(':')[0]}"
    figure.suptitle(chart_text(f"{trajectory.scene}{stopped}"))
    for axes in figure.axes:
        _without_rounding(axes, ROUNDING * size)
        _mark(axes, trajectory)
        axes.grid(alpha=0.3)
        if axes.get_legend_handles_labels()[0]:
            axes.legend(fontsize="small", loc="best")
    figure.axes[-1].set_xlabel("t (s)")
    return save_figure(figure, path, dpi=_RESOLUTION)


def _without_rounding(axes: Axes, least: float) -> None:
    """Give axes whose curves together vary by less than `least` limits between which they are straight lines."""
    values = np.concatenate([np.asarray(line.get_ydata(), float) for line in axes.lines] or [np.zeros(1)])
    values = values[np.isfinite(values)]
    if len(values) and np.ptp(values) <= least:
        middle = 0.5 * float(np.min(values) + np.max(values))
        half = max(0.1 * abs(middle), least) or 1.0
        axes.set_ylim(middle - half, middle + half)


def _mark(axes: Axes, trajectory: RunArrays) -> None:
    """A line at each event of the run."""
    times = [event.t for event in trajectory.events]
    if times:
        across = axes.get_xaxis_transform()
        axes.vlines(times, 0.0, 1.0, transform=across, colors="0.5", linewidth=0.8, linestyle=":", label="event")


def _rows(figure: Figure, *labels: str) -> list[Axes]:
    """Panels below each other with a common time axis."""
    panels = list(np.atleast_1d(figure.subplots(len(labels), sharex=True)))
    for panel, label in zip(panels, labels, strict=True):
        panel.set_ylabel(label)
    return panels


def _draw(panel: Axes, t: Real, curves: dict[str, Real], size: Callable[[Real], Any]) -> None:
    """Plot curves by name; of more than `_MOST`, those of the largest `size`, which the panel's title states."""
    sizes = {name: np.nan_to_num(size(values)) for name, values in curves.items()}
    shown = set(sorted(sizes, key=lambda name: -sizes[name])[:_MOST])
    for name, values in curves.items():
        if name in shown:
            panel.plot(t, values, label=chart_text(name))
    if len(shown) < len(curves):
        panel.set_title(f"the {_MOST} largest of {len(curves)}", fontsize="small")


def _markers(trajectory: RunArrays, figure: Figure) -> float:
    for axis, panel in enumerate(_rows(figure, "x (m)", "y (m)", "z (m)")):
        curves = {name: path.position[:, axis] for name, path in trajectory.markers.items()}
        _draw(panel, trajectory.t, curves, np.ptp)  # the largest are those that move farthest
    return _size(*(path.position for path in trajectory.markers.values()))


def _energy(trajectory: RunArrays, figure: Figure) -> float:
    above, below = _rows(figure, "energy (J)", "drift (J)")
    for kind, energy in trajectory.energy.items():
        if np.any(energy):
            above.plot(trajectory.t, energy, label=kind)
    if np.any(trajectory.work):
        above.plot(trajectory.t, trajectory.work, label="work", linestyle="--")
    above.plot(trajectory.t, trajectory.total_energy, label="total", color="black")
    below.plot(trajectory.t, trajectory.energy_drift, label="total - start - work")
    return _size(trajectory.work, *trajectory.energy.values())


def _momentum(trajectory: RunArrays, figure: Figure) -> float:
    for part, panel in enumerate(_rows(figure, "angular (N m s)", "linear (N s)")):
        for axis in range(3):
            panel.plot(trajectory.t, trajectory.momentum[:, 3 * part + axis], label="xyz"[axis])
    moving = np.sqrt(2.0 * np.abs(trajectory.energy["kinetic"]))  # of 1 kg: momenta of parts that cancel leave rounding
    return _size(trajectory.momentum, moving)


def _loads(trajectory: RunArrays, figure: Figure) -> float:
    """Plot magnitudes: components of many hinges in one chart are not legible; the CSV file has them."""
    loads = trajectory.loads | trajectory.wheel_loads
    for part, panel in enumerate(_rows(figure, "|torque| (N m)", "|force| (N)")):
        curves = {name: _magnitude(load[:, 3 * part : 3 * part + 3]) for name, load in loads.items()}
        _draw(panel, trajectory.t, curves, np.max)
    return _size(*loads.values())  # a torque is a force times lengths of about a metre


def _drives(trajectory: RunArrays, figure: Figure) -> float:
    (panel,) = _rows(figure, "drive load (N or N m)")
    curves = {
        name if drive.shape[1] == 1 else f"{name}[{i}]": drive[:, i]
        for name, drive in trajectory.drives.items()
        for i in range(drive.shape[1])
    }
    _draw(panel, trajectory.t, curves, lambda values: np.max(np.abs(values)))
    return _size(*curves.values())


def _size(*values: Real) -> float:
    """The largest absolute value that is finite; 0 where there is none."""
    return max((float(np.max(np.abs(value), initial=0.0, where=np.isfinite(value))) for value in values), default=0.0)


def _magnitude(vectors: Real) -> Real:
    """Norms of vectors (T,3); hypot does not overflow where the squares of a diverging run would."""
    return np.hypot(np.hypot(vectors[:, 0], vectors[:, 1]), vectors[:, 2])
