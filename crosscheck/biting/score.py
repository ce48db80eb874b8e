"""Mutation scores: which share of the deliberate faults a case notices, whole and channel by channel."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Literal

import msgspec

from crosscheck.biting.mutants import PassedOver
from crosscheck.judging.verdict import Status

Outcome = Literal["noticed", "missed", "no mutant", "not judged"]
ENOUGH = 0.95


class ShownIn(msgspec.Struct, frozen=True, kw_only=True):
    """What one channel says of a mutant; `E`, `U` and `goal` relative to the channel's range, as in verdicts."""

    status: Status
    E: float | None
    U: float | None
    goal: float


class Mutant(msgspec.Struct, frozen=True, kw_only=True):
    """One deliberate fault, of the scene or planted in the engine's answer, and what came of it.

    "noticed": a channel differs, or the run diverged, or was stopped after many times the true run's time. "missed": it
    ran, and nothing differs. "no mutant": the engine refuses or cannot run the faulty scene. "not judged": it crashed,
    was stopped too soon to tell, or did not run. `beyond_goal` says whether it would be noticed also in a code that
    just meets the goals: a channel differs by more than its goal.

    `by_reference` is the outcome where all there is to judge by is the case's stored reference, in the channels
    `reference`; None where it has no channel that the fault is in, or there is no reference to judge by.
    """

    mutation: str
    target: str
    of: Literal["scene", "answer"]
    outcome: Outcome
    beyond_goal: bool
    reason: str
    channels: dict[str, ShownIn]
    by_reference: Outcome | None = None
    reference: dict[str, ShownIn] = {}


class ChannelScore(msgspec.Struct, frozen=True, kw_only=True):
    """How many of the mutants that were judged in a channel it has noticed."""

    noticed: int
    mutants: int


class CaseBite(msgspec.Struct, frozen=True, kw_only=True):
    """How a case bites: `score` is the share of mutants noticed, None where there is none; `score_at_goals` of those
    noticed beyond a goal; `score_by_reference` of what the stored reference judges, None with the reason in
    `no_reference` where it judges nothing."""

    case: str
    variant: str
    engine: str
    score: float | None
    score_at_goals: float | None
    score_by_reference: float | None = None
    no_reference: str = ""
    channels: dict[str, ChannelScore]
    mutants: tuple[Mutant, ...]
    passed_over: tuple[PassedOver, ...]

    @property
    def counted(self) -> tuple[Mutant, ...]:
        """The mutants that the score is taken over."""
        return tuple(each for each in self.mutants if each.outcome in ("noticed", "missed"))

    @property
    def missed(self) -> tuple[Mutant, ...]:
        return tuple(each for each in self.mutants if each.outcome == "missed")

    @property
    def not_judged(self) -> tuple[Mutant, ...]:
        return tuple(each for each in self.mutants if each.outcome == "not judged")


def outcome(channels: dict[str, ShownIn], patient: bool = False) -> tuple[Outcome, bool]:
    """What came of a mutant with these verdicts, and whether beyond a goal. Without any verdict it is not judged.

    `patient`: one that did not finish had many times the true run's time, and so has another motion: noticed.
    """
    found = {each.status for each in channels.values()}
    if "differ" in found:
        beyond = any(
            each.status == "differ" and each.E is not None and each.goal < each.E for each in channels.values()
        )
        return "noticed", beyond
    if found == {"diverged"} or (patient and found == {"did not finish"}):
        return "noticed", True
    if found and found <= {"refused", "failed"}:
        return "no mutant", False
    if not found or found & {"did not finish", "crashed", "did not run"}:
        return "not judged", False
    return "missed", False


def bite(
    case: str,
    variant: str,
    engine: str,
    mutants: Sequence[Mutant],
    passed_over: Iterable[PassedOver],
    no_reference: str = "",
) -> CaseBite:
    """The scores of a case from what came of its mutants."""
    counted = [each for each in mutants if each.outcome in ("noticed", "missed")]
    channels: dict[str, ChannelScore] = {}
    for mutant in counted:
        for name, shown in mutant.channels.items():
            before = channels.get(name, ChannelScore(noticed=0, mutants=0))
            noticed = before.noticed + (shown.status == "differ")
            channels[name] = ChannelScore(noticed=noticed, mutants=before.mutants + 1)
    return CaseBite(
        case=case,
        variant=variant,
        engine=engine,
        score=_share([each.outcome == "noticed" for each in counted]),
        score_at_goals=_share([each.beyond_goal for each in counted]),
        score_by_reference=_share([each.by_reference == "noticed" for each in counted if _referred(each)]),
        no_reference=no_reference,
        channels=dict(sorted(channels.items())),
        mutants=tuple(mutants),
        passed_over=tuple(passed_over),
    )


def mean(scores: Iterable[float | None]) -> float | None:
    """Mean of the cases' scores, each case counting the same; None without any."""
    known = [score for score in scores if score is not None]
    return sum(known) / len(known) if known else None


def _referred(mutant: Mutant) -> bool:
    """Whether the stored reference has said anything of a mutant."""
    return mutant.by_reference in ("noticed", "missed")


def _share(hits: Sequence[bool]) -> float | None:
    return sum(hits) / len(hits) if hits else None
