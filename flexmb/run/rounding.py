"""How far rounding alone may move a channel: its size, and by how much of that.

Relative rounding errors of size eps and random sign in N evaluations add up to about eps sqrt(N) times the size of the
signal (Henrici 1962). The size is that of the largest signal of the same family (all hinge torques, all positions): a
backward-stable solve has errors relative to the norm of all unknowns. A short run has few evaluations, and then the
rounding of the arithmetic that makes a channel of a state counts for more: on its way past n joints a number takes part
in `ROUNDINGS` n operations. Errors of rounding are spread over +- eps/2, and have at most the variance eps^2/12; their
sum is nearly normal (Henrici 1962) and is bounded by

    LIKELY sqrt(ROUNDINGS n / 12) eps

times the size: few values in 1e9 are further than six standard deviations off.

By symmetry a force, a momentum or a rate may vanish; then its range is only rounding, and a goal relative to that would
mean nothing. Such a signal is measured by the size of its family. If the whole family vanishes, the size follows from
other signals of the scene: of a linear momentum 2 T/v, of an angular one 2 T/w, of a force a torque over the extent, of
both, where a free hinge carries neither, 2 T by the angle and the distance, of work the energy, of frequencies and of
derivatives by speeds w, of derivatives by displacements w^2.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from flexmb.kept import kept
from flexmb.run.channels import family, magnitude, signal_range
from flexmb.typing import Real

Measure = Callable[[str, Real], float]  # of a channel's signal: its largest magnitude, its range
LEAST_OF_SCENE = 2.0**-50  # below this part of the size from other signals, a family is rounding of sums of these
MOST_COUNTED = 2**63  # evaluations: a record may contain larger integers, which NumPy cannot represent
ROUNDINGS = 17  # an entry of a joint's rotation 3, composed with the one before 5, an arm turned 5, added 1, a moment 3
LIKELY = 6.0  # standard deviations


def roundoff_floor(size: float, evaluations: int, joints: int = 0) -> float:
    """eps sqrt(N) times the size of the signals, and the rounding of arithmetic that passes so many joints."""
    in_steps = np.sqrt(float(min(evaluations, MOST_COUNTED)))
    return float(np.finfo(np.float64).eps * (in_steps + ulp_of_arithmetic(joints)) * size)


def ulp_of_arithmetic(joints: int) -> float:
    """By how many units in the last place the rounding of arithmetic that passes so many joints is likely bounded."""
    return float(LIKELY * np.sqrt(ROUNDINGS * joints / 12.0))


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

    def floor(self, channel: str, evaluations: int) -> float:
        """What rounding alone may add to a channel (SI) of a run of so many evaluations, also between its samples where
        these are exact zeros."""
        size = self.magnitude(channel, evaluations) or self._of_scene(channel)
        return roundoff_floor(size, max(evaluations, 1), self.joints)

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


class Floors:
    """What rounding alone may add to each channel (SI) of a run, by `channels_of` and its evaluations."""

    def __init__(self, channels: Mapping[str, Real], evaluations: int) -> None:
        # What is not determined, or has overflown, has no size.
        known = {name: np.where(np.isfinite(values), values, 0.0) for name, values in channels.items()}
        self._sizes, self._evaluations = Sizes(tuple(known), known.__getitem__), evaluations

    def of(self, channel: str) -> float:
        """The bound of a channel. A drive is a component of the load across its hinge, and is rounded as that."""
        name = channel.removeprefix("drive:")
        own = (channel,) if name == channel else (channel, f"load:{name}.torque", f"load:{name}.force")
        return max(self._sizes.floor(each, self._evaluations) for each in own if each in self._sizes.channels)
