"""A linear model as tables in a terminal."""

from __future__ import annotations

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from flexmb.linear.campbell import Campbell
from flexmb.linear.linear_model import LinearModel, Mode

_COLOURS = {"asymptotically stable": "green", "neutral": "yellow", "unstable": "bold red"}
_DOMINANT = 3  # displacements named per mode
_PART = 0.05  # of the kinetic energy, below which one is not named


def modes_table(model: LinearModel) -> RenderableType:
    """Frequency, damping and dominant displacements of every mode; stability; accelerations that are not balanced."""
    table = _table(f"\nModes of {model.scene}", "Parts: of the kinetic energy of the shape, by displacement.")
    for name in ("mode", "Hz", "rad/s", "damping ratio", "Re (1/s)"):
        table.add_column(name, justify="right")
    table.add_column("dominant displacements")
    for number, mode in enumerate(model.modes, 1):
        real = mode.eigenvalue.real if abs(mode.eigenvalue.real) > mode.tolerance else 0.0
        ratio = "" if np.isnan(mode.damping_ratio) else f"{0.0 - real / mode.natural_rad_s:.3g}"
        table.add_row(
            str(number), f"{mode.frequency_hz:.6g}", f"{mode.frequency_rad_s:.6g}", ratio,
            f"{real:.4g}", _dominant(model, mode),
        )  # fmt: skip
    stability = model.stability
    lines = [Text(str(stability), style=_COLOURS[stability.verdict])]
    left = float(np.max(np.abs(model.rates), initial=0.0))
    if left > 1e-6:
        lines.append(Text(f"not an equilibrium: accelerations up to {left:.3g} are left", style="yellow"))
    return Group(table, *lines)


def _dominant(model: LinearModel, mode: Mode) -> str:
    order = np.argsort(-mode.participation, kind="stable")[:_DOMINANT]
    named = [i for i in order if mode.participation[i] >= _PART]
    return ", ".join(f"{model.displacements[i]} {100.0 * mode.participation[i]:.0f} %" for i in named)


def campbell_table(result: Campbell) -> RenderableType:
    """Frequencies (Hz) against the spin rate; growing modes are red."""
    table = _table(
        f"\nFrequencies of {result.scene} in Hz, {result.hinge} spinning", "Red: the mode grows. 0: no oscillation."
    )
    table.add_column("rad/s", justify="right")
    for name in result.names:
        table.add_column(name, justify="right")
    for i, rate in enumerate(result.rates):
        verdict = result.stability[i]
        cells = [
            Text(f"{value.imag / (2.0 * np.pi):.5g}", style="bold red" if value.real > verdict.tolerance else "")
            for value in result.eigenvalues[i]
        ]
        table.add_row(f"{rate:g}", *cells)
    if not np.any(result.unstable):
        return Group(table, Text("no growing mode at these rates", style="green"))
    first = int(np.argmax(result.unstable))
    before = "" if first == 0 else f", not at {result.rates[first - 1]:g}"
    return Group(table, Text(f"unstable at {result.rates[first]:g} rad/s{before}", style="bold red"))


def _table(title: str, caption: str) -> Table:
    left = {"title_justify": "left", "caption_justify": "left"}
    return Table(title=title, caption=caption, box=None, padding=(0, 2, 0, 0), **left)  # type: ignore[arg-type]
