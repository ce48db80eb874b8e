"""Spectral densities of a random response as a picture, one diagram for each unit."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from flexmb.output.files import save_figure
from flexmb.output.printable import chart_text
from flexmb.typing import Real

_WIDTH, _HEIGHT = 9.0, 3.4  # inches, of each diagram
_RESOLUTION = 120  # dots per inch
_LINES = 10  # of one diagram; those with the largest RMS
_DECADES = 8.0  # below the largest value that are shown


def write_density_plot(
    path: Path, scene: str, frequencies_hz: Real, densities: Real, outputs: Sequence[tuple[str, str]], rms: Real
) -> Path:
    """Write the picture of densities (F,K) at frequencies (F,); outputs: names and units of K signals that move, rms
    (K,) of each."""
    units = list(dict.fromkeys(unit for _, unit in outputs))
    figure = Figure(figsize=(_WIDTH, _HEIGHT * max(len(units), 1)), layout="constrained")
    all_axes = np.atleast_1d(figure.subplots(max(len(units), 1), sharex=True))
    for axes, unit in zip(all_axes, units, strict=False):
        own = [k for k, (_, of) in enumerate(outputs) if of == unit]
        for k in sorted(own, key=lambda k: -rms[k])[:_LINES]:
            label = chart_text(f"{outputs[k][0]}, RMS {rms[k]:.4g} {unit}")
            axes.loglog(frequencies_hz, densities[:, k], label=label, linewidth=1.0)
        top = float(np.max(densities[:, own]))
        axes.set_ylim(top * 10.0**-_DECADES, 3.0 * top)
        axes.set_ylabel(chart_text(f"({unit})²/Hz"))
        axes.legend(fontsize="small", loc="best")
        axes.grid(alpha=0.3)
    all_axes[-1].set_xlabel("frequency (Hz)")
    figure.suptitle(chart_text(f"Random response of {scene}: one-sided spectral densities"))
    return save_figure(figure, path, dpi=_RESOLUTION)
