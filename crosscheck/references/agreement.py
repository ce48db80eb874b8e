"""A reference from routes: every channel by two independent routes that agree, its uncertainty, and the horizon.

With E = max |a - b| of the route a that gives the values and another route b, and their numerical U,

    E <= U_a + U_b, both finite, is required of all routes,      uncertainty = max(U_a, every E).

where a witness, another code that is known less well, has to agree but adds nothing to the uncertainty.
E is at least the error of a unless both routes err alike, and U_a is the estimate of the first route
itself. The least stated uncertainty is that of 17 digits and of the rounding of one operation, eps times the
size of the channel's family.

**Horizon.** In chaotic motion U grows until nothing is known. The reference ends at the last sample before the U of a
position or an orientation exceeds `KNOWN` of the range that the channel's family has up to there: beyond, the routes
still agree within their uncertainties, but say nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np
from scipy.interpolate import CubicSpline

from crosscheck.library.case import CaseError, PublishedNumber
from crosscheck.library.reference import Known
from crosscheck.references.routes import RouteSignals
from flexmb.run.channels import distance, family, magnitude, matches, signal_range, unit
from flexmb.typing import Real

EPS = float(np.finfo(np.float64).eps)
KNOWN = 1e-3
MOTION = (".position", ".orientation")
ADVICE = "ask for finer efforts, or put right what is wrong with one of the two"


@dataclass(frozen=True)
class Agreed:
    """The channels (T, k) on which routes agree at `times` (T,), in SI and World axes, with their uncertainties."""

    times: Real
    channels: dict[str, Real]
    known: dict[str, Known]


def agree(routes: Sequence[RouteSignals], patterns: Sequence[str]) -> Agreed:
    """The reference that the routes make of the channels that `patterns` name, all that two routes offer if none.

    CaseError names each channel for which there are no two independent routes, or where two do not agree.
    """
    wanted = _wanted(routes, patterns)
    until = _horizon(routes, wanted)
    offering = {channel: [route for route in routes if channel in route.channels] for channel in wanted}
    problems = [text for channel in wanted for text in _problems(channel, offering[channel], until)]
    if problems:
        raise CaseError("\n".join(problems))
    return Agreed(
        routes[0].times[:until],
        {channel: offering[channel][0].channels[channel][:until] for channel in wanted},
        {channel: _known(channel, offering[channel], until) for channel in wanted},
    )


def _problems(channel: str, routes: Sequence[RouteSignals], until: int) -> Iterator[str]:
    """Why the routes that offer a channel give no reference of it."""
    first, *others = routes
    for other in others:
        if other.channels[channel].shape != first.channels[channel].shape:
            yield f"[reference] {channel}: {first.title} and {other.title} give it other shapes: correct one of the two"
            return
    equal = [other for other in others if not other.witness]
    if not any(first.independent_of(other) for other in equal):
        yield _alone(channel, first, equal)
    for route in (first, *others):
        if not np.isfinite(_doubt(route, channel, until)):
            how = route.uncertainties[channel].how
            yield f"[reference] {channel}: the uncertainty of {route.title} is none ({how}): {ADVICE}"
    for other in others:
        error, when = _distance(channel, first, other, until)
        doubt = _doubt(first, channel, until) + _doubt(other, channel, until)
        if not error <= doubt:
            yield _disagreement(channel, first, other, error, doubt, when)


def _known(channel: str, routes: Sequence[RouteSignals], until: int) -> Known:
    """The uncertainty of a channel on which routes agree."""
    first, *others = routes
    errors = [(other, _distance(channel, first, other, until)[0]) for other in others]
    apart = [error for other, error in errors if not other.witness]
    own = _doubt(first, channel, until)
    words = [f"U {own:.1e} of {first.name}: {first.uncertainties[channel].how}"]
    words += [f"E {error:.1e} to {other.name}{_as_witness(other, channel, until)}" for other, error in errors]
    return Known(
        uncertainty=_rounded_up(max(own, *apart, _floor(channel, first.channels, until))),
        scale=float(f"{signal_range(channel, first.channels[channel][:until]):.3g}"),
        how="; ".join(words),
    )


def _as_witness(route: RouteSignals, channel: str, until: int) -> str:
    """What is said of a witness: how well it knows the channel itself."""
    return f", a witness known to {_doubt(route, channel, until):.1e}" if route.witness else ""


def _wanted(routes: Sequence[RouteSignals], patterns: Sequence[str]) -> list[str]:
    """The channels of the reference, in the order of the routes; those that only one route offers if asked for."""
    routes = [route for route in routes if not route.witness]
    offered = list(dict.fromkeys(chain.from_iterable(route.channels for route in routes)))
    if not patterns:
        twice = [name for name in offered if sum(name in route.channels for route in routes) > 1]
        if not twice:
            raise CaseError("[reference] no channel is offered by two of its routes: add a route that offers the same")
        return twice
    for pattern in patterns:
        if not any(matches(pattern, name) for name in offered):
            raise CaseError(f'[reference] channels: no route offers "{pattern}"; they offer {", ".join(offered)}')
    return [name for name in offered if any(matches(pattern, name) for pattern in patterns)]


def _horizon(routes: Sequence[RouteSignals], wanted: Iterable[str]) -> int:
    """The number of samples up to the horizon; CaseError if it is zero."""
    until = len(routes[0].times)
    for channel in wanted:
        if channel.endswith(MOTION):
            first = next(route for route in routes if channel in route.channels)
            reach = np.maximum.accumulate(_family_reach(channel, first.channels))
            unsure = first.uncertainties[channel].envelope > KNOWN * np.maximum(reach, KNOWN * reach[-1])
            until = min(until, int(np.argmax(unsure)) if np.any(unsure) else until)
    if until < 2:
        raise CaseError(
            "[reference] the motion is unknown from the start: a position or an orientation has an uncertainty of "
            f"more than {KNOWN:g} of its range: ask for finer efforts"
        )
    return until


def _family_reach(channel: str, channels: Mapping[str, Real]) -> Real:
    """The range (T,) of the family's channels up to each sample."""
    kin = [name for name in channels if family(name) == family(channel)]
    starts = {name: np.broadcast_to(channels[name][:1], channels[name].shape) for name in kin}
    return np.max([distance(name, channels[name], starts[name]) for name in kin], axis=0)


