"""A comparison of two sides as a case states it, and its verdicts from findings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from crosscheck.engines.linear.parts import FREQUENCIES
from crosscheck.judging.basis import changed
from crosscheck.judging.figures import worse
from crosscheck.judging.verdict import Finding, Status, Verdict, VerdictKind
from crosscheck.library.accepted import key
from crosscheck.library.case import ComparisonSide
from crosscheck.library.channels import most_specific
from crosscheck.library.claims import ClaimedFailure
from crosscheck.records.kinds import CaseRecord, VariantInfo
from flexmb.typing import Real


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

    def goal(self, channel: str, goal: float) -> float:
        """The goal of a channel: the case's, or the one that its engines claim instead."""
        return self._claimed(channel, goal)[0]

    def _claimed(self, channel: str, goal: float) -> tuple[float, str]:
        """The goal of a channel, with the reason if it is claimed. A goal of 0 stands for a channel that has none."""
        if self.kind == "control" or goal == 0.0:
            return goal, ""
        claims = []
        for engine in dict.fromkeys((self.a.engine, self.b.engine)):
            goals = self.case.claims.goals_of(engine)
            pattern = most_specific(goals, channel)
            if pattern is not None:
                claimed, reason = goals[pattern]
                claims.append((claimed, f"{engine}: {reason}"))
        return max(claims, default=(goal, ""))

    def _own_failure(self, channel: str) -> ClaimedFailure | None:
        """The user's expectation of a failure where the case expects agreement; of several the last counts."""
        if self.kind == "control" or self.expected != "agree":
            return None
        mine = [failure for failure in self.case.claims.failures if failure.engine in (self.a.engine, self.b.engine)]
        found = [comparison for comparison in mine if most_specific(comparison.channels, channel) is not None]
        return found[-1] if found else None

    def verdict(self, channel: str, goal: float, finding: Finding, beyond: str = "", advice: str = "") -> Verdict:
        """The verdict on one channel, whose goal in the case is `goal`.

        `beyond` says how a finding of the expected status is outside its bounds, `advice` what to do about a large U.
        """
        place = key(channel, (self.a.engine, self.a.variant), (self.b.engine, self.b.variant))
        accepted = self.case.accepted.get(self.name, {}).get(place) if self.kind != "control" else None
        infos = self.case.variants
        claimed, why = self._claimed(channel, goal)
        failure = self._own_failure(channel)
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
            expected=self.expected if failure is None else failure.status,
            E=finding.E,
            U=finding.U,
            goal=claimed,
            scale=finding.scale,
            reason=f"{finding.reason}; {beyond}" if beyond and beyond != finding.reason else finding.reason,
            expected_reason=self.why if failure is None else failure.reason,
            outside=beyond,
            accepted=accepted,
            worse=worse(accepted, finding.E, finding.U),
            stale="" if accepted is None else changed(accepted.of, self.basis),
            basis=self.basis,
            case_goal=goal if why else None,
            goal_reason=why,
            own_failure="" if failure is None else failure.place,
            advice=advice,
        )


# Which number of a matrix of derivatives, or of a list of frequencies, two results are farthest apart in.

SYMBOL = {
    "derivatives.by_displacement": "xi",
    "derivatives.by_speed": "u",
    "derivatives.by_force": "tau",
}
"""By what a channel differentiates the accelerations."""


def coordinates_of(info: VariantInfo | None) -> tuple[str, ...]:
    """Names of a variant's coordinates; none where it asks for no derivatives."""
    return info.coordinates if info is not None and isinstance(info.coordinates, tuple) else ()


def with_worst_entry(finding: Finding, channel: str, a: Real, b: Real, times: Real, names: Sequence[str]) -> Finding:
    """The finding on two signals (T, k), whose reason names the entry in which they are farthest apart."""
    if finding.E is None or not finding.E > 0.0 or not (channel in SYMBOL or channel == FREQUENCIES):
        return finding
    apart = np.abs(a - b)
    sample, number = np.unravel_index(int(np.argmax(apart)), apart.shape)
    what, most = entry(channel, int(number), a.shape[1], names), float(apart[sample, number])
    where = f"{what} = {float(a[sample, number]):.6g} at t = {times[sample]:g} s"
    return replace(finding, reason=f"{finding.reason}; farthest apart, by {most:.2g}, is {where}")


def entry(channel: str, number: int, count: int, names: Sequence[str]) -> str:
    """The name of a column of such a channel of `count` columns, such as "d udot[elbow.rotation]/d u[slide.x]"."""
    if channel == FREQUENCIES:
        return f"frequency {number + 1} of {count}"
    n = int(np.sqrt(count))
    row, column = divmod(number, n)
    labels = names if len(names) == n else [str(k + 1) for k in range(n)]
    return f"d udot[{labels[row]}]/d {SYMBOL[channel]}[{labels[column]}]"
