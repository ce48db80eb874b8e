"""The summary of a run in a terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from rich.text import Text

from flexmb.output.listing import Listing, figures, names, prose
from flexmb.run.channels import channels_of, signal_range, unit
from flexmb.run.envelope import Envelope, Extremes, part_of_extremes
from flexmb.run.rounding import Floors
from flexmb.run.run_arrays import Kind, labels
from flexmb.run.trajectory import Trajectory
from flexmb.system.observables import open_components
from flexmb.typing import Real

MOST_EVENTS = 8  # number of events that are listed
MOST_PEAKS = 12  # rows of the table of peaks


def summary(trajectory: Trajectory) -> Listing:
    """Status, drift of energy and momentum, steps, and where the time went."""
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


def peaks_table(trajectory: Trajectory, envelope: Envelope, over: str = "all steps") -> Listing:
    """The greatest component of torque and force across each hinge, wheel, closure and connector, and of each drive,
    with its sign and when it occurs. `over`: what the envelope is of, in words."""
    found = _peaks(trajectory, envelope)
    peaks = sorted((peak for peak in found if peak.is_signal), key=lambda peak: -peak.share)[:MOST_PEAKS]
    zero = [peak.name for peak in found if not peak.is_signal]
    left = len(found) - len(zero) - len(peaks)
    notes = [
        f"smaller, left out: {left}" if left else "",
        f"zero but for rounding: {', '.join(zero[:MOST_PEAKS])}" if zero else "",
        f"and {len(zero) - MOST_PEAKS} more" if len(zero) > MOST_PEAKS else "",
        f"not determined: {open_components(trajectory.undetermined)}" if trajectory.undetermined else "",
    ]
    table = Listing(
        *names("component"), *figures("peak", "at"), title=f"\nPeaks of loads over {over}",
        caption="; ".join(note for note in notes if note),
    )  # fmt: skip
    for peak in found:
        if peak in peaks:
            table.add(peak.name, f"{peak.value:.6g} {peak.unit}", f"{peak.t:.6g} s")
    return table


class Peak(NamedTuple):
    """The value of largest size of a scalar, as envelope.csv names it, and when (s); `share`: of the largest of its
    kind; is_signal: whether it is more than rounding."""

    name: str
    unit: str
    value: float
    t: float
    share: float
    is_signal: bool


def _peaks(trajectory: Trajectory, envelope: Envelope) -> list[Peak]:
    """Of all that loads a structure, in the order of the run's columns: of a vector its greatest component."""
    channels = channels_of(trajectory)
    floors = Floors(channels, trajectory.statistics.evaluations)
    groups: list[tuple[str, str, list[tuple[str, str]], Extremes]] = []
    kinds: tuple[tuple[Kind, str], ...] = (
        ("loads", "load"), ("total_loads", "total_load"), ("wheel_loads", "wheel_load"), ("connectors", "connector"),
        ("drives", "drive"), ("hinge_forces", "hinge_force"),
    )  # fmt: skip
    for kind, prefix in kinds:
        for item, extremes in getattr(envelope, kind).items():
            named = labels(kind, item, len(extremes.least), trajectory)
            if kind in ("drives", "hinge_forces"):
                scalars = enumerate(named)
                groups += [(prefix, f"{prefix}:{item}", [one], _part(extremes, i, i + 1)) for i, one in scalars]
                continue
            for start, part in ((0, "torque"), (3, "force")):
                channel = f"{prefix}:{item}.{part}"
                groups.append((part, channel, named[start : start + 3], _part(extremes, start, start + 3)))
    sizes = [float(np.nanmax(found.largest, initial=0.0)) for *_, found in groups]
    most = {of: max(size for (other, *_), size in zip(groups, sizes, strict=True) if other == of) for of, *_ in groups}
    peaks = []
    for (of, channel, named, found), size in zip(groups, sizes, strict=True):
        if np.all(np.isnan(found.largest)):
            continue  # it is named as not determined
        i = int(np.nanargmax(found.largest))
        is_top = found.greatest[i] == found.largest[i]
        value, t = (found.greatest, found.t_greatest) if is_top else (found.least, found.t_least)
        is_signal = size > floors.of(channel)
        share = size / (most[of] or 1.0)
        name = named[i][0] if is_signal or len(named) == 1 else named[i][0].rpartition(".")[0]
        peaks.append(Peak(name, named[i][1], float(value[i]), float(t[i]), share, is_signal))
    return peaks


def _part(extremes: Extremes, start: int, stop: int) -> Extremes:
    return part_of_extremes(extremes, slice(start, stop))


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
        rows.append(("not determined", open_components(trajectory.undetermined)))
    if trajectory.events:
        rows.append(("events", _events(trajectory)))
    if len(trajectory.t):
        rows += [("energy drift", _energy(trajectory)), *_momentum(trajectory)]
    by = "" if trajectory.made_by is None else f", by {trajectory.made_by.system.kernels} kernels"
    return [
        *rows,
        ("steps", steps),
        ("time", f"{cost.compile_s:.2f} s compile, {cost.run_s:.4f} s run{by}, {cost.output_s:.2f} s output"),
    ]


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
