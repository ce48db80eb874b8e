"""A comparison of two sides as a case states it, and its verdicts from findings."""

from __future__ import annotations

from dataclasses import dataclass

from crosscheck.judging.basis import changed
from crosscheck.judging.figures import worse
from crosscheck.judging.verdict import Finding, Status, Verdict, VerdictKind
from crosscheck.library.accepted import key
from crosscheck.library.case import ComparisonSide
from crosscheck.records.kinds import CaseRecord


@dataclass(frozen=True)
class Question:
    """The two sides, the status expected of every channel, and why if that is not agreement.

    `basis` is the basis of the figures (`crosscheck.judging.basis`).
    """

    case: CaseRecord
    name: str
    kind: VerdictKind
    a: ComparisonSide
    b: ComparisonSide
    expected: Status
    why: str
    basis: str = ""

    def verdict(self, channel: str, goal: float, finding: Finding, beyond: str = "") -> Verdict:
        """The verdict on one channel; `beyond` says how a finding of the expected status is outside its bounds."""
        place = key(channel, (self.a.engine, self.a.variant), (self.b.engine, self.b.variant))
        accepted = self.case.accepted.get(self.name, {}).get(place) if self.kind != "control" else None
        infos = self.case.variants
        levels = dict.fromkeys(infos[side.variant].level for side in (self.a, self.b) if side.variant in infos)
        return Verdict(
            case=self.case.case,
            comparison=self.name,
            kind=self.kind,
            channel=channel,
            variant_a=self.a.variant,
            engine_a=self.a.engine,
            variant_b=self.b.variant,
            engine_b=self.b.engine,
            level=" / ".join(levels),
            status=finding.status,
            expected=self.expected,
            E=finding.E,
            U=finding.U,
            goal=goal,
            scale=finding.scale,
            reason=f"{finding.reason}; {beyond}" if beyond and beyond != finding.reason else finding.reason,
            expected_reason=self.why,
            outside=beyond,
            accepted=accepted,
            worse=worse(accepted, finding.E, finding.U),
            stale="" if accepted is None else changed(accepted.of, self.basis),
            basis=self.basis,
        )
