"""The mutation scores of a session, as `crosscheck mutate` leaves them in `mutation.json` beside the records."""

from __future__ import annotations

from pathlib import Path

import msgspec

FILE = "mutation.json"


class ScoredMutation(msgspec.Struct, frozen=True, kw_only=True):
    """A physical fault that was planted in a case: whether it was noticed, and by which channels."""

    mutation: str
    target: str = ""
    noticed: bool | None = None  # None where the mutation does not apply
    channels: dict[str, bool] = {}
    reason: str = ""

    @property
    def by(self) -> str:
        """How many of the channels noticed it."""
        return f"{sum(self.channels.values())} of {len(self.channels)}" if self.channels else ""


class CaseScore(msgspec.Struct, frozen=True, kw_only=True):
    """The part of the applicable mutations that a case noticed (None where none applies), and each of them."""

    score: float | None
    mutations: tuple[ScoredMutation, ...] = ()


class Scores(msgspec.Struct, frozen=True, kw_only=True):
    """The scores of the cases by name."""

    cases: dict[str, CaseScore] = {}
    error: str = ""


def read_scores(out: Path) -> Scores:
    """The scores in a folder; none where there is no file, and the reason where it cannot be read."""
    file = out / FILE
    if not file.is_file():
        return Scores()
    try:
        return msgspec.json.decode(file.read_bytes(), type=Scores)
    except (ValueError, OSError) as error:
        return Scores(error=f"{FILE} cannot be read: {error}")
