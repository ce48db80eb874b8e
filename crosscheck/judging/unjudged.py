"""Channels that an engine offers and nothing judges: no comparison, conservation or reference with a goal names them.

A verdict *agree*, *differ* or *unresolved* accounts for a channel, and so does being told as not applicable. Of an
engine that the case names, the case leaves the rest open by `[[open]]` and says why, or expects agreement with nothing
of the whole run, and says why; what it does not name is excused only where some of its engines were asked for alone.
Of an engine that joins nobody has looked at it: it is held against the stored reference, or another engine of the
variant, and excused if it agrees by the loosest goal that the case has for the variant, or is the same to rounding
where uncertainties are unknown.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from crosscheck.judging.against_reference import ReferenceSignals, at_samples, of_record, shared_times
from crosscheck.judging.applicable import Inapplicable
from crosscheck.judging.results import CaseResults, Result
from crosscheck.judging.sizes import size_of
from crosscheck.judging.verdict import WHOLE_RANGE, Signal, Status, Verdict, compare, determined
from crosscheck.library.case import Comparison
from crosscheck.library.channels import most_specific
from crosscheck.library.selection import expected_otherwise
from flexmb.kept import kept
from flexmb.run.channels import distance, magnitude

ACCOUNTING: tuple[Status, ...] = ("agree", "differ", "unresolved")
ROUNDING = 1e-9  # of a signal's size: a distance within it is none, whatever is known of the uncertainties
OPEN = "the case has no goal for it"
UNSAID = f"{OPEN}, and no [[open]] with a reason"
TOLD_BY = {"energy.total": "work"}
"""What the drift of a conserved quantity judges besides the channel of its verdict, where it begins at zero.

A drift is a change since the start: a work that is wrong by a constant leaves it as it is.
"""


@dataclass(frozen=True)
class Unjudged:
    """A channel of a finished result without a verdict, and why; an `excused` one may stay so in a strict session."""

    case: str
    variant: str
    engine: str
    channel: str
    reason: str
    excused: bool

    @property
    def key(self) -> str:
        """Variant, engine and channel, as in results.json."""
        return f"{self.variant} | {self.engine} | {self.channel}"


@dataclass(frozen=True)
class UnjudgedChannels:
    """Channels of one engine on one variant that are unjudged for one reason."""

    case: str
    variant: str
    engine: str
    channels: tuple[str, ...]
    reason: str
    excused: bool

    def __str__(self) -> str:
        """The group in words."""
        names = ", ".join(self.channels)
        return f"{self.case}, {self.variant}, {self.engine} offers what nothing judges: {names}: {self.reason}"


def grouped(left: Iterable[Unjudged]) -> list[UnjudgedChannels]:
    """Unjudged channels by case, variant, engine and reason, what is not excused first."""
    channels_of: dict[tuple[str, str, str, str, bool], list[str]] = {}
    for channel in left:
        channels_of.setdefault(
            (channel.case, channel.variant, channel.engine, channel.reason, channel.excused), []
        ).append(channel.channel)
    groups = [
        UnjudgedChannels(case, variant, engine, tuple(channels), reason, excused)
        for (case, variant, engine, reason, excused), channels in channels_of.items()
    ]
    return sorted(groups, key=lambda group: group.excused)


def unjudged(
    case: CaseResults, verdicts: Iterable[Verdict], inapplicable: Iterable[Inapplicable] = ()
) -> tuple[Unjudged, ...]:
    """Every channel that nothing judges, of every finished result of the case's variants. Never raises."""
    verdicts = tuple(verdicts)
    told = {
        (*side, verdict.channel)
        for verdict in verdicts
        if verdict.kind != "control" and verdict.status in ACCOUNTING
        for side in verdict.sides
    }
    told |= set(_by_drift(case, verdicts))
    told |= {(absence.variant, absence.engine, absence.channel) for absence in inapplicable}
    results = [case.get(variant.name, engine) for variant in case.case.run.variants for engine in variant.engines]
    left = _Left(case)
    return tuple(
        left.open(result, channel)
        for result in results
        for channel in result.channels
        if (result.variant, result.engine, channel) not in told
        and not result.open.is_whole(channel, result.values(channel).shape[1])
    )


