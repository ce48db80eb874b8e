"""Whether the stored reference of a case notices a fault, as for a foreign code, of which there is no true run.

A channel counts if the engine's own true run agrees with the reference: otherwise a difference is no evidence of the
fault. The faulty answer has the uncertainty of the true run, to which that of the reference is added.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import msgspec

from crosscheck.judging.against_reference import ReferenceSignals, at_samples, hold, of_record, shared_times
from crosscheck.judging.results import Result
from crosscheck.judging.verdict import Signal, compare
from crosscheck.library.patterns import most_specific
from crosscheck.mutation.score import ShownIn
from crosscheck.mutation.subject import JudgedVariant
from crosscheck.records.kinds import ReferenceGoals
from crosscheck.running.plan import recorded_reference
from flexmb.kept import kept
from flexmb.typing import Real


@dataclass(frozen=True)
class ByReference:
    """The reference of a subject and the engine's finished true run; `asked` are its goals and scales."""

    true: Result
    reference: ReferenceSignals
    asked: ReferenceGoals

    @kept
    def trusted(self) -> frozenset[str]:
        verdicts = hold(self.true, self.reference, self.asked, self.true.open)
        return frozenset(name for name, _, finding in verdicts if finding.status == "agree")

    def of_scene(self, faulty: Result) -> dict[str, ShownIn]:
        """The findings on the run of a faulty scene by channel, or by pattern if it did not finish."""
        verdicts = hold(faulty, self.reference, self.asked, self.true.open, like=self.true)
        return {
            name: ShownIn(status=finding.status, E=finding.E, U=finding.U, goal=goal)
            for name, goal, finding in verdicts
            if name in self.trusted or (self.trusted and faulty.status != "finished")
        }

    def of_answer(self, wrong: Mapping[str, Real]) -> dict[str, ShownIn]:
        """The findings on falsified channels (T, k) of the true run, those that the reference has."""
        places = shared_times(self.reference.times, self.true.times)
        shown = {}
        for name in self.trusted & set(wrong):
            assert places is not None  # otherwise no channel would be trusted
            pattern = most_specific(self.asked.goals, name)
            assert pattern is not None
            goal, scaled = self.asked.goals[pattern], most_specific(self.asked.scales, name)
            right = self.true.signal(name, across=False)
            false = at_samples(Signal(wrong[name], right.uncertainty, right.sizes), places)
            scale = None if scaled is None else self.asked.scales[scaled]
            finding = compare(name, false, self.reference.signal(name), goal, scale)
            shown[name] = ShownIn(status=finding.status, E=finding.E, U=finding.U, goal=goal)
        return shown


def by_reference(what: JudgedVariant, true: Result) -> ByReference | str:
    """The stored reference of the subject's case, or why there is none that can be used."""
    run = msgspec.structs.replace(what.case.run, variants=(what.variant,))
    recorded = recorded_reference(what.case, run)
    if recorded is None or recorded.variant != what.variant.name:
        return "the case has no stored reference of this variant that the engine is held against"
    if recorded.fault:
        return f"the stored reference cannot be used: {recorded.fault}"
    if true.status != "finished":
        return f"there is no true run: {true.message}"
    references = ByReference(true, of_record(recorded), recorded.asked[what.engine])
    return references if references.trusted else "the engine's true run agrees with the stored reference in no channel"
