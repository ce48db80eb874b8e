"""Channels: the named signals by which two runs are compared, the distance of two signals, and the size of one."""

from __future__ import annotations

from collections.abc import Mapping
from fnmatch import fnmatchcase
from functools import lru_cache
from typing import Protocol

import numpy as np

from flexmb.typing import Real


class Path(Protocol):
    """A marker in World axes: position (T,3) m, quaternion (T,4) scalar first, velocity (T,6) [angular; linear]."""

    @property
    def position(self) -> Real: ...
    @property
    def quaternion(self) -> Real: ...
    @property
    def velocity(self) -> Real: ...


class Recorded(Protocol):
    """A trajectory computed by flexmb or by another code: loads, their sums and connectors (T,6), drives and hinge
    forces (T,k), energies (T,), momentum (T,6), work (T,)."""

    @property
    def markers(self) -> Mapping[str, Path]: ...
    @property
    def loads(self) -> Mapping[str, Real]: ...
    @property
    def total_loads(self) -> Mapping[str, Real]: ...
    @property
    def wheel_loads(self) -> Mapping[str, Real]: ...
    @property
    def drives(self) -> Mapping[str, Real]: ...
    @property
    def connectors(self) -> Mapping[str, Real]: ...
    @property
    def hinge_forces(self) -> Mapping[str, Real]: ...
    @property
    def energy(self) -> Mapping[str, Real]: ...
    @property
    def momentum(self) -> Real | None: ...
    @property
    def work(self) -> Real | None: ...


_SAFE = (1e-100, 1e100)  # squares of numbers in this range neither underflow nor overflow
UNITS = {
    ".position": "m",
    ".orientation": "rad",
    ".velocity": "m/s",
    ".angular_velocity": "rad/s",
    ".torque": "Nm",
    ".force": "N",
    ".angular": "Nms",
    ".linear": "Ns",
}


def channels_of(trajectory: Recorded) -> dict[str, Real]:
    """All signals of a trajectory, each (T, k), in World axes.

    Torque and force, angular and linear parts are separate channels, so that no norm mixes units. The total energy is
    the sum of the kinds that the engine reports. "work" is the work done on the system, if the engine integrates it.
    """
    channels: dict[str, Real] = {}
    for name, path in trajectory.markers.items():
        channels[f"marker:{name}.position"] = path.position
        channels[f"marker:{name}.orientation"] = path.quaternion
        channels[f"marker:{name}.angular_velocity"] = path.velocity[:, :3]
        channels[f"marker:{name}.velocity"] = path.velocity[:, 3:]
    on_bodies = (
        ("load", trajectory.loads), ("total_load", trajectory.total_loads), ("wheel_load", trajectory.wheel_loads),
        ("connector", trajectory.connectors),
    )  # fmt: skip
    for prefix, loads in on_bodies:
        for name, load in loads.items():
            channels[f"{prefix}:{name}.torque"] = load[:, :3]
            channels[f"{prefix}:{name}.force"] = load[:, 3:]
    for prefix, along in (("drive", trajectory.drives), ("hinge_force", trajectory.hinge_forces)):
        channels |= {f"{prefix}:{name}": values.reshape(len(values), -1) for name, values in along.items()}
    if trajectory.momentum is not None:
        channels["momentum.angular"] = trajectory.momentum[:, :3]
        channels["momentum.linear"] = trajectory.momentum[:, 3:]
    channels |= {f"energy.{kind}": energy[:, None] for kind, energy in trajectory.energy.items()}
    if trajectory.energy:
        channels["energy.total"] = np.sum([energy[:, None] for energy in trajectory.energy.values()], axis=0)
    if trajectory.work is not None:
        channels["work"] = trajectory.work[:, None]
    return channels


@lru_cache(maxsize=2**16)  # a harness session calls this a million times with a few thousand distinct arguments
def matches(pattern: str, channel: str) -> bool:
    """Whether `pattern` selects the channel: its name, a shell pattern, or the part of its name before a "." or ":"."""
    return any(fnmatchcase(channel, form) for form in (pattern, f"{pattern}.*", f"{pattern}:*"))


def family(channel: str) -> str:
    """The family of a channel: "load.torque" for every hinge's torque, "energy" for every kind of energy."""
    kind, _, rest = channel.partition(":")
    if not rest:
        return "energy" if channel.startswith("energy.") else channel
    return f"{kind}.{rest.rpartition('.')[2]}" if kind not in ("drive", "hinge_force") else kind


def unit(channel: str) -> str:
    """SI unit of a channel."""
    if channel.startswith(("energy.", "work")):
        return "J"
    if channel.startswith(("drive:", "hinge_force:")):
        return "N or Nm"
    if channel == "frequencies":
        return "rad/s"
    return next((symbol for ending, symbol in UNITS.items() if channel.endswith(ending)), "")


def is_vector(channel: str) -> bool:
    """Whether a channel is a vector of an item of the scene, whose magnitude means something."""
    parts = "position", "velocity", "angular_velocity", "torque", "force"
    return ":" in channel and channel.rpartition(".")[2] in parts


@np.errstate(over="ignore", invalid="ignore")
def distance(channel: str, a: Real, b: Real) -> Real:
    """Distance of two signals at each time, (T,): the Euclidean norm of a - b, for orientations the angle between them.

    Quaternions q and -q are one orientation; the angle is 4 asin(|q_a - q_b| / 2), accurate for small angles. Where a
    signal is not finite, neither is the distance.
    """
    if channel.endswith(".orientation"):
        chord = np.minimum(norms(a - b), norms(a + b))
        return np.where(np.isfinite(chord), 4.0 * np.arcsin(np.minimum(chord / 2.0, 1.0)), chord)
    return norms(a - b)


def norms(rows: Real) -> Real:
    """Euclidean norm of each row, (T,), without underflow or overflow of the squares.

    Rows are scaled by powers of two, which introduces no rounding. Norms of rows that are not finite are not finite.
    """
    largest = np.max(np.abs(rows), axis=1, initial=0.0)
    if _SAFE[0] < np.min(largest, where=largest > 0.0, initial=1.0) and np.max(largest, initial=0.0) < _SAFE[1]:
        return np.linalg.norm(rows, axis=1)  # the same result in half the time
    exponent = np.where(np.isfinite(largest), np.frexp(largest)[1], 0)
    with np.errstate(over="ignore", invalid="ignore"):
        return np.ldexp(np.linalg.norm(np.ldexp(rows, -exponent[:, None]), axis=1), exponent)


def magnitude(channel: str, values: Real) -> float:
    """Largest norm of the signal over time, to which round-off is proportional (for orientations pi rad)."""
    if channel.endswith(".orientation"):
        return float(np.pi)
    return float(np.max(norms(values), initial=0.0))


def signal_range(channel: str, values: Real) -> float:
    """The channel's range, to which accuracy goals are relative.

    For positions and orientations this is the largest distance from the initial value, which does not depend on the
    choice of the origin; for all others, whose zero has a physical meaning, it is the largest magnitude.
    """
    if channel.endswith((".position", ".orientation")):
        start = np.broadcast_to(values[:1], values.shape)
        return float(np.max(distance(channel, values, start), initial=0.0))
    return magnitude(channel, values)
