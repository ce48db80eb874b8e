"""Campbell diagrams as pictures: frequencies and growth rates against the spin rate."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from flexmb.linear.linear_model import Complex
from flexmb.output.files import save_figure
from flexmb.output.printable import chart_text
from flexmb.typing import Flags, Real

_SIZE = (9.0, 7.0)  # inches
_RESOLUTION = 120  # dots per inch
_ORDERS = 4  # lines of the spin rate and its multiples


def write_campbell_plot(
    path: Path, scene: str, hinge: str, rates: Real, names: tuple[str, ...], eigenvalues: Complex, is_growing: Flags
) -> Path:
    """Write the picture of eigenvalues (R,n) rad/s at spin rates (R,) rad/s of a hinge; names: of the first n modes."""
    figure = Figure(figsize=_SIZE, layout="constrained")
    above, below = figure.subplots(2, sharex=True, height_ratios=(3, 1))
    for j, (name, column, growing) in enumerate(zip(names, eigenvalues.T, is_growing.T, strict=False)):
        label = chart_text(f"{j + 1}: {name}")
        line = above.plot(rates, column.imag / (2.0 * np.pi), label=label, marker=".", markersize=3)
        below.plot(rates, column.real, color=line[0].get_color(), marker=".", markersize=3)
        above.plot(rates[growing], column.imag[growing] / (2.0 * np.pi), "x", color="red", markersize=7)
    top = 1.05 * float(np.max(eigenvalues.imag)) / (2.0 * np.pi)
    for order in range(1, _ORDERS + 1):
        multiple = order * np.abs(rates) / (2.0 * np.pi)
        above.plot(rates, multiple, color="grey", linewidth=0.7, linestyle=":")
        end = (float(rates[-1]), float(multiple[-1]))
        above.annotate(f"{order}x", end, color="grey", fontsize="small", annotation_clip=True)
    above.set_ylim(0.0, top if top > 0.0 else 1.0)
    above.set_ylabel("frequency (Hz)")
    below.set_ylabel("Re (1/s)")
    below.set_xlabel(chart_text(f'rate of "{hinge}" (rad/s)'))
    below.axhline(0.0, color="black", linewidth=0.6)
    figure.legend(*above.get_legend_handles_labels(), fontsize="small", loc="outside right upper")
    above.set_title("seen from the turning bodies; red crosses grow, dotted: multiples of the rate", fontsize="medium")
    for axes in (above, below):
        axes.grid(alpha=0.3)
    figure.suptitle(chart_text(f"Modes of {scene}"))
    return save_figure(figure, path, dpi=_RESOLUTION)
