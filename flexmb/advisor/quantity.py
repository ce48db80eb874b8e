"""Quantities: channels of a run, and the distance of two runs in them.

A quantity names channels as in `flexmb.run.channels`: `marker:tip.position`, `marker:*.orientation`, `load:hub.torque`,
`drive:hub`, `energy.total`; "energy" or "load:hub" names all channels with this prefix. Its error is the largest
distance of two runs over the output times and over its channels, relative to a scale. The scale is given after "@" in
SI units (`load:hub.torque@50`), or it is the range of the signal: the largest distance from its initial value for
positions and orientations, the largest magnitude for all others. Channels of one kind in one quantity share the largest
range, so that the error of a marker that hardly moves is not relative to its own small range.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from flexmb.run.channels import Recorded, channels_of, distance, family, magnitude, matches, signal_range, unit
from flexmb.scene.problems import closest
from flexmb.scene.schema import Scene
from flexmb.typing import Real

Signals = dict[str, Real]

_STILL = 1e-12  # a signal that changes by less than this fraction of its magnitude counts as constant


@dataclass(frozen=True)
class Quantity:
    """Channels named by `pattern`, and the scale (SI) of their error, or None for their range."""

    pattern: str
    scale: float | None = None

    @classmethod
    def parse(cls, word: str) -> Quantity:
        """`PATTERN` or `PATTERN@SCALE`; ValueError for a scale that is not a positive number."""
        pattern, at, scale = word.partition("@")
        if not at:
            return cls(pattern)
        try:
            value = float(scale)
        except ValueError:
            value = np.nan
        if not (np.isfinite(value) and value > 0.0):
            raise ValueError(f"quantity {word!r}: give the scale of errors after @ as a positive number, such as @0.5")
        return cls(pattern, value)

    def __str__(self) -> str:
        return self.pattern if self.scale is None else f"{self.pattern}@{self.scale:g}"


def quantities(words: str | Quantity | Sequence[str | Quantity] | None, scene: Scene) -> tuple[Quantity, ...]:
    """Quantities from words; by default the positions of all markers. ValueError if there are no markers."""
    if not words:
        if not scene.markers:
            raise ValueError(
                f'scene "{scene.name}" has no markers, whose positions are the default quantity: name a quantity, such '
                'as "energy.total" or "load:HINGE.torque"'
            )
        return (Quantity("marker:*.position"),)
    listed = (words,) if isinstance(words, str | Quantity) else tuple(words)
    return tuple(word if isinstance(word, Quantity) else Quantity.parse(word) for word in listed)


def measured(wanted: tuple[Quantity, ...], run: Recorded) -> Signals:
    """The channels of a run that the quantities name, each (T,k). ValueError for a quantity without channels."""
    channels = channels_of(run)
    signals: Signals = {}
    for quantity in wanted:
        named = {name: values for name, values in channels.items() if matches(quantity.pattern, name)}
        if not named:
            raise ValueError(f"the scene has no quantity {quantity.pattern!r}: {closest(quantity.pattern, channels)}")
        signals |= named
    return signals


def scales(wanted: tuple[Quantity, ...], reference: Mapping[str, Real]) -> dict[str, float]:
    """The scale of each channel's error, in the channel's unit. Raises ValueError for a signal without a range."""
    sizes: dict[str, float] = {}
    for quantity in wanted:
        named = [name for name in reference if matches(quantity.pattern, name)]
        for name in named:
            if np.any(np.isnan(reference[name])):
                raise ValueError(
                    f"{name} is not determined by the motion: closures are redundant, and the loads are statically "
                    "indeterminate; choose another quantity, or make bodies flexible"
                )
            if quantity.scale is not None:
                sizes[name] = quantity.scale
                continue
            alike = [other for other in named if family(other) == family(name)]
            size = max(signal_range(other, reference[other]) for other in alike)
            if size <= _STILL * max(magnitude(other, reference[other]) for other in alike):
                raise ValueError(
                    f"{name} does not change, so that its range is not a scale of errors: give a scale in "
                    f"{unit(name)}, such as {quantity.pattern}@1"
                )
            sizes[name] = size
    return sizes


def error(a: Mapping[str, Real], b: Mapping[str, Real], scale: Mapping[str, float]) -> float:
    """Largest distance of two runs over channels and times, relative to the scales; infinite if one is shorter, or if
    a load is determined in only one of them."""
    worst = 0.0
    for name, size in scale.items():
        if len(a[name]) != len(b[name]):
            return np.inf
        apart = float(np.max(distance(name, a[name], b[name]), initial=0.0))
        if np.isnan(apart):
            return np.inf
        worst = max(worst, apart / size)
    return worst
