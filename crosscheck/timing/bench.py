"""Benchmarks of a case: engines that reach the requested accuracy are timed in turns.

An engine is an *equal* if every verdict on it against `reference.csv` is *agree* and one of its efforts is
within the requested accuracy in every judged channel; the first such effort is timed, as a user would choose
it. Others that finished are timed *apart*, at that effort or at their finest, and their times are not compared with the
equals'. Engines that disagree on the reference's own variant, or did not finish, are not timed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Literal

from crosscheck.engines.registry import PROVIDER
from crosscheck.library.case import CaseError
from crosscheck.library.find import Case
from crosscheck.running.scheduler import Limits
from crosscheck.running.sweep import Listener
from crosscheck.timing.rivals import EngineFacts, Rival, Rivals, Rung, facts_of, find_rivals, timed
from crosscheck.timing.turns import Timed

Standing = Literal["equal", "apart", "not timed"]
ACCURACY = 1e-4  # of the signals' sizes: peers with fixed steps reach it too
ROUNDS = 10


@dataclass(frozen=True)
class Contest:
    """A rival's standing, the reason, and its times; `rung` is the effort that is timed, None if none is."""

    rival: Rival
    facts: EngineFacts
    standing: Standing
    why: str
    rung: Rung | None = None
    timed: Timed | None = None

    @property
    def best_s(self) -> float | None:
        """The shortest solve."""
        return min(sample.solve_s for sample in self.timed.samples) if self.timed and self.timed.samples else None


@dataclass(frozen=True)
class CaseBench:
    """A case's contests, equals first and the fastest first; `problem` says why there are none."""

    case: str
    accuracy: float
    rounds: int
    contests: tuple[Contest, ...] = ()
    problem: str = ""


def bench(
    case: Case,
    engines: Sequence[str],
    variants: Sequence[str],
    *,
    rounds: int = ROUNDS,
    accuracy: float = ACCURACY,
    provider: str = PROVIDER,
    limits: Limits,
    listener: Listener = lambda jobs, event: None,
) -> CaseBench:
    """Judge the rivals of a case, then time them. Problems are part of the result; nothing is raised."""
    try:
        rivals = find_rivals(case, engines, variants, provider=provider, limits=limits, listener=listener)
    except CaseError as error:
        return CaseBench(case.name, accuracy, rounds, problem=str(error))
    facts = facts_of(rivals.engines, provider)
    contests = [_entered(rival, facts[rival.job.engine], rivals, accuracy) for rival in rivals.found]
    times = timed(((contest.rival, contest.rung) for contest in contests if contest.rung is not None), rounds)
    contests = [_ended(contest, times.get(id(contest.rung)), rivals, accuracy) for contest in contests]
    return CaseBench(case.name, accuracy, rounds, tuple(sorted(contests, key=_place)))


def _entered(rival: Rival, facts: EngineFacts, rivals: Rivals, accuracy: float) -> Contest:
    finished = [rung for rung in rival.rungs if rung.status == "finished" and isfinite(rung.error)]
    accurate = next((rung for rung in finished if rung.error <= accuracy), None)
    another = rival.job.variant != rivals.variant
    if rival.status not in ("agree", "unresolved", "differ") or not finished:
        return Contest(rival, facts, "not timed", f"{rival.status}: {rival.reason}")
    if rival.status == "differ" and not another:
        return Contest(rival, facts, "not timed", f"disagrees with the reference: {rival.reason}")
    if accurate is None:
        finest = finished[-1]
        why = f"its finest effort is {finest.error:.2g} from the reference, not within {accuracy:g}"
        return Contest(rival, facts, "apart", why, finest)
    if rival.status != "agree":
        what = f"another model than {rivals.variant}" if another else "its agreement is not resolved"
        return Contest(rival, facts, "apart", f"{what}: {rival.reason}", accurate)
    return Contest(rival, facts, "equal", f"agrees with the reference, {accurate.error:.2g} from it", accurate)


def _ended(contest: Contest, measured: Timed | None, rivals: Rivals, accuracy: float) -> Contest:
    """The contest with its times, unless the rival failed while it was timed or gave another result."""
    if measured is None:
        return contest
    if measured.failure or not measured.samples or measured.first is None:
        why = f"it passed the verdicts, but not its turns: {measured.failure or 'it took none'}"
        return Contest(contest.rival, contest.facts, "not timed", why, contest.rung)
    errors = contest.rival.errors(measured.first.times, measured.first.channels, rivals.reference)
    again = max(errors.values(), default=None)
    if again is None or (contest.standing == "equal" and not again <= accuracy):
        judged = contest.rung and contest.rung.error
        why = f"what was timed is not what was judged: its error is {again} instead of {judged}"
        return Contest(contest.rival, contest.facts, "not timed", why, contest.rung)
    return Contest(contest.rival, contest.facts, contest.standing, contest.why, contest.rung, measured)


def _place(contest: Contest) -> tuple[int, float]:
    return ("equal", "apart", "not timed").index(contest.standing), contest.best_s or 0.0
