"""Which components of loads the motion of a scene leaves open: sets of components, and their names in records.

"load:pin.force[y, z]" names two components of a channel, "load:pin.force" all of them. Components of loads are x, y and
z, in World axes; those of drive loads are counted from 1. Where infinitely many loads go with the same motion, a
component that all of them share is determined as on a tree.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from flexmb.typing import Flags, Real

LOAD_PARTS = {"torque": slice(0, 3), "force": slice(3, 6)}
"""The channels of a load (6,) [torque; force]."""
AXES = "xyz"
OF_LOADS = "load:", "total_load:"
"""How channels of loads begin."""
ALL = None
"""All components of a channel, however many it has."""
Components = frozenset[int] | None
_LISTED = re.compile(r"(?P<channel>.+)\[(?P<listed>all|[xyz1-9][xyz0-9, ]*)\]", re.DOTALL)


@dataclass(frozen=True)
class Openness:
    """Components that are open, by channel: their numbers from 0, or `ALL`. No channel has an empty set."""

    by_channel: Mapping[str, Components] = field(default_factory=dict)

    @classmethod
    def of(cls, names: Iterable[str]) -> Openness:
        """From the names of channels and components, as records and engines have them."""
        return cls(_union(map(_read, names)))

    @classmethod
    def of_flags(cls, flags: Iterable[tuple[str, Flags]]) -> Openness:
        """From flags (k,) of all components of channels."""
        return cls(_union((name, ALL if np.all(each) else _numbers(each)) for name, each in flags if np.any(each)))

    def __or__(self, other: Openness) -> Openness:
        return Openness(_union((*self.by_channel.items(), *other.by_channel.items())))

    def __contains__(self, channel: str) -> bool:
        """Whether any component of the channel is open."""
        return channel in self.by_channel

    def __bool__(self) -> bool:
        return bool(self.by_channel)

    @property
    def names(self) -> tuple[str, ...]:
        """One name for each channel with open components, sorted; `of` reads them."""
        return tuple(sorted(self.name(channel) for channel in self.by_channel))

    def name(self, channel: str) -> str:
        """The channel with its open components, "load:pin.force[y, z]"; if all are open its bare name, or with "[all]"
        that of a drive which would read as components of another one."""
        found, reads_otherwise = self.by_channel[channel], _LISTED.fullmatch(channel)
        return channel if found is ALL and not reads_otherwise else f"{channel}[{self.components(channel)}]"

    def is_whole(self, channel: str, width: int | None = None) -> bool:
        """Whether all components are open, of `width` ones if that is known."""
        found = self.by_channel.get(channel, frozenset())
        return found is ALL or len(found) == width

    def components(self, channel: str) -> str:
        """The open components in words: "y, z", or "all"."""
        found = self.by_channel[channel]
        return "all" if found is ALL else _words(channel, found)

    def flags(self, channel: str, width: int) -> Flags:
        """Flags (width,) of the open components."""
        flags = np.zeros(width, dtype=bool)
        if channel in self.by_channel:
            found = self.by_channel[channel]
            flags[[*found] if found is not ALL else slice(None)] = True
        return flags

    def beyond(self, other: Openness) -> Openness:
        """What is open here and not there."""
        return Openness(dict(self._beyond(other)))

    def _beyond(self, other: Openness) -> Iterator[tuple[str, Components]]:
        for channel, found in self.by_channel.items():
            theirs = other.by_channel.get(channel, frozenset())
            mine = _every(channel) if found is ALL else found
            if channel not in other or (mine is ALL and theirs is not ALL):
                yield channel, found
            elif mine is not ALL and theirs is not ALL and mine - theirs:
                yield channel, mine - theirs

    def filled(self, channel: str, values: Real, value: float) -> Real:
        """The values (T, k) of a channel with `value` in the open components; the same array if none is open."""
        flags = self.flags(channel, values.shape[1])
        return np.where(flags, value, values) if np.any(flags) else values


NOTHING_OPEN = Openness()


def _union(items: Iterable[tuple[str, Components]]) -> dict[str, Components]:
    union: dict[str, Components] = {}
    for channel, found in items:
        before = union.get(channel, frozenset())
        both = ALL if found is ALL or before is ALL else found | before
        union[channel] = ALL if both is not ALL and both == _every(channel) else both
    return union


def _every(channel: str) -> Components:
    """All three components of a load; of a drive nobody knows here how many there are."""
    return frozenset(range(len(AXES))) if channel.startswith(OF_LOADS) else ALL


def _read(name: str) -> tuple[str, Components]:
    """A channel and its components from one name. ValueError for components that it cannot have."""
    listed = _LISTED.fullmatch(name)
    if listed is None:
        return name, ALL
    channel, words = listed["channel"], listed["listed"].split(",")
    if words == ["all"]:
        return channel, ALL
    is_load = channel.startswith(OF_LOADS)
    known = {axis: i for i, axis in enumerate(AXES)} if is_load else {}
    numbers = [known.get(word.strip(), -1) if is_load else _from_one(word.strip()) for word in words]
    if min(numbers) < 0:
        allowed = "x, y and z" if is_load else "counted from 1"
        raise ValueError(f"{name!r:.80}: the components of {channel!r:.60} are {allowed}")
    return channel, frozenset(numbers)


def _from_one(word: str) -> int:
    return int(word) - 1 if word.isdigit() else -1


def _numbers(flags: Flags) -> frozenset[int]:
    return frozenset(np.flatnonzero(flags).tolist())


def _words(channel: str, found: frozenset[int]) -> str:
    return ", ".join(AXES[i] if channel.startswith(OF_LOADS) else str(i + 1) for i in sorted(found))
