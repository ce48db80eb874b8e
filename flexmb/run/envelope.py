"""The envelope of a run: the least and greatest values of its results over all of its steps, and when."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path

import numpy as np

from flexmb.output.files import write_csv
from flexmb.run.run_arrays import Kind, RunArrays, labels
from flexmb.tables.named import brief, name_parts, parts_of
from flexmb.typing import Flags, Real

VECTORS: dict[Kind, tuple[str, tuple[str, ...]]] = {
    "position": ("marker", ("position",)),
    "velocity": ("marker", ("angular_velocity", "velocity")),
    "acceleration": ("marker", ("angular_acceleration", "acceleration")),
    "loads": ("load", ("torque", "force")),
    "total_loads": ("total_load", ("torque", "force")),
    "wheel_loads": ("wheel_load", ("torque", "force")),
    "connectors": ("connector", ("torque", "force")),
}
"""Kinds of results that are vectors of three components each, with the names of these as channels."""
CSV_HEADER = "channel", "unit", "least", "at [s]", "greatest", "at [s]", "error"

Key = tuple[Kind, str]
"""Kind of a result, and its name in the scene."""


@dataclass(frozen=True)
class Extremes:
    """The least and greatest values of k scalars over a run, arrays (k,), and the times (s) at which they occur.

    error (k,), in their unit: by how much they may be exceeded between the points at which the equations of motion were
    evaluated, estimated from polynomials of two degrees through these. It does not contain the error of the motion
    itself: see `Trajectory.error_estimate`. What the motion does not determine is NaN.
    """

    least: Real
    t_least: Real
    greatest: Real
    t_greatest: Real
    error: Real

    __repr__ = brief

    @property
    def largest(self) -> Real:
        """The largest absolute values (k,)."""
        return np.fmax(np.abs(self.least), np.abs(self.greatest))


def part_of_extremes(found: Extremes, place: slice) -> Extremes:
    """Those of some of the scalars."""
    return Extremes(*(getattr(found, field.name)[place] for field in fields(Extremes)))


def merged(a: Extremes, b: Extremes) -> Extremes:
    """Those of both together; where one has fewer scalars, it says nothing of the others."""
    k = max(len(a.least), len(b.least))
    a, b = _padded(a, k), _padded(b, k)
    least, t_least = _chosen(a.least, a.t_least, b.least, b.t_least, b.least < a.least)
    greatest, t_greatest = _chosen(a.greatest, a.t_greatest, b.greatest, b.t_greatest, b.greatest > a.greatest)
    above = np.fmax(a.greatest + a.error, b.greatest + b.error) - greatest
    below = least - np.fmin(a.least - a.error, b.least - b.error)
    return Extremes(least, t_least, greatest, t_greatest, np.fmax(above, below))


def _padded(found: Extremes, k: int) -> Extremes:
    missing = k - len(found.least)
    if not missing:
        return found
    arrays = (getattr(found, field.name) for field in fields(Extremes))
    return Extremes(*(np.pad(array, (0, missing), constant_values=np.nan) for array in arrays))


def _chosen(a: Real, t_a: Real, b: Real, t_b: Real, of_b: Flags) -> tuple[Real, Real]:
    of_b = of_b | np.isnan(a)
    return np.where(of_b, b, a), np.where(of_b, t_b, t_a)


def columns_of(arrays: Iterable[tuple[Kind, str, Real]]) -> dict[Key, Real]:
    """Those of the results (T,k) of a run that an envelope has."""
    return {(kind, name): values for kind, name, values in arrays if kind not in ("quaternion", "work")}


def magnitudes_of(columns: Mapping[Key, Real]) -> dict[str, Real]:
    """By channel, the Euclidean norms (T,1) of all vectors."""
    magnitudes = {}
    for (kind, name), values in columns.items():
        prefix, channels = VECTORS.get(kind, ("", ()))
        for i, channel in enumerate(channels):
            x, y, z = values[:, 3 * i : 3 * i + 3].T
            magnitudes[f"{prefix}:{name}.{channel}"] = np.hypot(np.hypot(x, y), z)[:, None]
    return magnitudes


@dataclass(frozen=True)
class Envelope:
    """Extremes of the results of a run from `t_start` to `t_end` (s): at its output times, at both ends of each of the
    `steps` of its motion, at points within them and between these, and on both sides of every event.

    By name, with as many entries as the fields of `flexmb.Trajectory` have columns, in the same units and axes: loads,
    total_loads, wheel_loads, connectors (6,) [torque; force], drives, hinge_forces, signals, power; energy (1,), also
    "total"; of markers positions (3,), velocities and accelerations (6,) [angular; linear]. momentum (6,), q (nq,),
    u (nu,). magnitudes (1,): norms of vectors, by channel, such as "load:hinge.torque", "marker:end.velocity".
    left_out: number of points at which the results could not be evaluated, near singular positions of closed chains.
    """

    t_start: float
    t_end: float
    steps: int
    loads: dict[str, Extremes]
    wheel_loads: dict[str, Extremes]
    connectors: dict[str, Extremes]
    drives: dict[str, Extremes]
    hinge_forces: dict[str, Extremes]
    total_loads: dict[str, Extremes]
    positions: dict[str, Extremes]
    velocities: dict[str, Extremes]
    accelerations: dict[str, Extremes]
    energy: dict[str, Extremes]
    momentum: Extremes
    signals: dict[str, Extremes]
    power: dict[str, Extremes]
    q: Extremes
    u: Extremes
    magnitudes: dict[str, Extremes]
    left_out: int = 0
    channels: tuple[tuple[str, str, Extremes], ...] = field(default=(), repr=False, compare=False)
    """(name, unit, extremes (1,)) of every scalar, as in `Trajectory.columns`, then of the magnitudes."""

    def __post_init__(self) -> None:
        name_parts(self, _PARTS)

    def __repr__(self) -> str:
        """Its size, for an interactive prompt."""
        return f"<Envelope of {len(self.channels)} channels over {self.steps} steps to t = {self.t_end:g} s>"

    def to_csv(self, path: str | os.PathLike[str]) -> None:
        """Write one row for each channel: name, unit, least and greatest value with their times, error."""
        write_csv(Path(path), CSV_HEADER, _rows(self.channels))


_PARTS = parts_of(
    "loads", "wheel_loads", "connectors", "drives", "hinge_forces", "total_loads", "positions", "velocities",
    "accelerations", "energy", "signals", "power", "magnitudes",
)  # fmt: skip


def _rows(channels: Iterable[tuple[str, str, Extremes]]) -> Iterator[list[str | float]]:
    for name, unit, found in channels:
        numbers = (getattr(found, field.name)[0] for field in fields(Extremes))
        yield [name, unit, *(float(number) for number in numbers)]


class PartialEnvelope:
    """Extremes of a part of a run, by `Key` and, of magnitudes, by channel; its steps, and points left out."""

    def __init__(self, steps: int = 0, left_out: int = 0) -> None:
        self.steps, self.left_out = steps, left_out
        self.columns: dict[Key, Extremes] = {}
        self.magnitudes: dict[str, Extremes] = {}

    def add(self, other: PartialEnvelope) -> None:
        """Merge another part into this one."""
        self.steps, self.left_out = self.steps + other.steps, self.left_out + other.left_out
        for key, found in other.columns.items():
            self.columns[key] = merged(self.columns[key], found) if key in self.columns else found
        for channel, found in other.magnitudes.items():
            known = self.magnitudes.get(channel)
            self.magnitudes[channel] = found if known is None else merged(known, found)


def envelope(run: RunArrays, parts: Sequence[PartialEnvelope]) -> Envelope:
    """The envelope of a run whose parts these are."""
    whole = PartialEnvelope()
    for part in parts:
        whole.add(part)
    channels = []
    for (kind, name), found in whole.columns.items():
        for i, (label, unit) in enumerate(labels(kind, name, len(found.least), run)):
            channels.append((label, unit, part_of_extremes(found, slice(i, i + 1))))
    units = {"torque": "N m", "force": "N", "position": "m", "velocity": "m/s", "angular_velocity": "rad/s",
             "acceleration": "m/s^2", "angular_acceleration": "rad/s^2"}  # fmt: skip
    channels += [(name, units[name.rpartition(".")[2]], found) for name, found in whole.magnitudes.items()]

    def of(kind: Kind) -> dict[str, Extremes]:
        return {name: found for (kind_of_load, name), found in whole.columns.items() if kind_of_load == kind}

    return Envelope(
        t_start=float(run.t[0]), t_end=run.stopped_at, steps=whole.steps,
        loads=of("loads"), wheel_loads=of("wheel_loads"), connectors=of("connectors"), drives=of("drives"),
        hinge_forces=of("hinge_forces"), total_loads=of("total_loads"), positions=of("position"),
        velocities=of("velocity"), accelerations=of("acceleration"), energy=of("energy"),
        momentum=whole.columns["momentum", ""],
        signals=of("signals"), power=of("power"), q=whole.columns["q", ""], u=whole.columns["u", ""],
        magnitudes=whole.magnitudes, left_out=whole.left_out, channels=tuple(channels),
    )  # fmt: skip
