"""What engines that joined a case cannot represent of it: *not applicable*, which is not a verdict.

A case expects something only of the engines that it names. An engine that joins by `--engine` may refuse the scene or
lack a channel; this is listed with the engine's reason. It remains a verdict for an engine that the case names, or for
which it has accepted figures. Loads of redundant closures, which the motion does not determine, have no verdict either.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from typing import Literal, assert_never

from crosscheck.judging.against_reference import REFERENCE
from crosscheck.judging.results import CaseResults, Result
from crosscheck.judging.verdict import NOT_DETERMINED, Verdict
from crosscheck.library.channels import most_specific
from flexmb.run.channels import matches

Kind = Literal["refused", "not offered", "not determined", "partly determined"]
"""The engine refuses the scene; it lacks the channel; the motion of the scene determines none of the channel's
components, or not all of them."""


@dataclass(frozen=True)
class Inapplicable:
    """What has no verdict, with the `reason`. `channel` is "" where the engine refused the whole variant, and
    "load:pin.force[y, z]" where some components of one have no verdict."""

    case: str
    variant: str
    engine: str
    channel: str
    reason: str
    kind: Kind

    @property
    def lies_with_engine(self) -> bool:
        """Whether the engine lacks something; otherwise the scene leaves it open to all."""
        match self.kind:
            case "refused" | "not offered":
                return True
            case "not determined" | "partly determined":
                return False
            case _:
                assert_never(self.kind)

    @property
    def where(self) -> str:
        """The variant and the channel, in words."""
        return f"{self.variant}, {self.channel}" if self.channel else self.variant


def set_apart(case: CaseResults, verdicts: Iterable[Verdict]) -> tuple[list[Verdict], tuple[Inapplicable, ...]]:
    """The verdicts that count, and what is not applicable, each only once."""
    joined = {engine for engine in case.case.joined if not _has_figures(case, engine)}
    refused = [result for result in case.results.values() if result.status == "refused" and result.engine in joined]
    absences = {_inapplicable(case, result, ""): None for result in refused}
    counting: list[Verdict] = []
    for verdict in verdicts:
        open_ = case.undetermined(verdict.variant_a, verdict.variant_b)
        whole = verdict.status == "refused" and verdict.reason == NOT_DETERMINED
        if whole or (verdict.channel in open_ and verdict.E is not None):
            kind: Kind = "not determined" if whole else "partly determined"
            named = verdict.channel if whole else open_.name(verdict.channel)
            for variant, engine in dict.fromkeys(verdict.sides):
                apart = Inapplicable(case.case.case, variant, engine, named, NOT_DETERMINED, kind)
                absences |= {apart: None} if engine != REFERENCE else {}
        if whole:
            continue
        refusing = _refusing(case, verdict)
        if verdict.ok or not refusing or any(result.engine not in joined for result in refusing):
            counting.append(verdict)
        else:
            absences |= {_inapplicable(case, result, verdict.channel): None for result in refusing}
    energies = tuple(_energies_left_out(case, joined))
    return counting, (
        *(pattern for pattern in absences if not any(_includes(pattern, energy) for energy in energies)),
        *energies,
    )


def _includes(pattern: Inapplicable, one: Inapplicable) -> bool:
    """Whether the pattern of the first includes the channel of the second, of the same variant and engine."""
    same = (pattern.variant, pattern.engine) == (one.variant, one.engine)
    return same and bool(pattern.channel) and matches(pattern.channel, one.channel)


def _energies_left_out(case: CaseResults, joined: Collection[str]) -> Iterator[Inapplicable]:
    """Kinds of energy with a goal that other results have and an engine does not offer; they have no verdict."""
    reference = case.case.reference
    for (_, engine, role), result in case.results.items():
        if engine not in joined or role != "main" or result.status != "finished":
            continue
        goals = {pattern for item in case.case.run.comparisons for pattern in item.goals}
        known = {name for other in case.results.values() if other.variant == result.variant for name in other.channels}
        if reference is not None and reference.variant == result.variant:
            goals |= set(reference.asked[engine].goals) if engine in reference.asked else set()
            known |= set(reference.channels)
        for name in sorted(known - set(result.channels)):
            if name.startswith("energy.") and most_specific(goals, name) is not None:
                yield _inapplicable(case, result, name)


def _refusing(case: CaseResults, verdict: Verdict) -> list[Result]:
    """The results because of which there is nothing to judge: refusals of the scene, or results without the channel.

    Empty if the reason is graver than a refusal.
    """
    sides = [case.results.get((*side, "main")) for side in verdict.sides]
    results = [result for result in sides if result is not None]
    if verdict.status == "refused":
        refused = [result for result in results if result.status == "refused"]
        return refused or [result for result in results if verdict.channel not in result.channels]
    if verdict.status == "did not run" and len(results) == len(sides):  # no channel has the name of a goal
        finished = all(result.status == "finished" for result in results)
        return [result for result in results if not _has(result, verdict.channel)] if finished else []
    return []


def _has(result: Result, pattern: str) -> bool:
    return any(matches(pattern, name) for name in result.channels)


def _inapplicable(case: CaseResults, result: Result, channel: str) -> Inapplicable:
    where = case.case.case, result.variant, result.engine
    if result.status == "refused":
        return Inapplicable(*where, "", result.message, "refused")
    return Inapplicable(*where, channel, f"{result.engine} does not offer it", "not offered")


def _has_figures(case: CaseResults, engine: str) -> bool:
    """Whether figures of the engine were accepted: then it is expected to give results again."""
    places = (place for table in case.case.accepted.values() for place in table)
    return any(side.startswith(f"{engine} (") for place in places for side in place.split(" | ")[1:])
