"""Verdicts on results against the stored reference of their case; they need no other engine.

E is taken at the times of the reference, a subset of the case's times up to its horizon. U is the sum of the engine's
up to there and that of the reference. Goals and scales are those of the engine's comparisons, see
`crosscheck.library.selection.held`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from crosscheck.engines.openness import NOTHING_OPEN, Openness
from crosscheck.judging.finer_efforts import finer_efforts
from crosscheck.judging.question import Question, coordinates_of, with_worst_entry
from crosscheck.judging.results import CaseResults, Result
from crosscheck.judging.uncertainty import Uncertainty
from crosscheck.judging.verdict import Finding, Signal, Verdict, compare, determined, not_determined, with_open
from crosscheck.library.case import ComparisonSide
from crosscheck.library.channels import most_specific
from crosscheck.library.reference import StoredReference
from crosscheck.records.kinds import RecordedReference, ReferenceGoals
from crosscheck.records.packing import unpack
from flexmb.kept import kept
from flexmb.run.rounding import Sizes
from flexmb.typing import Real

NAME = "against the reference"
REFERENCE = "reference"  # the name of the other side of such a verdict
CLOCK = 1e-9  # relative difference up to which two times are the same


@dataclass(frozen=True)
class ReferenceSignals:
    """The channels (T, k) of a reference at `times` (T,), in SI and World axes, with their uncertainties (SI)."""

    times: Real
    channels: Mapping[str, Real]
    uncertainties: Mapping[str, float]

    @kept
    def _sizes(self) -> Sizes:
        return Sizes(tuple(self.channels), self.channels.__getitem__)

    def signal(self, channel: str) -> Signal:
        """The channel as input of a verdict."""
        rows, known = self.channels[channel], self.uncertainties.get(channel, np.inf)
        doubt = Uncertainty(np.full(len(rows), known), known, "stated by the reference")
        return Signal(rows, doubt, self._sizes.of(channel))


def of_stored(reference: StoredReference) -> ReferenceSignals:
    """The signals of a reference that was read from its files."""
    known = {name: channel.uncertainty for name, channel in reference.knowledge.channels.items()}
    return ReferenceSignals(reference.times, reference.channels, known)


def of_record(reference: RecordedReference) -> ReferenceSignals:
    times = np.zeros(0) if reference.times is None else unpack(reference.times)
    channels = {name: unpack(packed) for name, packed in reference.channels.items()}
    return ReferenceSignals(times, channels, reference.uncertainties)


def judge_reference(case: CaseResults) -> Iterator[Verdict]:
    """The verdicts of a case's engines against its stored reference; none if there is no reference."""
    recorded = case.case.reference
    if recorded is None:
        return
    signals = of_record(recorded)
    for engine, asked in recorded.asked.items():
        result = case.get(recorded.variant, engine)
        side = ComparisonSide(variant=recorded.variant, engine=engine)
        other = ComparisonSide(variant=recorded.variant, engine=REFERENCE)
        question = Question(case.case, NAME, "comparison", side, other, "agree", "")
        if recorded.fault:
            absent = Finding("did not run", f"the stored reference cannot be used: {recorded.fault}")
            yield from (question.verdict(pattern, goal, absent) for pattern, goal in asked.goals.items())
            continue
        names = coordinates_of(case.case.variants.get(recorded.variant))
        open_ = case.undetermined(recorded.variant)
        for channel, goal, finding in hold(result, signals, asked, open_, goal_of=question.goal, coordinates=names):
            advice = finer_efforts(case.case, channel, question.goal(channel, goal), finding, (result,))
            yield question.verdict(channel, goal, finding, advice=advice)


def hold(
    result: Result,
    reference: ReferenceSignals,
    asked: ReferenceGoals,
    undetermined: Openness = NOTHING_OPEN,
    like: Result | None = None,
    goal_of: Callable[[str, float], float] = lambda channel, goal: goal,
    coordinates: Sequence[str] = (),
) -> Iterator[tuple[str, float, Finding]]:
    """The finding on every channel of the reference that has a goal, with that goal. Never raises.

    Components that the motion leaves `undetermined` are not compared. `goal_of` replaces the goal of a channel.
    `coordinates` name the rows of derivatives. `like` is the result whose U is used: for a control that of the
    unmutated run. A kind of energy that the engine does not offer is left out; any other channel counts as refused. A
    result that did not finish has its status for each goal.
    """
    if result.status != "finished":
        ending = result.ending
        finding = Finding(ending.status, ending.reason, endings=(ending,))
        yield from ((pattern, goal, finding) for pattern, goal in asked.goals.items())
        return
    places = shared_times(reference.times, result.times)
    wanted = {name: most_specific(asked.goals, name) for name in reference.channels}
    named = [(name, pattern) for name, pattern in wanted.items() if pattern is not None]
    if places is None or not named:
        what = "it has no channel with a goal" if places is not None else "its times are not among the case's"
        finding = Finding("did not run", f"the stored reference says nothing here: {what}: regenerate it")
        yield from ((pattern, goal, finding) for pattern, goal in asked.goals.items())
        return
    for channel, pattern in named:
        goal = asked.goals[pattern]
        if undetermined.is_whole(channel, reference.channels[channel].shape[1]):
            yield channel, goal, not_determined()
        elif channel in result.channels:
            scaled = most_specific(asked.scales, channel)
            scale = asked.scales[scaled] if scaled is not None else None
            own = at_samples(result.control_signal(channel, like or result, across=False), places)
            own, stored = (determined(channel, each, undetermined) for each in (own, reference.signal(channel)))
            verdict = compare(channel, own, stored, goal_of(channel, goal), scale)
            verdict = with_open(verdict, channel, undetermined)
            apart = with_worst_entry(verdict, channel, own.values, stored.values, reference.times, coordinates)
            yield channel, goal, apart
        elif not channel.startswith("energy."):
            yield channel, goal, Finding("refused", f"{result.engine} does not offer {channel}")


def shared_times(wanted: Real, given: Real) -> np.ndarray | None:
    """The indices of the `wanted` times (s) among those `given`, both rising; None unless all are there.

    The tolerance is relative to the largest wanted time, since a given time of 1e308 s must not make all others equal.
    """
    if not (len(wanted) and len(given)):
        return None
    after = np.minimum(np.searchsorted(given, wanted), len(given) - 1)
    before = np.maximum(after - 1, 0)
    places = np.where(np.abs(given[before] - wanted) < np.abs(given[after] - wanted), before, after)
    return places if np.all(np.abs(given[places] - wanted) <= CLOCK * np.max(np.abs(wanted))) else None


def at_samples(signal: Signal, places: np.ndarray) -> Signal:
    """A signal at some of its samples, with its U up to the last of them."""
    envelope = signal.uncertainty.envelope[places]
    doubt = Uncertainty(envelope, float(envelope[-1]), signal.uncertainty.how, signal.uncertainty.order)
    return Signal(signal.values[places], doubt, signal.sizes)
