"""Pictures of sampled loops: Bode and Nyquist diagrams of a loop that is opened, and maps of stability."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import SymLogNorm
from matplotlib.figure import Figure

from flexmb.linear.margins import LoopTransfer
from flexmb.output.files import save_figure
from flexmb.output.printable import chart_text
from flexmb.typing import Real

_SIZE = (10.0, 8.0)  # inches
_RESOLUTION = 120  # dots per inch
_REACH = 3.0  # of Nyquist's diagram about the origin
_NEAREST = 1e-4  # distance of a multiplier's size from 1, up to which shades are linear; beyond they are logarithmic


def write_loop_plot(path: Path, scene: str, loop: LoopTransfer) -> Path:
    """Write the picture of a loop: Bode's diagram to half the frequency of the samples, Nyquist's, and multipliers."""
    figure = Figure(figsize=_SIZE, layout="constrained")
    (gain, nyquist), (phase, circle) = figure.subplots(2, 2)
    omega = loop.grid
    values = loop(omega)
    size, known = np.abs(values), np.isfinite(values)
    gain.loglog(omega[known], size[known])
    gain.axhline(1.0, color="black", linewidth=0.6)
    gain.set_ylabel("|L|")
    degrees = np.degrees(np.unwrap(np.angle(values[known])))
    degrees -= 360.0 * np.round((degrees[-1] + 180.0) / 360.0) if len(degrees) else 0.0
    phase.semilogx(omega[known], degrees)
    phase.set_ylabel("phase (degrees)")
    phase.set_xlabel("rad/s")
    for each in loop.gain_crossings:
        for axes in (gain, phase):
            axes.axvline(each.omega, color="tab:orange", linewidth=0.8)
    for each in loop.phase_crossings:
        for axes in (gain, phase):
            axes.axvline(each.omega, color="tab:red", linewidth=0.8, linestyle=":")
    shown = known & (size < 100.0 * _REACH)
    nyquist.plot(values.real[shown], values.imag[shown])
    nyquist.plot(values.real[shown], -values.imag[shown], linewidth=0.6, color="tab:blue", alpha=0.5)
    nyquist.plot([-1.0], [0.0], "+", color="red", markersize=10)
    nyquist.set(xlim=(-_REACH, _REACH), ylim=(-_REACH, _REACH), xlabel="Re L", ylabel="Im L")
    circle.plot(loop.closed.real, loop.closed.imag, "x")
    circle.set(xlabel="Re", ylabel="Im", title="multipliers of the closed loop")
    for axes in (nyquist, circle):
        _unit_circle(axes)
    gain.set_title(_told(loop), fontsize="medium")
    for axes in (gain, phase, nyquist, circle):
        axes.grid(alpha=0.3)
    figure.suptitle(chart_text(f'Loop of {scene} through "{loop.signal}", sampled every {loop.period:g} s'))
    return save_figure(figure, path, dpi=_RESOLUTION)


def write_map_plot(path: Path, scene: str, names: tuple[str, str], first: Real, second: Real, size: Real) -> Path:
    """Write the picture of sizes (X,Y) of the largest multipliers over two numbers (X,) and (Y,)."""
    figure = Figure(figsize=_SIZE, layout="constrained")
    axes = figure.subplots()
    x, y = np.argsort(first), np.argsort(second)
    shown = size[np.ix_(x, y)].T
    if len(first) > 1 and len(second) > 1:
        shades = SymLogNorm(_NEAREST, vmin=-1.0, vmax=1.0)
        mesh = axes.pcolormesh(first[x], second[y], shown - 1.0, cmap="RdBu_r", norm=shades, shading="nearest")
        figure.colorbar(mesh, label="size of the largest multiplier, less 1: red is unstable")
        if np.nanmin(shown) < 1.0 < np.nanmax(shown):
            axes.contour(first[x], second[y], shown, levels=[1.0], colors="black")
    else:
        line = (first[x], shown[0]) if len(second) == 1 else (second[y], shown[:, 0])
        axes.plot(*line, marker=".")
        axes.axhline(1.0, color="black", linewidth=0.6)
    axes.set_xlabel(chart_text(names[0] if len(second) == 1 or len(first) > 1 else names[1]))
    axes.set_ylabel(chart_text(names[1]) if len(first) > 1 and len(second) > 1 else "size of the largest multiplier")
    figure.suptitle(chart_text(f"Stability of the sampled loop of {scene}"))
    return save_figure(figure, path, dpi=_RESOLUTION)


def _told(loop: LoopTransfer) -> str:
    gain = f"gain margin {loop.gain_margin:.3g}"
    phase = f"phase margin {np.degrees(loop.phase_margin):.3g} degrees"
    return f"{gain}, {phase}, delay margin {loop.delay_margin:.3g} s"


def _unit_circle(axes: Axes) -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 181)
    axes.plot(np.cos(angle), np.sin(angle), color="black", linewidth=0.6)
    axes.set_aspect("equal")
