"""The sizes by which a signal is measured that is zero within its uncertainty."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from flexmb.run.channels import family, magnitude, signal_range
from flexmb.typing import Real

Measure = Callable[[str, Real], float]  # of a channel's signal: its largest magnitude, its range


@dataclass
class Sizes:
    """The sizes of the channels (T, k) of one result. Each is found once: every pair of engines asks for it."""

    channels: Iterable[str]
    values: Callable[[str], Real]
    _found: dict[tuple[Measure, str], float] = field(default_factory=dict, repr=False)

    def of(self, channel: str) -> tuple[float, ...]:
        """The largest range (SI) in the channel's family; for torques also the largest force times the extent."""
        found = [max((self._size(signal_range, name) for name in self._relatives(channel)), default=0.0)]
        if channel.endswith(".torque"):
            found.append(self._largest(".force") * self._largest(".position"))
        return tuple(found)

    def magnitude(self, channel: str) -> float:
        """The largest magnitude (SI) in the channel's family."""
        return max((self._size(magnitude, name) for name in self._relatives(channel)), default=0.0)

    def _largest(self, ending: str) -> float:
        """Largest magnitude (SI) among the channels with that ending; 0 if there is none."""
        return max((self._size(magnitude, name) for name in self.channels if name.endswith(ending)), default=0.0)

    def _relatives(self, channel: str) -> list[str]:
        kin = family(channel)
        return [name for name in self.channels if family(name) == kin]

    def _size(self, measure: Measure, channel: str) -> float:
        key = (measure, channel)
        if key not in self._found:
            self._found[key] = measure(channel, self.values(channel))
        return self._found[key]
