"""Scalars of a run, of which `gradient` finds the derivatives: sums of these terms.

    FinalValue("tip.position.x")                        a channel at the end of the run
    Misfit("ring_down.csv", sigma=1e-3)                 the weighted sum of squares of the differences from data
    TimeIntegral("hinge.rotation.rate", squared=True)   a channel, or its square, integrated over time

Each becomes a sum over instants: of weight c, or of weight (c - level)^2, with the value c of a channel there.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from flexmb.sensitivity.measurements import Measurements, measurements
from flexmb.tables import arguments
from flexmb.tables.named import brief

NODES = 4  # of Gauss's rule in each panel of an integral, which is exact for polynomials of degree 7
MOST_PANELS = 100_000


class Probe(NamedTuple):
    """weight (c - level)^2 if `squared`, else weight c, of the channel's value c at t (s)."""

    t: float
    channel: str
    weight: float
    level: float
    squared: bool

    def value(self, c: float) -> float:
        """The part of the scalar."""
        return self.weight * ((c - self.level) ** 2 if self.squared else c)

    def slope(self, c: float) -> float:
        """Its derivative by c."""
        return 2.0 * self.weight * (c - self.level) if self.squared else self.weight


@dataclass(frozen=True)
class FinalValue:
    """`weight` times a channel at the end of the run."""

    channel: str
    weight: float = 1.0

    def __post_init__(self) -> None:
        """TypeError for a name that is no string, or a weight that is no number; ValueError for an infinite one."""
        object.__setattr__(self, "channel", _named(self.channel))
        object.__setattr__(self, "weight", arguments.number("weight", self.weight))

    @property
    def channels(self) -> tuple[str, ...]:
        """The channels that it reads."""
        return (self.channel,)

    def probes(self, t_end: float, cuts: Sequence[float]) -> Iterator[Probe]:
        """Its instants; cuts: where the run may jump, s."""
        yield Probe(t_end, self.channel, self.weight, 0.0, squared=False)


@dataclass(frozen=True)
class Misfit:
    """sum ((model - measured) / sigma)^2 over the times and channels of `data`, as `fit` minimises it.

    data: a CSV file or arrays by name, as for `fit`. sigma: standard deviation of the noise, of all channels or by
    channel.
    """

    data: str | os.PathLike[str] | Mapping[str, Any]
    sigma: float | Mapping[str, float] = 1.0
    measured: Measurements = field(init=False, repr=False, compare=False)

    __repr__ = brief

    def __post_init__(self) -> None:
        """What `fit` raises for such data and sigmas."""
        object.__setattr__(self, "measured", measurements(self.data))
        self._sigmas()

    @property
    def channels(self) -> tuple[str, ...]:
        """The channels that it reads."""
        return self.measured.channels

    def probes(self, t_end: float, cuts: Sequence[float]) -> Iterator[Probe]:
        """Its instants; ValueError where the run ends before the last of them."""
        t, names, values = self.measured
        if t[-1] > t_end:
            raise ValueError(f"the measurements go on to t = {t[-1]:g} s, but t_end is {t_end:g} s: give a later t_end")
        for name, sigma, column in zip(names, self._sigmas(), values.T, strict=True):
            for time, value in zip(t.tolist(), column.tolist(), strict=True):
                if not np.isnan(value):
                    yield Probe(time, name, sigma**-2, value, squared=True)

    def _sigmas(self) -> list[float]:
        names = self.measured.channels
        if not isinstance(self.sigma, Mapping):
            sizes = [arguments.number("sigma", self.sigma)] * len(names)
        else:
            missing = [name for name in names if name not in self.sigma]
            if missing or len(self.sigma) > len(names):
                raise ValueError(f"sigma has {', '.join(self.sigma)}, but the channels are {', '.join(names)}")
            sizes = [arguments.number(f'sigma["{name}"]', self.sigma[name]) for name in names]
        if not min(sizes) > 0.0:
            raise ValueError("sigma is a standard deviation: give positive numbers")
        return sizes


@dataclass(frozen=True)
class TimeIntegral:
    """`weight` times the integral over the run of a channel c, or of (c - level)^2 if `squared`.

    It is found by Gauss's rule of NODES points in each of `panels` equal intervals, which are divided further wherever
    something jumps: at events, at the instants of sampled controllers, at the ends of pulses.
    """

    channel: str
    squared: bool = False
    level: float = 0.0
    weight: float = 1.0
    panels: int = 100

    def __post_init__(self) -> None:
        """TypeError or ValueError for arguments that make no sense."""
        object.__setattr__(self, "channel", _named(self.channel))
        for name in ("level", "weight"):
            object.__setattr__(self, name, arguments.number(name, getattr(self, name)))
        object.__setattr__(self, "panels", arguments.whole("panels", self.panels))
        if not 1 <= self.panels <= MOST_PANELS:
            raise ValueError(f"panels is {self.panels}: an integral takes from 1 to {MOST_PANELS} of them")
        if self.level and not self.squared:
            raise ValueError("level is subtracted from a channel that is squared: set squared=True, or leave it out")

    @property
    def channels(self) -> tuple[str, ...]:
        """The channels that it reads."""
        return (self.channel,)

    def probes(self, t_end: float, cuts: Sequence[float]) -> Iterator[Probe]:
        """Its instants, none of which is a cut."""
        ends = np.unique([*np.linspace(0.0, t_end, self.panels + 1), *cuts])
        x, w = np.polynomial.legendre.leggauss(NODES)
        for start, stop in zip(ends[:-1], ends[1:], strict=True):
            half = 0.5 * (stop - start)
            for place, weight in zip((start + half * (1.0 + x)).tolist(), (half * w).tolist(), strict=True):
                yield self.at(place)._replace(weight=self.weight * weight)

    def at(self, t: float) -> Probe:
        """The integrand at one time, by which the integral changes if an event moves past it."""
        return Probe(t, self.channel, self.weight, self.level, self.squared)


ScalarTerm = FinalValue | Misfit | TimeIntegral


def _named(channel: Any) -> str:
    if not isinstance(channel, str):
        raise TypeError(f"a channel is named by a string, not by {channel!r}")
    return channel


def terms_of(of: ScalarTerm | Sequence[ScalarTerm]) -> tuple[ScalarTerm, ...]:
    """The terms of a scalar; TypeError or ValueError for anything else."""
    terms = (of,) if isinstance(of, ScalarTerm) else tuple(of) if isinstance(of, Sequence) else (of,)
    for term in terms:
        if not isinstance(term, ScalarTerm):
            raise TypeError(
                f"of is {term!r}: give a FinalValue, a Misfit or a TimeIntegral, or a list of them, which are added"
            )
    if not terms:
        raise ValueError("the scalar has no terms: give a FinalValue, a Misfit or a TimeIntegral")
    return terms
