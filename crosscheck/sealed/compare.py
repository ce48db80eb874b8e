"""What changed between two sessions, by case, comparison, channel and engines: worse, better, new, gone.

*Worse*: a verdict was as expected and is not; its status is graver; E or U has grown beyond the factor for accepted
figures (`crosscheck.judging.figures`), or is not known any more; it is worse than the accepted figure and was not; it
is new and not as expected; a run ends in a graver way than before, or is new and did not finish; an engine asked for is
compared in nothing; more lines of the records are broken; the session's exit code was 0 and is not. *Gone*: something
is not judged any more. Both are regressions. Large changes of times are listed, but they are no regression.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import inf
from typing import Literal

from crosscheck.judging.figures import worse
from crosscheck.judging.verdict import SEVERITY
from crosscheck.library.accepted import Figure
from crosscheck.sealed.document import SealedCase, SealedResults, SealedRun, SealedVerdict

Direction = Literal["worse", "gone", "better", "new"]
NOTHING = SealedCase(files={}, scenes={}, verdicts={}, runs={})
DIRECTIONS: tuple[Direction, ...] = ("worse", "gone", "better", "new")
REGRESSIONS = ("worse", "gone")
SLOWER = 1.5  # ratio of times from which a change is listed
SHORTEST_S = 0.05  # shorter ones change by chance


@dataclass(frozen=True)
class ResultChange:
    """A change: of a verdict `what` is its channel with both sides, of a run variant, engine and role."""

    direction: Direction
    case: str
    comparison: str
    what: str
    how: str


@dataclass(frozen=True)
class TimeChange:
    """A run whose solve took `ratio` times as long as before."""

    case: str
    what: str
    before_s: float
    now_s: float

    @property
    def ratio(self) -> float:
        return self.now_s / self.before_s


@dataclass(frozen=True)
class Differences:
    """All changes, the number of verdicts that are the `same`, and `notes` that may explain changes."""

    changes: tuple[ResultChange, ...]
    times: tuple[TimeChange, ...]
    notes: tuple[str, ...]
    same: int

    @property
    def regressed(self) -> bool:
        """Whether anything is worse or gone."""
        return any(change.direction in REGRESSIONS for change in self.changes)

    @property
    def headline(self) -> str:
        """The differences in one sentence."""
        counts = {direction: sum(change.direction == direction for change in self.changes) for direction in DIRECTIONS}
        told = ", ".join(f"{count} {name}" for name, count in counts.items())
        return f"{told}, {self.same} the same"


def compare_results(old: SealedResults, new: SealedResults) -> Differences:
    """Compare a session with an earlier one."""
    changes: list[ResultChange] = []
    times: list[TimeChange] = []
    same = 0
    for name in dict.fromkeys((*old.cases, *new.cases)):
        before, now = old.cases.get(name), new.cases.get(name)
        if before is None or now is None:
            direction: Direction = "new" if before is None else "gone"
            changes.append(ResultChange(direction, name, "", "", f"the case is {direction}"))
            if now is not None:
                changes += [verdict for verdict in _verdicts(name, NOTHING, now) if verdict.direction == "worse"]
                changes += _runs(name, NOTHING, now)
            continue
        differences = list(_verdicts(name, before, now))
        same += sum(len(table) for table in now.verdicts.values())
        same -= sum(change.direction != "gone" for change in differences)
        changes += differences
        changes += _runs(name, before, now)
        times += _times(name, before, now)
    changes += _session(old, new)
    order = {direction: place for place, direction in enumerate(DIRECTIONS)}
    return Differences(
        tuple(sorted(changes, key=lambda change: order[change.direction])),
        tuple(sorted(times, key=lambda change: -change.ratio)),
        tuple(_notes(old, new)),
        same,
    )


def _verdicts(case: str, before: SealedCase, now: SealedCase) -> Iterator[ResultChange]:
    for comparison in dict.fromkeys((*before.verdicts, *now.verdicts)):
        old, new = before.verdicts.get(comparison, {}), now.verdicts.get(comparison, {})
        for what in dict.fromkeys((*old, *new)):
            then, current = old.get(what), new.get(what)
            if then is None or current is None:
                yield _appeared(case, comparison, what, then, current)
                continue
            if how := _declined(then, current):
                yield ResultChange("worse", case, comparison, what, how)
            elif _declined(current, then):
                yield ResultChange("better", case, comparison, what, _improvement(then, current))


def _appeared(
    case: str, comparison: str, what: str, then: SealedVerdict | None, now: SealedVerdict | None
) -> ResultChange:
    """The change of a verdict that one of the sessions lacks: nothing excuses a new one that is not as expected."""
    if now is None:
        return ResultChange("gone", case, comparison, what, "" if then is None else then.status)
    if now.ok:
        return ResultChange("new", case, comparison, what, now.status)
    how = f"new, and {now.status} where {now.expected} is expected: {now.reason}"
    return ResultChange("worse", case, comparison, what, how)


def _declined(then: SealedVerdict, now: SealedVerdict) -> str:
    """How a verdict became worse; "" if it did not."""
    if then.ok and not now.ok:
        return f"{then.status} -> {now.status}, expected {now.expected}: {now.reason}"
    if then.ok != now.ok:
        return ""
    if then.kind != "control" and SEVERITY.index(now.status) < SEVERITY.index(then.status):
        return f"{then.status} -> {now.status}"
    if then.status != now.status or then.kind == "control" or then.E is None:
        return ""
    if now.worse and not then.worse:
        return f"worse than recorded: {now.worse}"
    if then.kind == "comparison" and now.E is not None and now.U is None:
        return "" if then.U is None else f"U was {then.U:.1e} and is not known any more"
    unknown = inf if then.kind == "comparison" else 0.0  # only an infinite U is left out, and a drift has none
    grown = worse(Figure(then.E, unknown if then.U is None else then.U), now.E, now.U)
    return grown.replace("accepted were", "before").replace("accepted with", "before")


def _improvement(then: SealedVerdict, now: SealedVerdict) -> str:
    if (then.ok, then.status) != (now.ok, now.status):
        return f"{then.status} -> {now.status}"
    return f"E {_figure(then.E)} -> {_figure(now.E)}, U {_figure(then.U)} -> {_figure(now.U)}"


def _figure(value: float | None) -> str:
    return "none" if value is None else f"{value:.1e}"


def _runs(case: str, before: SealedCase, now: SealedCase) -> Iterator[ResultChange]:
    """Runs that end in a graver way, or are missing; engines without a comparison show only here.

    A refusal is an answer: a new run may refuse.
    """
    for what in dict.fromkeys((*before.runs, *now.runs)):
        then, current = before.runs.get(what), now.runs.get(what, SealedRun(status="did not run"))
        if then is not None and _gravity(current) > _gravity(then):
            yield ResultChange("worse", case, "the run", what, f"{then.status} -> {current.status}")
        elif then is None and current.status not in ("finished", "refused"):
            yield ResultChange("worse", case, "the run", what, f"new, and {current.status}")


def _gravity(run: SealedRun) -> int:
    """How grave the status of a run is: 0 if it finished."""
    return 0 if run.status == "finished" else len(SEVERITY) - SEVERITY.index(run.status)


def _times(case: str, before: SealedCase, now: SealedCase) -> Iterator[TimeChange]:
    """Runs at the same effort that take much longer or much less time."""
    for what, then in before.runs.items():
        current = now.runs.get(what)
        if current is None or current.effort != then.effort or min(then.wall_s, current.wall_s) < SHORTEST_S:
            continue
        change = TimeChange(case, what, then.wall_s, current.wall_s)
        if not 1.0 / SLOWER <= change.ratio <= SLOWER:
            yield change


def _session(old: SealedResults, new: SealedResults) -> Iterator[ResultChange]:
    """Changes that no verdict shows: lost runs, broken records, figures that a strict session requires."""
    for engine in new.engines:
        if _compared(new, engine) == 0 and (engine not in old.engines or _compared(old, engine)):
            yield ResultChange("worse", "the session", "", engine, "asked for, and compared in nothing")
    if new.broken > old.broken:
        yield ResultChange("worse", "the session", "", "", f"{new.broken} lines of its records are broken")
    if old.exit_code == 0 != new.exit_code:
        yield ResultChange("worse", "the session", "", "", f"exit code 0 -> {new.exit_code}: {new.headline}")


def _compared(session: SealedResults, engine: str) -> int:
    """The number of verdicts of an engine, controls apart."""
    tables = (table for case in session.cases.values() for table in case.verdicts.values())
    sides = (what.split(" | ")[1:] for table in tables for what, verdict in table.items() if verdict.kind != "control")
    return sum(any(side.startswith(f"{engine} (") for side in pair) for pair in sides)


def _notes(old: SealedResults, new: SealedResults) -> Iterator[str]:
    """Differences of the requests, files and versions, which may explain changes."""
    for name in old.cases.keys() & new.cases.keys():
        before, now = old.cases[name].files, new.cases[name].files
        changed = sorted(file for file in before.keys() | now.keys() if before.get(file) != now.get(file))
        if changed:
            yield f"{name}: other files than before: {', '.join(changed)}"
        if old.cases[name].claims != new.cases[name].claims:
            yield f"{name}: judged by other goals, failures or efforts of your own than before"
        stale = sum(bool(verdict.stale) for table in new.cases[name].verdicts.values() for verdict in table.values())
        if stale:
            yield f"{name}: {stale} accepted figures are stale, so that nothing is held against them"
    for what in ("engines", "strict"):
        if getattr(old, what) != getattr(new, what):
            yield f"they were asked for with other {what}: {getattr(old, what)!r}, now {getattr(new, what)!r}"
    for what in ("processor", "system", "python", "packages", "engines"):
        before, now = getattr(old.made, what), getattr(new.made, what)
        if isinstance(before, dict):
            for name in sorted(before.keys() & now.keys()):
                if before[name] != now[name]:
                    yield f"{name} was {before[name]}, now {now[name]}"
        elif before != now:
            yield f"another {what}: {before}, now {now}"
