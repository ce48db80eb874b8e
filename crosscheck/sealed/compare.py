"""What changed between two sessions, by case, comparison, channel and engines: worse, better, new, gone.

*Worse*: a verdict was as expected and is not; its status is graver; E or U has grown beyond the factor for accepted
figures (`crosscheck.judging.figures`); a run that finished does not; the session's exit code was 0 and is not. *Gone*:
something is not judged any more. Both are regressions. Large changes of times are listed, but they are no regression.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from crosscheck.judging.figures import worse
from crosscheck.judging.verdict import SEVERITY
from crosscheck.library.accepted import Figure
from crosscheck.sealed.document import SealedCase, SealedResults, SealedRun, SealedVerdict

Direction = Literal["worse", "gone", "better", "new"]
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
        counts = {each: sum(change.direction == each for change in self.changes) for each in DIRECTIONS}
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
            continue
        found = list(_verdicts(name, before, now))
        same += sum(len(table) for table in now.verdicts.values())
        same -= sum(change.direction != "gone" for change in found)
        changes += found
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
                status = (then or current).status  # type: ignore[union-attr]
                direction: Direction = "new" if then is None else "gone"
                yield ResultChange(direction, case, comparison, what, status)
                continue
            if how := _declined(then, current):
                yield ResultChange("worse", case, comparison, what, how)
            elif _declined(current, then):
                yield ResultChange("better", case, comparison, what, _improvement(then, current))


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
    grown = worse(Figure(then.E, then.U or 0.0), now.E, now.U)
    return grown.replace("accepted were", "before").replace("accepted with", "before")


def _improvement(then: SealedVerdict, now: SealedVerdict) -> str:
    if (then.ok, then.status) != (now.ok, now.status):
        return f"{then.status} -> {now.status}"
    return f"E {_figure(then.E)} -> {_figure(now.E)}, U {_figure(then.U)} -> {_figure(now.U)}"


def _figure(value: float | None) -> str:
    return "none" if value is None else f"{value:.1e}"


def _runs(case: str, before: SealedCase, now: SealedCase) -> Iterator[ResultChange]:
    """Runs that finished and do not any more, or are missing; engines without a comparison show only here."""
    for what, then in before.runs.items():
        current = now.runs.get(what, SealedRun(status="did not run"))
        if then.status == "finished" != current.status:
            yield ResultChange("worse", case, "the run", what, f"finished -> {current.status}")


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
    if old.exit_code == 0 != new.exit_code:
        yield ResultChange("worse", "the session", "", "", f"exit code 0 -> {new.exit_code}: {new.headline}")


def _notes(old: SealedResults, new: SealedResults) -> Iterator[str]:
    """Differences of the requests, files and versions, which may explain changes."""
    for name in old.cases.keys() & new.cases.keys():
        before, now = old.cases[name].files, new.cases[name].files
        changed = sorted(file for file in before.keys() | now.keys() if before.get(file) != now.get(file))
        if changed:
            yield f"{name}: other files than before: {', '.join(changed)}"
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
