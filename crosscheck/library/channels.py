"""A table of the kinds of channels, for patterns, records, reports and `crosscheck verify`.

A channel of an item of the scene is named `<kind>:<item>.<part>` (`load:elbow.torque`, `drive:elbow`), any other
`<kind>.<part>` (`energy.total`) or `<kind>` (`work`). `crosscheck.engines.trajectories` extracts the channels of a
trajectory; a test compares this table with it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from fnmatch import fnmatchcase

import numpy as np

from crosscheck.engines.contract import ENERGIES
from crosscheck.engines.linear.parts import DERIVATIVES, FREQUENCIES
from crosscheck.engines.trajectories import KNOWN_TO
from flexmb.run.channels import distance, matches
from flexmb.typing import Real


@dataclass(frozen=True)
class Part:
    """One signal of a kind of channels.

    `name` is "" where the kind has only one signal. `title` names the family of such channels in the report. `width` is
    the number of columns, None where it may be any. `letters` are the endings of the columns of a CSV that
    `crosscheck verify` reads ("tip.px"); `own` is what `trajectory.csv` calls the part, and `unit` the unit it writes.
    """

    name: str
    title: str
    width: int | None
    unit: str = ""
    letters: tuple[str, ...] = ()
    own: str = ""


@dataclass(frozen=True)
class ChannelKind:
    """Channels that have the same parts; `panel` is the title of their panel of the report, "" if they have none."""

    name: str
    panel: str
    of_items: bool
    parts: tuple[Part, ...]


def _load(whose: str) -> tuple[Part, Part]:
    return (
        Part("torque", f"{whose} torques", 3, "N m", ("tx", "ty", "tz"), "torque"),
        Part("force", f"{whose} forces", 3, "N", ("fx", "fy", "fz"), "force"),
    )


KINDS = (
    ChannelKind(
        "marker",
        "Motion",
        of_items=True,
        parts=(
            Part("position", "Marker positions", 3, "m", ("px", "py", "pz"), "position"),
            Part("orientation", "Marker orientations", 4, "1", ("qw", "qx", "qy", "qz"), "quaternion"),
            Part("velocity", "Marker velocities", 3, "m/s", ("vx", "vy", "vz"), "velocity"),
            Part("angular_velocity", "Angular velocities", 3, "rad/s", ("wx", "wy", "wz"), "angular_velocity"),
        ),
    ),
    ChannelKind(
        "energy",
        "Energy",
        of_items=False,
        parts=tuple(Part(kind, "Energy", 1, "J") for kind in (*ENERGIES, "total")),
    ),
    ChannelKind(
        "momentum",
        "Momentum",
        of_items=False,
        parts=(Part("angular", "Angular momentum", 3, "N m s"), Part("linear", "Linear momentum", 3, "N s")),
    ),
    ChannelKind("load", "Hinge loads", of_items=True, parts=_load("Hinge")),
    ChannelKind("total_load", "Total loads", of_items=True, parts=_load("Total")),
    ChannelKind("wheel_load", "Wheel loads", of_items=True, parts=_load("Wheel bearing")),
    ChannelKind("connector", "Connector loads", of_items=True, parts=_load("Connector")),
    ChannelKind("hinge_force", "Connector loads", of_items=True, parts=(Part("", "Loads along hinges", None),)),
    ChannelKind("drive", "Drive loads", of_items=True, parts=(Part("", "Drive loads", None),)),
    ChannelKind("work", "", of_items=False, parts=(Part("", "work", 1, "J"),)),
    ChannelKind(
        "derivatives",
        "Derivatives of accelerations",
        of_items=False,
        parts=(
            Part("by_displacement", "Derivatives by displacements", None),
            Part("by_speed", "Derivatives by speeds", None),
            Part("by_force", "Derivatives by forces", None),
        ),
    ),
    ChannelKind(FREQUENCIES, "Eigenfrequencies", of_items=False, parts=(Part("", "Eigenfrequencies", None, "rad/s"),)),
    ChannelKind(
        KNOWN_TO,
        "",
        of_items=False,
        parts=tuple(Part(name, f"how well {name} is known", 1) for name in (*DERIVATIVES, FREQUENCIES)),
    ),
)
LINEAR_KINDS = ("derivatives", "frequencies", KNOWN_TO)
"""Kinds of the linearised motion, which a run has only where its variant asks for them."""
CONSERVED = {"energy": "energy.total", "linear_momentum": "momentum.linear", "angular_momentum": "momentum.angular"}


def kind_named(name: str) -> ChannelKind:
    """The kind of channels called `name`."""
    return next(kind for kind in KINDS if kind.name == name)


def is_judged(channel: str) -> bool:
    """Whether a recorded channel is a signal, and not what an engine says of how well it knows one."""
    return not channel.startswith(f"{KNOWN_TO}.")


def known_to(channel: str) -> str:
    """The channel by which an engine says how well it knows another one; no run has one of most channels."""
    return f"{KNOWN_TO}.{channel.removeprefix('derivatives.')}"


def part_of(channel: str) -> Part | None:
    """The part to which a channel belongs, by its name; None if there is no such kind of channels."""
    head, of_item, rest = channel.partition(":")
    name, _, last = (head, "", rest.rpartition(".")[2]) if of_item else channel.partition(".")
    for kind in KINDS:
        if kind.name == name and kind.of_items == bool(of_item):
            parts = {part.name: part for part in kind.parts}
            return parts.get("") or parts.get(last)  # the name of an item may contain dots
    return None


# Patterns of channels in a run file: the most specific pattern of a channel, and errors in patterns.

PARTS = {kind.name: tuple(part.name for part in kind.parts if part.name) for kind in KINDS if kind.of_items}
WHOLE = {
    kind.name: tuple(part.name for part in kind.parts if part.name)
    for kind in KINDS
    if not kind.of_items and kind.name != KNOWN_TO
}


def most_specific(patterns: Iterable[str], channel: str) -> str | None:
    """The first of the longest patterns that match the channel; None if none does."""
    return max((pattern for pattern in patterns if matches(pattern, channel)), key=len, default=None)


def fault(pattern: str) -> str:
    """Why no channel can match the pattern; "" if one can.

    A pattern is a kind (`load`), a kind and a name (`load:elbow`), or these and a part (`load:elbow.torque`). A name
    with a dot needs its part, or `.*`.
    """
    kind, named, rest = pattern.partition(":")
    if named:
        parts = _matching(PARTS, kind)
        if not parts:
            return f'there is no kind "{kind}:"; it is one of {", ".join(f"{part}:" for part in PARTS)}'
        name, dot, part = rest.rpartition(".")
        if not (name if dot else rest):
            return f"it names no {kind}"
        known = [kind for group in parts for kind in group]
        if dot and known and not any(fnmatchcase(kind, part) for kind in known):
            return f'there is no "{part}" of a {kind}; it is one of {", ".join(known)}'
        return ""
    kind, dotted, part = pattern.partition(".")
    if not dotted:
        known = [*PARTS, *WHOLE]
        return "" if any(fnmatchcase(each, kind) for each in known) else f"it is none of {', '.join(known)}"
    parts = _matching(WHOLE, kind)
    known = [kind for group in parts for kind in group]
    if any(fnmatchcase(kind, part) for kind in known):
        return ""
    whole = ", ".join(f"{kind}.{part}" for kind, group in WHOLE.items() for part in group)
    return f"channels with a dot alone are {whole}"


def _matching(table: dict[str, tuple[str, ...]], kind: str) -> list[tuple[str, ...]]:
    return [parts for each, parts in table.items() if fnmatchcase(each, kind)]


def relative_error(channel: str, values: Real, reference: Real, scale: float) -> float:
    """The largest distance of samples (n, k) from those of a reference over the size of the signal; infinite if it is
    no number."""
    with np.errstate(over="ignore", invalid="ignore"):
        error = float(np.max(distance(channel, values, reference))) / scale
    return error if np.isfinite(error) else np.inf
