"""The outcome of a session: its verdicts, what did not run, and the answer whether all is as expected."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from crosscheck.engines.registry import BUILT_IN
from crosscheck.judging.case_verdicts import judge
from crosscheck.judging.figures import recordable
from crosscheck.judging.results import CaseResults, Session
from crosscheck.judging.verdict import Verdict

FAULTS = ("failed", "crashed", "did not finish")  # of an engine that was asked to run


@dataclass(frozen=True)
class Absence:
    """A result that was asked for and is not there."""

    case: str
    variant: str
    engine: str
    role: str
    status: str
    reason: str


@dataclass(frozen=True)
class SessionOutcome:
    """All verdicts of a session, by case; all absences; broken lines of the records, in words.

    `strict`: figures that are worse than recorded, or not recorded, are not as expected.
    """

    verdicts: dict[str, list[Verdict]]
    absences: list[Absence]
    broken: tuple[str, ...] = ()
    strict: bool = False

    @property
    def all(self) -> list[Verdict]:
        """Every verdict."""
        return [verdict for group in self.verdicts.values() for verdict in group]

    @property
    def unexpected(self) -> list[Verdict]:
        """Verdicts that are not what their case expects."""
        return [verdict for verdict in self.all if not verdict.ok]

    @property
    def idle(self) -> list[str]:
        """Cases without any verdict, such as those that none of the requested engines takes part in."""
        return [case for case, group in self.verdicts.items() if not group]

    @property
    def worse(self) -> list[Verdict]:
        """Verdicts as expected, whose E or U has grown beyond what was accepted."""
        return [verdict for verdict in self.all if verdict.ok and verdict.worse]

    @property
    def unrecorded(self) -> list[Verdict]:
        """Verdicts as expected between the library's own engines, for which no figures were accepted yet."""
        return [each for each in self.all if each.ok and each.accepted is None and recordable(each, BUILT_IN)]

    @property
    def lost(self) -> list[Absence]:
        """Runs that were asked for and did not happen, or failed where no verdict shows it.

        An engine that refuses or diverges has answered; a case that compares it with nothing expects nothing of it.
        """
        judged = {(verdict.case, *side) for verdict in self.all for side in verdict.sides}
        return [
            each
            for each in self.absences
            if each.status == "did not run"
            or (each.status in FAULTS and (each.case, each.variant, each.engine) not in judged)
        ]

    @property
    def ok(self) -> bool:
        """Every verdict is the expected one, everything asked for ran, nothing is lost, and there is a verdict."""
        sound = bool(self.all) and not self.unexpected and not self.lost and not self.broken
        return sound and not (self.strict and (self.worse or self.unrecorded))

    @property
    def headline(self) -> str:
        """The session in one sentence."""
        if not self.all:
            return "Nothing was compared" + (f": {self._broken}" if self.broken else "")
        if self.ok:
            grown = f", {len(self.worse)} of them worse than recorded" if self.worse else ""
            return f"All {len(self.all)} verdicts are as expected{grown}"
        parts = []
        if self.unexpected:
            parts.append(f"{len(self.unexpected)} of {len(self.all)} verdicts are not as expected")
        if self.lost:
            runs = "run" if len(self.lost) == 1 else "runs"
            parts.append(f"{len(self.lost)} {runs} asked for gave no result")
        if self.worse:
            parts.append(f"{len(self.worse)} of {len(self.all)} verdicts are worse than recorded")
        if self.strict and self.unrecorded:
            parts.append(f"{len(self.unrecorded)} of {len(self.all)} verdicts have no accepted figures")
        if self.broken:
            parts.append(self._broken)
        return " and ".join(parts)

    @property
    def _broken(self) -> str:
        lines = "line is" if len(self.broken) == 1 else "lines are"
        return f"{len(self.broken)} {lines} no record: what stood there is lost"

    def counts(self) -> Counter[str]:
        """Number of verdicts of each status, controls apart: there *differ* is the good news."""
        return Counter(verdict.status for verdict in self.all if verdict.kind != "control")

    def controls(self) -> tuple[int, int]:
        """In how many channels the negative controls were noticed, and how many there are."""
        noticed = [verdict.ok for verdict in self.all if verdict.kind == "control"]
        return sum(noticed), len(noticed)


def conclude(session: Session, strict: bool = False) -> SessionOutcome:
    """Judge every case of a session."""
    return SessionOutcome(
        verdicts={case.case.case: judge(case) for case in session.cases},
        absences=[absence for case in session.cases for absence in _absences(case)],
        broken=tuple(str(line) for line in session.broken),
        strict=strict,
    )


def _absences(case: CaseResults) -> list[Absence]:
    """Every (variant, engine) of the case, and every control, whose result is missing."""
    run = case.case.run
    wanted = [(variant.name, engine, "main") for variant in run.variants for engine in variant.engines]
    wanted += [(control.a.variant, control.a.engine, f"control:{control.name}") for control in run.controls]
    found = []
    for variant, engine, role in wanted:
        result = case.get(variant, engine, role)
        if result.status != "finished":
            found.append(Absence(case.case.case, variant, engine, role, result.status, result.message))
    return found
