"""The sizes by which a signal is measured that is zero within its uncertainty."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cached_property

from flexmb.run.channels import family, magnitude, signal_range
from flexmb.typing import Real

Measure = Callable[[str, Real], float]  # of a channel's signal: its largest magnitude, its range


@dataclass
class Sizes:
    """The sizes of the channels (T, k) of one result. Each is found once: every pair of engines, and every channel of a
    family, asks for it."""

    channels: Iterable[str]
    values: Callable[[str], Real]
    _found: dict[tuple[Measure, str], float] = field(default_factory=dict, repr=False)

    def of(self, channel: str) -> tuple[float, ...]:
        """The largest range (SI) in the channel's family; for torques also the largest force times the extent."""
        found = [self._largest(signal_range, family(channel))]
        if channel.endswith(".torque"):
            found.append(self._magnitude_of(".force") * self._magnitude_of(".position"))
        return tuple(found)

    def magnitude(self, channel: str) -> float:
        """The largest magnitude (SI) in the channel's family."""
        return self._largest(magnitude, family(channel))

    @cached_property
    def _families(self) -> dict[str, list[str]]:
        found: dict[str, list[str]] = {}
        for name in self.channels:
            found.setdefault(family(name), []).append(name)
        return found

    def _largest(self, measure: Measure, kin: str) -> float:
        """The largest size in a family; 0 if it has no channel."""
        return self._once(measure, kin, self._families.get(kin, []))

    def _magnitude_of(self, ending: str) -> float:
        """Largest magnitude (SI) among the channels with that ending; 0 if there is none."""
        return self._once(magnitude, ending, (name for name in self.channels if name.endswith(ending)))

    def _once(self, measure: Measure, what: str, names: Iterable[str]) -> float:
        key = (measure, what)
        if key not in self._found:
            self._found[key] = max((measure(name, self.values(name)) for name in names), default=0.0)
        return self._found[key]
