"""The summary of a run in a terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from rich.text import Text

from flexmb.output.listing import Listing, figures, names, prose
from flexmb.run.channels import channels_of, norms, signal_range, unit
from flexmb.run.envelope import Envelope
from flexmb.run.trajectory import Trajectory
from flexmb.typing import Real

MOST_EVENTS = 8  # number of events that are listed
_LOADS = "load", "total_load", "wheel_load", "connector"


def summary(trajectory: Trajectory) -> Listing:
    """Status, largest loads at the output times, drift of energy and momentum, steps, and where the time went."""
    table = Listing(*names(""), *prose(""))
    for name, value in _rows(trajectory):
        table.add(Text(name, style="dim"), value)
    return table


def errors_table(trajectory: Trajectory, errors: Mapping[str, Real]) -> Listing:
    """The largest estimated error of each channel, in its unit and relative to its range."""
    table = Listing(
        *names("channel"), *figures("largest error", "relative"), title="\nErrors by a tighter run",
        caption="Relative: to the channel's range; for positions and orientations how far they get from the start.",
    )  # fmt: skip
    for name, values in channels_of(trajectory).items():
        if np.any(np.isnan(values)):
            table.add_row(name, "not determined", "")
            continue
        largest, scale = float(np.max(errors[name], initial=0.0)), signal_range(name, values)
        relative = f"{largest / scale:.1e}" if scale > 0.0 else ""
        table.add(name, f"{largest:.1e} {'rad' if name.endswith('.orientation') else unit(name)}", relative)
    return table


def peaks_table(trajectory: Trajectory, envelope: Envelope) -> Listing:
    """The largest load, drive and hinge force of each hinge, over all steps and at the output times."""
    table = Listing(
        *names("channel"), *figures("largest", "at", "output times"), title="\nPeaks over all steps",
        caption="Output times: the largest value at these alone, which the files hold.",
    )  # fmt: skip
    for name, found in _peaks(trajectory, envelope).items():
        table.add(name, f"{found.size:.6g} {unit(name)}", f"{found.t:.6g} s", f"{found.sampled:.6g}")
    return table


class Peak(NamedTuple):
    """The largest absolute value or magnitude of a channel, when (s), and the largest one at the output times."""

    size: float
    t: float
    sampled: float


def _peaks(trajectory: Trajectory, envelope: Envelope) -> dict[str, Peak]:
    """By channel, of what loads a structure."""
    peaks = {}
    for name, values in channels_of(trajectory).items():
        kind, _, of = name.partition(":")
        if name in envelope.magnitudes and kind in _LOADS:
            magnitude = envelope.magnitudes[name]
            peaks[name] = Peak(float(magnitude.greatest[0]), float(magnitude.t_greatest[0]), _largest(values))
        elif kind in ("drive", "hinge_force"):
            magnitude = (envelope.drives if kind == "drive" else envelope.hinge_forces)[of]
            for i, size in enumerate(magnitude.largest):
                t = magnitude.t_greatest[i] if magnitude.greatest[i] == size else magnitude.t_least[i]
                label = name if len(magnitude.largest) == 1 else f"{name}[{i}]"
                peaks[label] = Peak(float(size), float(t), _largest(values[:, i : i + 1]))
    return peaks


def _largest(values: Real) -> float:
    """The largest norm of rows, NaN if none is known."""
    sizes = norms(values)
    return float(np.nanmax(sizes)) if np.isfinite(sizes).any() else float("nan")


def _loads(trajectory: Trajectory) -> list[tuple[str, str]]:
    """The largest torque and force of all, which are values at output times and no peaks."""
    told = []
    for part in ("torque", "force"):
        sizes = {
            name: _largest(values)
            for name, values in channels_of(trajectory).items()
            if name.partition(":")[0] in _LOADS and name.endswith(f".{part}")
        }
        known = {name: size for name, size in sizes.items() if size > 0.0}  # not NaN either
        if known:
            name = max(known, key=known.__getitem__)
            told.append(f"{known[name]:.6g} {unit(name)} ({name})")
    at = f"at the {len(trajectory.t)} output times; --envelope (Trajectory.envelope) finds the peaks over all steps"
    return [("largest loads", f"{', '.join(told)} {at}")] if told else []


def _rows(trajectory: Trajectory) -> list[tuple[str, Text | str]]:
    cost = trajectory.statistics
    steps = f"{cost.accepted_steps} accepted, {cost.rejected_steps} rejected, {cost.evaluations} evaluations"
    if cost.jacobians:
        steps += f", {cost.jacobians} Jacobians, {cost.factorisations} factorisations"
    rows: list[tuple[str, Text | str]] = [
        ("status", Text(trajectory.message, style="green" if trajectory.finished else "bold red")),
        ("output", f"{len(trajectory.t)} times, {len(trajectory.markers)} markers, {len(trajectory.loads)} hinges"),
    ]
    if trajectory.undetermined:
        rows.append(("not determined", _undetermined(trajectory)))
    if trajectory.events:
        rows.append(("events", _events(trajectory)))
    if len(trajectory.t):
        rows += _loads(trajectory)
        rows += [("energy drift", _energy(trajectory)), *_momentum(trajectory)]
    by = "" if trajectory.made_by is None else f", by {trajectory.made_by.system.kernels} kernels"
    return [
        *rows,
        ("steps", steps),
        ("time", f"{cost.compile_s:.2f} s compile, {cost.run_s:.4f} s run{by}, {cost.output_s:.2f} s output"),
    ]


def _undetermined(trajectory: Trajectory) -> str:
    """Components of loads that redundant closures leave undetermined, as "pin (torque x, y; force z)"."""
    names = []
    for name, is_open in trajectory.undetermined.items():
        letters = [[axis for axis, is_axis in zip("xyz", is_open[i : i + 3], strict=False) if is_axis] for i in (0, 3)]
        parts = [f"{part} {', '.join(axes)}" for part, axes in zip(("torque", "force"), letters, strict=True) if axes]
        names.append(f"{name} ({'; '.join(parts)})" if name in trajectory.loads else name)
    return ", ".join(names)


def _events(trajectory: Trajectory) -> str:
    """Names and times of the first MOST_EVENTS events, and the number of the others."""
    told = [f"{event.name} at {event.t:.6g} s" for event in trajectory.events[:MOST_EVENTS]]
    left = len(trajectory.events) - len(told)
    return ", ".join(told) + (f", and {left} more" if left else "")


def _energy(trajectory: Trajectory) -> str:
    """The largest drift of energy, also relative to `energy_scale`."""
    drift, scale = np.abs(trajectory.energy_drift).max(), trajectory.energy_scale
    relative = f" ({drift / scale:.1e} of {scale:.4g} J)" if scale > 0.0 else ""
    return f"{drift:.1e} J{relative}"


def _momentum(trajectory: Trajectory) -> list[tuple[str, str]]:
    """The largest change of angular and linear momentum, which is an error only without external forces."""
    change = np.abs(trajectory.momentum_drift)
    return [("momentum change", f"{change[:, :3].max():.1e} N m s angular, {change[:, 3:].max():.1e} N s linear")]
