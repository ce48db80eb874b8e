"""A linear model as tables in a terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from flexmb.linear.base_excitation import DIRECTIONS, BaseExcitation
from flexmb.linear.campbell import Campbell
from flexmb.linear.linear_model import LinearModel
from flexmb.linear.random_response import RandomResponse
from flexmb.linear.truncation import Truncation
from flexmb.output.listing import Listing, figures, names, prose
from flexmb.typing import Real

if TYPE_CHECKING:  # of sampled loops alone
    from flexmb.linear.margins import LoopTransfer
    from flexmb.linear.sampled_model import SampledModel

_COLOURS = {"asymptotically stable": "green", "neutral": "yellow", "unstable": "bold red"}
_DOMINANT = 3  # displacements named per mode
_PART = 0.05  # of the kinetic energy, below which one is not named
_RIGID_BODY = 8  # displacements named of all rigid-body motions together


def modes_table(model: LinearModel, cut: Truncation | None = None) -> RenderableType:
    """Frequency, damping, dominant displacements and, if known, truncation error of every mode.

    Below the table: stability, and remaining accelerations if the state is no equilibrium.
    """
    numbers = figures("mode", "Hz", "rad/s", "damping ratio", "Re (1/s)", *([] if cut is None else ["truncation"]))
    shapes = prose("dominant displacements")
    table = Listing(*numbers, *shapes, title=f"\nModes of {model.scene}", caption=_caption(cut))
    if model.rigid_body_shapes.shape[1]:
        table.add(*_rigid_body_row(model, cut))
    for i, mode in enumerate(model.modes):
        if mode.is_rigid_body:
            continue
        real = mode.eigenvalue.real if abs(mode.eigenvalue.real) > mode.tolerance else 0.0
        table.add(
            str(i + 1), f"{mode.frequency_hz:.6g}", f"{mode.frequency_rad_s:.6g}",
            f"{0.0 - real / mode.natural_rad_s:.3g}", f"{real:.4g}",
            *([] if cut is None else ["" if np.isnan(cut.change[i]) else f"{cut.change[i]:.1e}"]),
            _dominant(model, mode.participation),
        )  # fmt: skip
    stability = model.stability
    lines = [Text(str(stability), style=_COLOURS[stability.verdict])]
    left = float(np.max(np.abs(model.rates), initial=0.0))
    if left > 1e-6:
        lines.append(Text(f"not an equilibrium: accelerations up to {left:.3g} are left", style="yellow"))
    return Group(table, *lines)


def _caption(cut: Truncation | None) -> str:
    parts = "Parts: of the kinetic energy of the shape, by displacement."
    if cut is None:
        return parts
    others = f"; not of {', '.join(cut.unrefined)}, which have no finer model" if cut.unrefined else ""
    return f"{parts} Truncation: relative change with twice the modes of every beam{others}."


def _rigid_body_row(model: LinearModel, cut: Truncation | None) -> list[str]:
    """One row for all rigid-body motions: an eigenvector is an arbitrary combination of them."""
    shapes, count = model.rigid_body_shapes, sum(mode.is_rigid_body for mode in model.modes)
    which = np.flatnonzero(np.max(np.abs(shapes), axis=1) > _PART)
    named = ", ".join(model.displacements[i] for i in which[:_RIGID_BODY])
    more = f" and {len(which) - _RIGID_BODY} more" if len(which) > _RIGID_BODY else ""
    numbers = "1" if count == 1 else f"1-{count}"
    motions = f"{shapes.shape[1]} rigid-body motion{'s' if shapes.shape[1] > 1 else ''}"
    return [numbers, "rigid", "", "", "", *([] if cut is None else [""]), f"{motions}: {named}{more}"]


def _dominant(model: LinearModel, participation: Real) -> str:
    order = np.argsort(-participation, kind="stable")[:_DOMINANT]
    named = [i for i in order if participation[i] >= _PART]
    return ", ".join(f"{model.displacements[i]} {100.0 * participation[i]:.0f} %" for i in named)


def campbell_table(result: Campbell) -> RenderableType:
    """Frequencies (Hz) against the spin rate; growing modes are red."""
    title = f"\nFrequencies of {result.scene} in Hz, {result.hinge} spinning"
    table = Listing(*figures("rad/s", *result.names), title=title, caption="Red: the mode grows. 0: no oscillation.")
    for i, rate in enumerate(result.rates):
        verdict = result.stability[i]
        cells = [
            Text(f"{value.imag / (2.0 * np.pi):.5g}", style="bold red" if value.real > verdict.tolerance else "")
            for value in result.eigenvalues[i]
        ]
        table.add(f"{rate:g}", *cells)
    if not np.any(result.unstable):
        return Group(table, Text("no growing mode at these rates", style="green"))
    first = int(np.argmax(result.unstable))
    before = "" if first == 0 else f", not at {result.rates[first - 1]:g}"
    return Group(table, Text(f"unstable at {result.rates[first]:g} rad/s{before}", style="bold red"))


def base_modes_table(excitation: BaseExcitation) -> RenderableType:
    """Frequency, damping and shares of effective mass of every mode of what stands on the ground, and their sums."""
    modes, model = excitation.modes, excitation.model
    shares = [f"{name} %" for name in DIRECTIONS]
    about = "of World through its origin"
    table = Listing(
        *figures("mode", "Hz", "damping ratio", *shares), *prose("dominant displacements"),
        title=f"\nEffective masses of {model.scene}",
        caption=f"Shares of all that stands on the ground, along x, y, z and about the axes {about}.",
    )  # fmt: skip
    energy = modes.shapes**2 * np.diag(model.mass)[:, None]
    for j, (frequency, ratio, share) in enumerate(
        zip(modes.frequencies_hz, modes.damping_ratios, modes.shares, strict=True)
    ):
        table.add(
            str(j + 1), f"{frequency:.6g}", "" if np.isnan(ratio) else f"{ratio:.3g}", *_percent(share),
            _dominant(model, energy[:, j] / np.sum(energy[:, j])),
        )  # fmt: skip
    table.add("all", "", "", *_percent(np.sum(modes.shares, axis=0)), "")
    total = ", ".join(f"{name} {value:.6g}" for name, value in zip(DIRECTIONS, modes.total, strict=True))
    return Group(table, Text(f"on the ground, kg and kg m²: {total}"))


def _percent(shares: Real) -> list[str]:
    return [f"{100.0 * share:.2f}" for share in shares]


def random_table(response: RandomResponse) -> RenderableType:
    """RMS and rate of zero crossings of every output that moves."""
    inputs = "; ".join(f"{name}: {density.rms:.4g} RMS" for name, density in response.inputs.items())
    table = Listing(
        *names("output"), *figures("RMS", "unit", "crossings (Hz)"),
        title=f"\nRandom response of {response.model.scene} to {inputs}",
        caption="Outputs that do not move, but for rounding, are left out. Undetermined: by redundant closures.",
    )  # fmt: skip
    for i in np.flatnonzero(response.moves):
        (name, unit), rms = response.outputs[i], response.rms[i]
        cells = ("undetermined", unit, "") if np.isnan(rms) else (f"{rms:.5g}", unit, f"{response.crossings_hz[i]:.4g}")
        table.add(name, *cells)
    return table


def sampled_table(model: SampledModel) -> RenderableType:
    """Multipliers of a sampled loop with frequency and damping, the margins of every loop, and the verdict."""
    title = f"\nMultipliers of {model.scene} over {model.period:g} s"
    caption = "Frequency and damping ratio: of the continuous motion that is sampled so."
    table = Listing(*figures("size", "Hz", "damping ratio"), *prose("dominant displacement or state"), title=title,
                    caption=caption)  # fmt: skip
    for mode in model.modes:
        size = abs(mode.multiplier)
        style = "bold red" if size - mode.tolerance > 1.0 else ""
        ratio = "" if np.isnan(mode.damping_ratio) else f"{mode.damping_ratio:.3g}"
        table.add(Text(f"{size:.6g}", style=style), f"{mode.frequency_hz:.6g}", ratio, mode.dominant)
    verdict = model.stability
    lines = [Text(str(verdict), style=_COLOURS[verdict.verdict])]
    if model.free:
        lines.append(Text(f"drift freely, and are left out: {', '.join(model.free)}"))
    if model.saturated:
        lines.append(Text(f"at a limit, where they change nothing: {', '.join(model.saturated)}", style="yellow"))
    left = float(np.max(np.abs(model.rates), initial=0.0))
    if left > 1e-6:
        lines.append(Text(f"not an equilibrium: accelerations up to {left:.3g} are left", style="yellow"))
    return Group(table, *_margins(model), *lines)


def _margins(model: SampledModel) -> list[RenderableType]:
    """A table of all loops that have a transfer function, and a line that names the others."""
    caption = "Each loop opened alone. They tell how far a stable loop is from an unstable one."
    names = ("gain", "least gain", "phase (degrees)", "at rad/s", "delay (s)")
    table = Listing(*prose("opened at"), *figures(*names), title="Margins", caption=caption)
    others = list[str]()
    for name in model.loop_names:
        try:
            table.add(name, *_of_loop(model.opened(name)))
        except ValueError:
            others.append(name)
    told = Text(f"sampled more than once in {model.period:g} s, of no one transfer function: {', '.join(others)}")
    return [*([table] if len(others) < len(model.loop_names) else []), *([told] if others else [])]


def _of_loop(loop: LoopTransfer) -> list[str]:
    nearest = min(loop.gain_crossings, key=lambda each: abs(each.value), default=None)
    return [
        f"{loop.gain_margin:.4g}", f"{loop.gain_reduction:.4g}", f"{np.degrees(loop.phase_margin):.4g}",
        "" if nearest is None else f"{nearest.omega:.4g}", f"{loop.delay_margin:.4g}",
    ]  # fmt: skip
