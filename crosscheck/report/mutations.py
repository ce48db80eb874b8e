"""The mutation scores of a session, as `crosscheck mutate` leaves them in `mutation.json` beside the records."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import msgspec

from flexmb.scene.reading import read_text

FILE = "mutation.json"
_Share = Annotated[float, msgspec.Meta(ge=0.0, le=1.0)]


class ScoredMutation(msgspec.Struct, frozen=True, kw_only=True):
    """A physical fault that was planted in a case: whether it was noticed, and by which channels."""

    mutation: str
    target: str = ""
    noticed: bool | None = None  # None where the mutation does not apply
    channels: dict[str, bool] = {}
    reason: str = ""

    @property
    def by(self) -> str:
        return f"{sum(self.channels.values())} of {len(self.channels)}" if self.channels else ""


class CaseScore(msgspec.Struct, frozen=True, kw_only=True):
    """The share of the applicable mutations that a case noticed, and that its stored reference noticed.

    None if no mutation is applicable, or there is no reference.
    """

    score: float | None
    by_reference: float | None = None
    mutations: tuple[ScoredMutation, ...] = ()


class Scores(msgspec.Struct, frozen=True, kw_only=True):
    cases: dict[str, CaseScore] = {}
    error: str = ""


class _Shown(msgspec.Struct):
    """The status of a mutant in one channel."""

    status: str


class _Mutant(msgspec.Struct):
    mutation: str
    target: str
    outcome: Literal["noticed", "missed", "no mutant", "not judged"]
    reason: str
    channels: dict[str, _Shown]


class _PassedOver(msgspec.Struct):
    mutation: str
    target: str
    reason: str


class _Case(msgspec.Struct):
    """A case in the file; `docs/mutations.md` explains every key."""

    case: str
    score: _Share | None
    mutants: tuple[_Mutant, ...]
    passed_over: tuple[_PassedOver, ...]
    score_by_reference: _Share | None = None


class _File(msgspec.Struct):
    cases: tuple[_Case, ...]


def read_scores(out: Path) -> Scores:
    """The scores in a folder; none if there is no file, the error if it cannot be read."""
    file = out / FILE
    if not file.is_file():
        return Scores()
    try:
        file_content = msgspec.json.decode(read_text(file), type=_File)
    except (ValueError, OSError, RecursionError) as error:
        return Scores(error=f"{FILE} cannot be read: {error}")
    cases = {case.case: _score(case) for case in file_content.cases}
    if len(cases) < len(file_content.cases):
        return Scores(error=f"{FILE} cannot be read: it names a case twice")
    return Scores(cases=cases)


def _score(case: _Case) -> CaseScore:
    mutations = [_scored(mutant) for mutant in case.mutants]
    mutations += [ScoredMutation(mutation=p.mutation, target=p.target, reason=p.reason) for p in case.passed_over]
    return CaseScore(score=case.score, by_reference=case.score_by_reference, mutations=tuple(mutations))


def _scored(mutant: _Mutant) -> ScoredMutation:
    judged = mutant.outcome in ("noticed", "missed")
    return ScoredMutation(
        mutation=mutant.mutation,
        target=mutant.target,
        noticed=mutant.outcome == "noticed" if judged else None,
        channels={name: channel.status == "differ" for name, channel in mutant.channels.items()},
        reason=mutant.reason if judged else f"{mutant.outcome}: {mutant.reason}",
    )
