"""Mutation scores: the share of the deliberate faults that a case notices, in total and by channel."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Literal

import msgspec

from crosscheck.judging.verdict import Status
from crosscheck.mutation.mutants import PassedOver

Outcome = Literal["noticed", "missed", "no mutant", "not judged"]
ENOUGH = 0.95


class ShownIn(msgspec.Struct, frozen=True, kw_only=True):
    """The finding on a mutant in one channel; `E`, `U` and `goal` are relative to the channel's range."""

    status: Status
    E: float | None
    U: float | None
    goal: float


class Mutant(msgspec.Struct, frozen=True, kw_only=True):
    """One deliberate fault, of the scene or planted in the engine's answer, and its outcome.

    "noticed": a channel differs, or the run diverged, or was stopped after many times the true run's time. "missed": it
    ran, and nothing differs. "no mutant": the engine refuses or cannot run the faulty scene. "not judged": it crashed,
    was stopped too soon to tell, or did not run. `beyond_goal` says whether it would be noticed also in a code that
    just meets the goals: a channel differs by more than its goal.

    `by_reference` is the outcome by the case's stored reference alone, in the channels
    `reference`; None if none of these has the fault, or there is no reference.
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
    """The numbers of mutants that were judged and noticed in a channel."""

    noticed: int
    mutants: int


class MutationScore(msgspec.Struct, frozen=True, kw_only=True):
    """The scores of a case: `score` is the share of mutants noticed, None if there are none; `score_at_goals` of those
    noticed beyond a goal; `score_by_reference` by the stored reference, None with the reason in
    `no_reference` if it judges nothing."""

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
        return tuple(mutant for mutant in self.mutants if mutant.outcome in ("noticed", "missed"))

    @property
    def missed(self) -> tuple[Mutant, ...]:
        return tuple(mutant for mutant in self.mutants if mutant.outcome == "missed")

    @property
    def not_judged(self) -> tuple[Mutant, ...]:
        return tuple(mutant for mutant in self.mutants if mutant.outcome == "not judged")


def outcome(channels: dict[str, ShownIn], patient: bool = False) -> tuple[Outcome, bool]:
    """The outcome of a mutant with these verdicts, and whether beyond a goal. Without verdicts it is not judged.

    `patient`: the time limit was many times the true run's time, so that an unfinished run counts as noticed.
    """
    found = {channel.status for channel in channels.values()}
    if "differ" in found:
        beyond = any(
            channel.status == "differ" and channel.E is not None and channel.goal < channel.E
            for channel in channels.values()
        )
        return "noticed", beyond
    if found == {"diverged"} or (patient and found == {"did not finish"}):
        return "noticed", True
    if found and found <= {"refused", "failed"}:
        return "no mutant", False
    if not found or found & {"did not finish", "crashed", "did not run"}:
        return "not judged", False
    return "missed", False


def mutation_score(
    case: str,
    variant: str,
    engine: str,
    mutants: Sequence[Mutant],
    passed_over: Iterable[PassedOver],
    no_reference: str = "",
) -> MutationScore:
    counted = [mutant for mutant in mutants if mutant.outcome in ("noticed", "missed")]
    channels: dict[str, ChannelScore] = {}
    for mutant in counted:
        for name, shown in mutant.channels.items():
            before = channels.get(name, ChannelScore(noticed=0, mutants=0))
            noticed = before.noticed + (shown.status == "differ")
            channels[name] = ChannelScore(noticed=noticed, mutants=before.mutants + 1)
    return MutationScore(
        case=case,
        variant=variant,
        engine=engine,
        score=_share([mutant.outcome == "noticed" for mutant in counted]),
        score_at_goals=_share([mutant.beyond_goal for mutant in counted]),
        score_by_reference=_share([mutant.by_reference == "noticed" for mutant in counted if _referred(mutant)]),
        no_reference=no_reference,
        channels=dict(sorted(channels.items())),
        mutants=tuple(mutants),
        passed_over=tuple(passed_over),
    )


def mean(scores: Iterable[float | None]) -> float | None:
    """Mean of the cases' scores with equal weights; None if there are none."""
    known = [score for score in scores if score is not None]
    return sum(known) / len(known) if known else None


def _referred(mutant: Mutant) -> bool:
    """Whether the stored reference judges a mutant."""
    return mutant.by_reference in ("noticed", "missed")


def _share(hits: Sequence[bool]) -> float | None:
    return sum(hits) / len(hits) if hits else None