def _doubt(route: RouteSignals, channel: str, until: int) -> float:
    return float(route.uncertainties[channel].envelope[until - 1])


def _distance(channel: str, one: RouteSignals, other: RouteSignals, until: int) -> tuple[float, float]:
    """The largest distance up to the horizon, and its time (s)."""
    apart = distance(channel, one.channels[channel][:until], other.channels[channel][:until])
    worst = int(np.argmax(apart))
    return float(apart[worst]), float(one.times[worst])


def _floor(channel: str, channels: Mapping[str, Real], until: int) -> float:
    """The uncertainty by 17 digits and the rounding of one operation; of a zero signal eps of its unit."""
    sizes = [magnitude(name, rows[:until]) for name, rows in channels.items() if family(name) == family(channel)]
    return EPS * (max(sizes) or 1.0)


def _rounded_up(number: float) -> float:
    """Two digits, not below the number."""
    rounded = float(f"{number:.1e}")
    return rounded if rounded >= number else float(f"{number * 1.05:.1e}")


def _alone(channel: str, first: RouteSignals, others: Sequence[RouteSignals]) -> str:
    if not others:
        return f"[reference] {channel} is offered by {first.title} alone: add a route that offers it, or leave it out"
    shared = ", ".join(other.title for other in others)
    remedy = "take another code, or another engine of ours with another integrator"
    return f"[reference] {channel}: no route is independent of {first.title} ({shared}): {remedy}"


def _disagreement(
    channel: str, first: RouteSignals, other: RouteSignals, error: float, doubt: float, when: float
) -> str:
    symbol = unit(channel)
    return (
        f"[reference] {channel}: {first.title} and {other.title} are {error:.3g} {symbol} apart at t = {when:.6g} s, "
        f"and their uncertainties are {doubt:.3g} {symbol} together: {ADVICE}"
    )


# Comparison of a reference with published numbers, within the uncertainties of both.

COMPONENTS = {1: ("",), 3: ("x", "y", "z"), 4: ("w", "x", "y", "z")}


def meet(agreed: Agreed, anchors: Iterable[PublishedNumber]) -> None:
    """CaseError names every published number that the reference does not meet.

    Between samples the reference is interpolated by a cubic spline, whose error is estimated by leaving out every
    second sample.
    """
    problems = [text for place, anchor in enumerate(anchors) if (text := _fault(agreed, anchor, place))]
    if problems:
        raise CaseError("\n".join(problems))


def _fault(agreed: Agreed, anchor: PublishedNumber, place: int) -> str:
    """Why the number is not met; "" if it is."""
    where = f"provenance.toml, anchor {place + 1} ({anchor.channel}, {anchor.source})"
    if anchor.channel not in agreed.channels:
        return f"{where}: the reference has no such channel: correct its name, or add it to [reference] channels"
    rows = agreed.channels[anchor.channel]
    letters = COMPONENTS.get(rows.shape[1], tuple(map(str, range(rows.shape[1]))))
    if anchor.component not in letters:
        return f'{where}: there is no component "{anchor.component}": it is one of {", ".join(letters)}'
    if not agreed.times[0] <= anchor.t_s <= agreed.times[-1]:
        return f"{where}: {anchor.t_s:g} s is not within the reference, which ends at {agreed.times[-1]:g} s"
    value, doubt = _at(agreed.times, rows[:, letters.index(anchor.component)], anchor.t_s)
    known = anchor.uncertainty + agreed.known[anchor.channel].uncertainty + doubt
    if abs(value - anchor.value) <= known:
        return ""
    return (
        f"{where}: the number is {anchor.value:.10g} {unit(anchor.channel)} at {anchor.t_s:g} s and the reference has "
        f"{value:.10g}, {abs(value - anchor.value):.2g} away, where both together are known to {known:.2g}: find out "
        "which of the two is wrong"
    )


def _at(times: Real, values: Real, when: float) -> tuple[float, float]:
    """The value at a time, and the error of interpolation."""
    nearest = int(np.argmin(np.abs(times - when)))
    if abs(times[nearest] - when) <= 1e-9 * times[-1]:
        return float(values[nearest]), 0.0
    if len(times) < 8:
        return float(np.interp(when, times, values)), float(np.max(np.abs(np.diff(values))))
    value = float(CubicSpline(times, values)(when))
    every_second = [float(CubicSpline(times[first::2], values[first::2])(when)) for first in (0, 1)]
    return value, max(abs(sample - value) for sample in every_second)
