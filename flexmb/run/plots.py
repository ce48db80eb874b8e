"""Charts of one run as PNG files, for a first look."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexmb.output.printable import chart_text
from flexmb.output.whole import save_figure
from flexmb.run.run_arrays import RunArrays
from flexmb.typing import Real

_SIZE = (9.0, 5.5)  # inches
_RESOLUTION = 120  # dots per inch
_MOST = 10  # curves per panel: matplotlib has ten colours, and a longer legend would not fit


def write_plots(trajectory: RunArrays, folder: Path) -> list[Path]:
    """Write charts of markers, energy, momentum, loads and drives, if the run has them; returns the paths."""
    wanted: dict[str, tuple[Callable[[RunArrays, Figure], None], bool]] = {
        "markers": (_markers, bool(trajectory.markers)),
        "energy": (_energy, True),
        "momentum": (_momentum, True),
        "loads": (_loads, bool(trajectory.loads | trajectory.wheel_loads)),
        "drives": (_drives, bool(trajectory.drives)),
    }
    return [_write(trajectory, folder / f"{name}.png", draw) for name, (draw, present) in wanted.items() if present]


def _write(trajectory: RunArrays, path: Path, draw: Callable[[RunArrays, Figure], None]) -> Path:
    figure = Figure(figsize=_SIZE, layout="constrained")
    draw(trajectory, figure)
    stopped = "" if trajectory.finished else f": {trajectory.message.split(':')[0]}"
    figure.suptitle(chart_text(f"{trajectory.scene}{stopped}"))
    for axes in figure.axes:
        axes.grid(alpha=0.3)
        if axes.get_legend_handles_labels()[0]:
            axes.legend(fontsize="small", loc="best")
    figure.axes[-1].set_xlabel("t (s)")
    return save_figure(figure, path, dpi=_RESOLUTION)


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


def _markers(trajectory: RunArrays, figure: Figure) -> None:
    for axis, panel in enumerate(_rows(figure, "x (m)", "y (m)", "z (m)")):
        curves = {name: path.position[:, axis] for name, path in trajectory.markers.items()}
        _draw(panel, trajectory.t, curves, np.ptp)  # the largest are those that move farthest


def _energy(trajectory: RunArrays, figure: Figure) -> None:
    above, below = _rows(figure, "energy (J)", "drift (J)")
    for kind, energy in trajectory.energy.items():
        if np.any(energy):
            above.plot(trajectory.t, energy, label=kind)
    if np.any(trajectory.work):
        above.plot(trajectory.t, trajectory.work, label="work", linestyle="--")
    above.plot(trajectory.t, trajectory.total_energy, label="total", color="black")
    below.plot(trajectory.t, trajectory.energy_drift, label="total - start - work")


def _momentum(trajectory: RunArrays, figure: Figure) -> None:
    for part, panel in enumerate(_rows(figure, "angular (N m s)", "linear (N s)")):
        for axis in range(3):
            panel.plot(trajectory.t, trajectory.momentum[:, 3 * part + axis], label="xyz"[axis])


def _loads(trajectory: RunArrays, figure: Figure) -> None:
    """Plot magnitudes: components of many hinges in one chart are not legible; the CSV file has them."""
    loads = trajectory.loads | trajectory.wheel_loads
    for part, panel in enumerate(_rows(figure, "|torque| (N m)", "|force| (N)")):
        curves = {name: _magnitude(load[:, 3 * part : 3 * part + 3]) for name, load in loads.items()}
        _draw(panel, trajectory.t, curves, np.max)


def _drives(trajectory: RunArrays, figure: Figure) -> None:
    (panel,) = _rows(figure, "drive load (N or N m)")
    curves = {
        name if drive.shape[1] == 1 else f"{name}[{i}]": drive[:, i]
        for name, drive in trajectory.drives.items()
        for i in range(drive.shape[1])
    }
    _draw(panel, trajectory.t, curves, lambda values: np.max(np.abs(values)))


def _magnitude(vectors: Real) -> Real:
    """Norms of vectors (T,3); hypot does not overflow where the squares of a diverging run would."""
    return np.hypot(np.hypot(vectors[:, 0], vectors[:, 1]), vectors[:, 2])
