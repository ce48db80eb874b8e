"""The sizes by which a signal is measured that is zero within its uncertainty.

By symmetry a force, a momentum or a rate may vanish; what is left of it is rounding, and a goal relative to the range
of rounding would mean nothing. Such a signal is measured by its family, and where the whole family vanishes by what the
scene's other signals say: a linear momentum by 2 T/v, an angular one by 2 T/w, a force by torques over the extent.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

from crosscheck.judging.uncertainty import roundoff_floor
from flexmb.run.channels import family, magnitude, signal_range
from flexmb.typing import Real

Measure = Callable[[str, Real], float]  # of a channel's signal: its largest magnitude, its range
ROUNDING = 2.0**-26  # of its family's size: a signal that is smaller has no digits of its own
NOTHING = 2.0**-50  # of what the scene says: sums of such numbers leave so much by rounding, as torques of forces do


def size_of(own: float, further: Sequence[float], doubt: float) -> float:
    """The size (SI) of a signal: its `own` range, or the first of `further` above `doubt`, its uncertainty (SI).

    `further` are those of `Sizes.of`. A range below `ROUNDING` of the family's is not taken, nor are the range and the
    family's below `NOTHING` of what the rest of the scene says: the signal is zero.
    """
    kin, of_scene = (*further, 0.0, 0.0)[:2]
    if max(own, kin) < NOTHING * of_scene:
        return of_scene
    candidates = [own, kin, of_scene] if own > ROUNDING * kin else [kin, of_scene]
    return next((size for size in candidates if size > doubt), max(candidates))


@dataclass
class Sizes:
    """The sizes of the channels (T, k) of one result. Each is found once: every pair of engines, and every channel of a
    family, asks for it."""

    channels: Iterable[str]
    values: Callable[[str], Real]
    _found: dict[tuple[Measure, str], float] = field(default_factory=dict, repr=False)

    def of(self, channel: str) -> tuple[float, ...]:
        """The largest range (SI) in the channel's family, and what the rest of the scene says where that is nothing."""
        return self._largest(signal_range, family(channel)), self._of_scene(channel)

    def magnitude(self, channel: str, evaluations: int = 0) -> float:
        """What the rounding of a channel is relative to (SI): the largest magnitude in its family, or what the rest of
        the scene says where the family is nothing beside that, or beside what so many `evaluations` leave of it by
        rounding: a momentum that vanishes is a sum of those of the bodies. Exact zeros have no rounding."""
        kin, of_scene = self._largest(magnitude, family(channel)), self._of_scene(channel)
        nothing = max(NOTHING * of_scene, roundoff_floor(of_scene, max(evaluations, 0)))
        return of_scene if 0.0 < kin < nothing else kin

    def _of_scene(self, channel: str) -> float:
        """The size (SI) of such a signal by dimensions, from the scene's other signals; 0 where they say nothing."""
        motion = (".position", ".velocity", ".angular_velocity")
        extent, speed, turning = (self._magnitude_of(ending) for ending in motion)
        action = 2.0 * self._magnitude_of("energy.kinetic")
        match family(channel).rpartition(".")[2]:
            case "torque":
                return self._magnitude_of(".force") * extent
            case "force":
                return _ratio(self._magnitude_of(".torque"), extent)
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


def _ratio(number: float, other: float) -> float:
    """The quotient, 0 where there is none."""
    return number / other if other > 0.0 else 0.0
