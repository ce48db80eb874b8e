"""The sizes by which a signal is measured that is zero within its uncertainty.

By symmetry a force, a momentum or a rate may vanish; what is left of it is rounding, and a goal relative to the range
of rounding would mean nothing. Such a signal is measured by its family, and where the whole family vanishes by what the
scene's other signals say: a linear momentum by 2 T/v, an angular one by 2 T/w, a force by torques over the extent.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

from flexmb.run.channels import family, magnitude, signal_range
from flexmb.typing import Real

Measure = Callable[[str, Real], float]  # of a channel's signal: its largest magnitude, its range
ROUNDING = 2.0**-26  # of its family's size: a signal that is smaller has no digits of its own


def size_of(own: float, further: Sequence[float], doubt: float) -> float:
    """The size (SI) of a signal: its `own` range, or the first of `further` above `doubt`, its uncertainty (SI).

    `further` are those of `Sizes.of`. A range below `ROUNDING` of the family's is not taken: the signal is zero.
    """
    candidates = [own, *further] if own > ROUNDING * (further[0] if further else 0.0) else list(further)
    return next((size for size in candidates if size > doubt), max(candidates, default=0.0))


@dataclass
class Sizes:
    """The sizes of the channels (T, k) of one result. Each is found once: every pair of engines asks for it."""

    channels: Iterable[str]
    values: Callable[[str], Real]
    _found: dict[tuple[Measure, str], float] = field(default_factory=dict, repr=False)

    def of(self, channel: str) -> tuple[float, ...]:
        """The largest range (SI) in the channel's family, and what the rest of the scene says where that is nothing."""
        kin = max((self._size(signal_range, name) for name in self._relatives(channel)), default=0.0)
        return kin, self._of_scene(channel)

    def magnitude(self, channel: str) -> float:
        """The largest magnitude (SI) in the channel's family."""
        return max((self._size(magnitude, name) for name in self._relatives(channel)), default=0.0)

    def _of_scene(self, channel: str) -> float:
        """The size (SI) of such a signal by dimensions, from the scene's other signals; 0 where they say nothing."""
        extent, speed, turning = (self._largest(f".{part}") for part in ("position", "velocity", "angular_velocity"))
        action = 2.0 * self._largest("energy.kinetic")
        match family(channel).rpartition(".")[2]:
            case "torque":
                return self._largest(".force") * extent
            case "force":
                return _ratio(self._largest(".torque"), extent)
            case "position":
                return extent
            case "velocity":
                return turning * extent
            case "angular_velocity":
                return _ratio(speed, extent)
            case "orientation":
                return 1.0  # a unit quaternion, and an angle in rad
            case "linear":
                return _ratio(action, max(speed, turning * extent))
            case "angular":
                return _ratio(action, max(turning, _ratio(speed, extent)))
        return 0.0

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


def _ratio(number: float, other: float) -> float:
    """The quotient, 0 where there is none."""
    return number / other if other > 0.0 else 0.0
