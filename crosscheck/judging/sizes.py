"""Reference sizes for signals that are zero within their uncertainty.

By symmetry a force, a momentum or a rate may vanish; then its range is only rounding, and a goal relative to that would
mean nothing. Such a signal is measured by the size of its family. If the whole family vanishes, the size follows from
other signals of the scene: of a linear momentum 2 T/v, of an angular one 2 T/w, of a force a torque over the extent, of
both, where a free hinge carries neither, 2 T by the angle and the distance, of work the energy, of frequencies and of
derivatives by speeds w, of derivatives by displacements w^2.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

from crosscheck.judging.uncertainty import roundoff_floor
from flexmb.kept import kept
from flexmb.run.channels import family, magnitude, signal_range
from flexmb.typing import Real

Measure = Callable[[str, Real], float]  # of a channel's signal: its largest magnitude, its range
LEAST_OF_FAMILY = 2.0**-26  # a range below this part of the family's is not used as a size
LEAST_OF_SCENE = 2.0**-50  # below this part of the size from other signals, a family is rounding of sums of these


def size_of(own: float, further: Sequence[float], doubt: float) -> float:
    """The size (SI) of a signal: the first of its `own` range and `further` that is above its uncertainty `doubt` (SI).

    `further` are those of `Sizes.of`. A range below `LEAST_OF_FAMILY` of the family's is skipped, as are the range and
    the family's below `LEAST_OF_SCENE` of the size from the rest of the scene.
    """
    kin, of_scene = (*further, 0.0, 0.0)[:2]
    if max(own, kin) < LEAST_OF_SCENE * of_scene:
        return of_scene
    candidates = [own, kin, of_scene] if own > LEAST_OF_FAMILY * kin else [kin, of_scene]
    return next((size for size in candidates if size > doubt), max(candidates))


@dataclass
class Sizes:
    """The sizes of the channels (T, k) of one result, each computed once."""

    channels: Iterable[str]
    values: Callable[[str], Real]
    _found: dict[tuple[Measure, str], float] = field(default_factory=dict, repr=False)

    def of(self, channel: str) -> tuple[float, ...]:
        """The largest range (SI) in the channel's family, and the size that follows from the rest of the scene."""
        return self._largest(signal_range, family(channel)), self._of_scene(channel)

    def magnitude(self, channel: str, evaluations: int = 0) -> float:
        """The size (SI) to which the rounding of a channel is relative.

        It is the largest magnitude in the channel's family, or the size from the rest of the scene if the family is
        only rounding of that, also after so many `evaluations`: a vanishing momentum is a sum of those of the bodies.
        Exact zeros have no rounding.
        """
        kin, of_scene = self._largest(magnitude, family(channel)), self._of_scene(channel)
        rounding = max(LEAST_OF_SCENE * of_scene, roundoff_floor(of_scene, max(evaluations, 0), self.joints))
        return of_scene if 0.0 < kin < rounding else kin

    @kept
    def joints(self) -> int:
        """The most joints that the arithmetic of a channel passes: all that have loads, one at least."""
        return max(1, len({name.rpartition(".")[0] for name in self.channels if name.startswith("load:")}))

    def _of_scene(self, channel: str) -> float:
        """The size (SI) of such a signal from the scene's other signals by dimensions; 0 if it does not follow."""
        motion = (".position", ".velocity", ".angular_velocity")
        extent, speed, turning = (self._magnitude_of(ending) for ending in motion)
        action = 2.0 * self._magnitude_of("energy.kinetic")
        match family(channel).rpartition(".")[2]:
            case "torque":
                return _unless_rounding(self._magnitude_of(".force") * extent, action)
            case "force":
                return _ratio(_unless_rounding(self._magnitude_of(".torque"), action), extent)
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
            case "work":
                return self._largest(magnitude, "energy")
            case "by_displacement":
                return max(turning, _ratio(speed, extent)) ** 2
            case "by_speed" | "frequencies":
                return max(turning, _ratio(speed, extent))
        return 0.0

    @kept
    def _families(self) -> dict[str, list[str]]:
        by_family: dict[str, list[str]] = {}
        for name in self.channels:
            by_family.setdefault(family(name), []).append(name)
        return by_family

    def _largest(self, measure: Measure, kin: str) -> float:
        """The largest measure in a family; 0 if it has no channel."""
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
    """The quotient, 0 for a divisor of 0."""
    return number / other if other > 0.0 else 0.0


def _unless_rounding(size: float, other: float) -> float:
    """The size, or the other one of which it is a mere rounding."""
    return size if size > LEAST_OF_SCENE * other else other