def _by_drift(case: CaseResults, verdicts: Iterable[Verdict]) -> Iterator[tuple[str, str, str]]:
    """Variant, engine and channel of what the drift of a conserved quantity accounts for."""
    for verdict in verdicts:
        if verdict.kind == "conservation" and verdict.status in ACCOUNTING and verdict.channel in TOLD_BY:
            result, channel = case.get(verdict.variant_a, verdict.engine_a), TOLD_BY[verdict.channel]
            least = ROUNDING * (verdict.scale or 0.0)
            if channel in result.channels and np.all(np.abs(result.values(channel)[:1]) <= least):
                yield result.variant, result.engine, channel


@dataclass(frozen=True)
class _Left:
    """What a case leaves open."""

    case: CaseResults

    @kept
    def _reference(self) -> ReferenceSignals | None:
        recorded = self.case.case.reference
        return None if recorded is None or recorded.fault else of_record(recorded)

    def open(self, result: Result, channel: str) -> Unjudged:
        """The channel, with why the case leaves it open, or what others say of it if the engine joined the case."""
        record = self.case.case
        if result.engine not in record.joined:
            reason = self._why_open(result, channel)
            said = reason or (UNSAID if record.whole else OPEN)
            return Unjudged(record.case, result.variant, result.engine, channel, said, bool(reason) or not record.whole)
        reason, excused = self._held(result, channel)
        expected = [failure.channels for failure in record.claims.failures if failure.engine == result.engine]
        excused = excused or any(most_specific(patterns, channel) is not None for patterns in expected)
        return Unjudged(record.case, result.variant, result.engine, channel, f"{OPEN}; {reason}", excused)

    def _why_open(self, result: Result, channel: str) -> str:
        """The reason that the case gives, also of a run that is expected to agree with nothing; "" if it gives none."""
        run = self.case.case.run
        for opening in run.open:
            if opening.concerns(result.variant, result.engine) and most_specific(opening.channels, channel) is not None:
                return opening.reason
        other = expected_otherwise(run, result.variant, result.engine)
        return "" if other is None else f"what is expected of it is {other.expect}, in '{other.name}': {other.reason}"

    def _held(self, result: Result, channel: str) -> tuple[str, bool]:
        """What the first of those who have the channel says of it, and whether that is the same."""
        for name, own, other in self._others(result, channel):
            finding = compare(channel, own, other, self._goal(result, channel))
            if finding.status == "agree" or _same(channel, own, other):
                return f"the same as {name} gives", True
            return f"{finding.status} beside {name}: {finding.reason}", False
        return "no other engine of the variant offers it", False

    def _goal(self, result: Result, channel: str) -> float:
        """The goal that the engine claims of the channel, or else the loosest of the variant's comparisons."""
        claimed = self.case.case.claims.goals_of(result.engine)
        pattern = most_specific(claimed, channel)
        if pattern is not None:
            return claimed[pattern][0]
        about = [
            comparison
            for comparison in self.case.case.run.comparisons
            if (result.variant, result.engine) in _sides(comparison)
        ]
        return max((goal for comparison in about for goal in comparison.goals.values()), default=WHOLE_RANGE)

    def _others(self, result: Result, channel: str) -> Iterator[tuple[str, Signal, Signal]]:
        """Those who have the channel, the stored reference first, with the signals of both at the same times."""
        own, recorded, stored = result.signal(channel, across=False), self.case.case.reference, self._reference
        if recorded is not None and stored is not None:
            places = shared_times(stored.times, result.times)
            if recorded.variant == result.variant and channel in stored.channels and places is not None:
                given = determined(channel, stored.signal(channel), result.open)
                yield "the reference", at_samples(own, places), given
        for engine in self.case.case.run.variant(result.variant).engines:
            other = self.case.get(result.variant, engine)
            named = engine not in self.case.case.joined
            if named and channel in other.channels and np.array_equal(other.times, result.times):
                yield engine, own, other.signal(channel, across=False)


def _sides(comparison: Comparison) -> list[tuple[str, str]]:
    return [(side.variant, side.engine) for side in comparison.sides]


def _same(channel: str, own: Signal, other: Signal) -> bool:
    """Whether the distance of two signals is none but for rounding of what the other's size is."""
    if own.values.shape != other.values.shape or own.values.size == 0:
        return False
    size = size_of(magnitude(channel, other.values), other.sizes, 0.0)
    return bool(np.max(distance(channel, own.values, other.values)) <= ROUNDING * size)
