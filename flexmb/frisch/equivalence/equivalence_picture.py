"""Picture of the comparison of an appendage with spring-hinged rigid models: shape, mismatches, number of modes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from flexmb.frisch.equivalence.comparison import Equivalence
from flexmb.output.files import save_figure
from flexmb.output.printable import chart_text
from flexmb.typing import Real

_SIZE = (12.0, 7.0)  # inches
_RESOLUTION = 120  # dots per inch
_FLOOR = 1e-6  # lower end of the logarithmic axis: smaller mismatches are drawn here
_COLOURS = ("tab:orange", "tab:blue", "tab:green")


def write_equivalence_plot(result: Equivalence, path: Path) -> Path:
    """Write the picture as PNG (or what the suffix says); returns the path."""
    figure = Figure(figsize=_SIZE, layout="constrained")
    grid = figure.add_gridspec(2, 2)
    _shape(result, figure.add_subplot(grid[0, :]))
    _mismatches(result, figure.add_subplot(grid[1, 0]))
    _convergence(result, figure.add_subplot(grid[1, 1]))
    figure.suptitle(chart_text(f"{result.appendage.name}: modes against a rigid body on a spring hinge"))
    for axes in figure.axes:
        axes.grid(alpha=0.3)
        axes.set_axisbelow(True)
    return save_figure(figure, path, dpi=_RESOLUTION)


def _shape(result: Equivalence, axes: Axes) -> None:
    """Velocities of the points in the mode of the first axis, and in the rigid models at their best rates."""
    body = result.appendage
    model, mode = body.model, next(iter(result.fits.values())).modes[0]
    moved = model.translation[:, :, mode]
    along, across = _principal(model.position, model.mass), _principal(moved, model.mass)
    order = np.argsort(model.position @ along)
    s, size = (model.position @ along)[order], float(np.max(np.abs(moved @ across)))
    sign = 1.0 if (moved @ across)[order[-1]] >= 0.0 else -1.0
    axes.plot(s, sign * (moved @ across)[order] / size, "k.", markersize=4, label=f"mode {mode + 1}")
    for (name, fit), colour in zip(result.fits.items(), _COLOURS, strict=False):
        omega = fit.rates[0] @ fit.hinge.axes
        turned = np.cross(omega, model.position - fit.hinge.point)
        axes.plot(s, sign * (turned @ across)[order] / size, color=colour, linewidth=1.2, label=name)
        axes.plot(fit.hinge.point @ along, 0.0, "o", color=colour, markersize=8, markerfacecolor="white")
    axes.axhline(0.0, color="black", linewidth=0.6)
    axes.legend(loc="upper left", fontsize="small")
    axes.set_xlabel(f"position along {_named(along)} from the clamp (m)")
    axes.set_ylabel("velocity over the mode's largest")
    frequency = body.frequencies[mode] / (2.0 * np.pi)
    axes.set_title(f"Mode {mode + 1}, {frequency:.4g} Hz; hinges as circles", fontsize="medium")


def _mismatches(result: Equivalence, axes: Axes) -> None:
    """(149)-(151), root mean square over the axes, for each hinge."""
    width = 0.8 / len(result.fits)
    names: list[str] = []
    for i, ((name, fit), colour) in enumerate(zip(result.fits.items(), _COLOURS, strict=False)):
        squares = np.array([[relation.mismatch**2 for relation in group] for group in fit.relations])
        values = np.sqrt(np.mean(squares, axis=0))
        place = np.arange(3) + (i - (len(result.fits) - 1) / 2) * width
        bars = axes.bar(place, np.maximum(values, _FLOOR), width, color=colour, label=name)
        axes.bar_label(bars, [_short(value) for value in values], fontsize="small", padding=2)
        names = [f"({relation.equation})\n{relation.quantity}" for relation in fit.relations[0]]
    axes.axhline(result.accuracy, color="black", linestyle="--", linewidth=1.0, label="accuracy")
    axes.set_yscale("log")
    axes.set_ylim(_FLOOR, 100.0)  # room for the legend
    axes.set_yticks([1e-6, 1e-4, 1e-2, 1.0], ["0.0001 %", "0.01 %", "1 %", "100 %"])
    axes.legend(loc="upper center", ncols=2, fontsize="small")
    axes.set_xticks(np.arange(3), names, fontsize="small")
    axes.set_ylabel("mismatch, part of the velocity")
    axes.set_title("The three equivalence relations", fontsize="medium")


def _short(value: float) -> str:
    return "~0" if value < _FLOOR else f"{100.0 * value:.2g} %"


def _convergence(result: Equivalence, axes: Axes) -> None:
    """The remainder with N modes, for those motions of the base that excite any mode."""
    count = result.appendage.mode_count
    for direction in result.directions:
        if direction.taking_part(count):
            style = "-" if direction.name.startswith("about") else ":"
            axes.step(np.arange(count + 1), direction.worst, style, where="post", label=direction.name)
    axes.axhline(result.accuracy, color="black", linestyle="--", linewidth=1.0)
    axes.set_yscale("log")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.yaxis.set_major_formatter(lambda value, _: f"{100.0 * value:g} %")
    axes.legend(loc="upper right", fontsize="small")
    axes.set_xlabel("number of modes")
    axes.set_ylabel("missing of the rigid body's")
    axes.set_title("Base turning (largest of inertia and relations) and moving (mass)", fontsize="medium")


def _principal(vectors: Real, mass: Real) -> Real:
    """Direction (3,) in which vectors (p,3) are largest in the mean, towards positive components."""
    direction = np.linalg.eigh(np.einsum("p,pa,pb->ab", mass, vectors, vectors))[1][:, -1]
    return direction if direction[np.argmax(np.abs(direction))] > 0.0 else -direction


def _named(direction: Real) -> str:
    nearest = int(np.argmax(np.abs(direction)))
    return "xyz"[nearest] if direction[nearest] > 1.0 - 1e-9 else "the body"
