"""How far a verdict is from its bound: the goal, or the tolerance of a conserved quantity, over what was reached.

The margin of an agreement is goal / max(E, U). Below `NARROW` the next change of a scene or a machine may cross the
goal. Above `WIDE` no fault of a size that matters could: a goal that nothing can miss is no test. Whether faults are
noticed all the same is what negative controls and mutations show; a margin says which goals are to be looked at. It
changes no verdict.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Literal, get_args

from crosscheck.judging.verdict import Verdict

NARROW, WIDE = 3.0, 1e4
Flag = Literal["narrow", "wide"]
FLAGS: tuple[Flag, ...] = get_args(Flag)
WORDS: dict[Flag, str] = {
    "narrow": f"met by a factor below {NARROW:g}",
    "wide": f"met by a factor above {WIDE:g}: nothing can miss it",
}


@dataclass(frozen=True)
class FlaggedGoal:
    """Channels of one comparison with the same flag: how many of how many agreements, and the extreme of them."""

    case: str
    comparison: str
    flag: Flag
    channels: int
    judged: int
    extreme: float
    channel: str
    goal: float

    def __str__(self) -> str:
        where = f"{self.case}, {self.comparison}: goals of {self.channels} of {self.judged} agreements"
        return f"{where} are {WORDS[self.flag]}; {self.channel}: {self.extreme:.2g}, goal {self.goal:.2g}"


def margin(goal: float, E: float | None, U: float | None) -> float | None:
    """The goal over what was reached; None where both are zero, or nothing was."""
    reached = max(E or 0.0, U or 0.0)
    return goal / reached if reached > 0.0 and goal > 0.0 else None


def flag_of(size: float | None) -> Flag | None:
    """How a margin is flagged, if at all."""
    if size is None or NARROW <= size <= WIDE:
        return None
    return "narrow" if size < NARROW else "wide"


def margin_of(verdict: Verdict) -> float | None:
    """The margin of an agreement that is no control; None for all else."""
    if verdict.kind == "control" or verdict.status != "agree":
        return None
    return margin(verdict.goal, verdict.E, verdict.U)


def flagged(verdicts: Iterable[Verdict]) -> Iterator[FlaggedGoal]:
    """By case and comparison the goals that are met by too little or by too much."""
    groups: dict[tuple[str, str], list[tuple[float, str, float]]] = {}
    for verdict in verdicts:
        size = margin_of(verdict)
        if size is not None:
            groups.setdefault((verdict.case, verdict.comparison), []).append((size, verdict.channel, verdict.goal))
    for (case, comparison), group in groups.items():
        yield from flagged_of(case, comparison, group)


def flagged_of(case: str, comparison: str, group: list[tuple[float, str, float]]) -> Iterator[FlaggedGoal]:
    """The flags of one comparison from the margin, channel and goal of each of its agreements."""
    for flag in FLAGS:
        mine = [each for each in group if flag_of(each[0]) == flag]
        if mine:
            size, channel, goal = min(mine) if flag == "narrow" else max(mine)
            yield FlaggedGoal(case, comparison, flag, len(mine), len(group), size, channel, goal)
