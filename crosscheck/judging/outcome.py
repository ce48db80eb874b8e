"""The outcome of a session: its verdicts, what did not run, and whether all is as expected."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from crosscheck.engines.registry import BUILT_IN
from crosscheck.judging.applicable import Inapplicable, Kind, set_apart
from crosscheck.judging.case_verdicts import judge
from crosscheck.judging.figures import recordable
from crosscheck.judging.margins import FlaggedGoal, flagged
from crosscheck.judging.results import CaseResults, Session
from crosscheck.judging.unjudged import Unjudged, unjudged
from crosscheck.judging.verdict import Verdict
from crosscheck.judging.work import MAIN, RunKey, WorkChange, keys_of, work_by_run, work_changes
from crosscheck.library.claims import ClaimedFailure, ClaimedGoals
from crosscheck.library.work import RunWork
from crosscheck.records.kinds import ENVELOPE, ContractState
from flexmb.kept import kept
from flexmb.run.channels import matches

NO_REFERENCE = "has a recipe of a reference, no reference yet: crosscheck regenerate {}"
FAULTS = ("failed", "crashed", "did not finish")  # of an engine that was asked to run


@dataclass(frozen=True)
class Absence:
    """A missing result that was asked for."""

    case: str
    variant: str
    engine: str
    role: str
    status: str
    reason: str


@dataclass(frozen=True)
class LostControl:
    """A control whose engines ran, and of whose `channels` none was compared: nobody knows whether the session would
    notice the fault."""

    case: str
    control: str
    channels: tuple[str, ...]

    def __str__(self) -> str:
        goals = ", ".join(self.channels)
        return f'{self.case}, control "{self.control}": none of its channels was compared ({goals}): give it others'


@dataclass(frozen=True)
class SessionOutcome:
    """All verdicts of a session, by case; all absences; broken lines of the records, in words.

    `strict`: figures worse than recorded or missing, and references that were never made, are not as expected.
    `inapplicable`: what engines that joined a case cannot represent of it. `unjudged`: channels that are offered and
    judged by nothing, which a strict session forbids unless they are excused. `asked`: the engines asked for by name.
    `unreferenced`: the cases with a recipe of a reference but no reference. `made_with`: versions and processor of the
    last session in the records. `unfinished`: the session has not ended, so nothing is judged. `idle_claims`: the
    user's claims that name nothing, in words. `lost_controls`: controls that were compared in no channel. `contracts`:
    of outside engines, whether they keep the contract. `work_changes`: counts that are not those of the reference's
    runs; `work`: what every finest run took, by case, variant, engine and role.
    """

    verdicts: dict[str, list[Verdict]]
    absences: list[Absence]
    broken: tuple[str, ...] = ()
    strict: bool = False
    inapplicable: tuple[Inapplicable, ...] = ()
    asked: tuple[str, ...] = ()
    unreferenced: tuple[str, ...] = ()
    made_with: str = ""
    unfinished: bool = False
    idle_claims: tuple[str, ...] = ()
    unjudged: tuple[Unjudged, ...] = ()
    lost_controls: tuple[LostControl, ...] = ()
    contracts: Mapping[str, ContractState] = field(default_factory=dict)
    work_changes: tuple[WorkChange, ...] = ()
    work: Mapping[RunKey, RunWork] = field(default_factory=dict)

    @property
    def all(self) -> list[Verdict]:
        return [verdict for group in self.verdicts.values() for verdict in group]

    @property
    def unexpected(self) -> list[Verdict]:
        return [verdict for verdict in self.all if not verdict.ok]

    @property
    def idle(self) -> list[str]:
        """Cases without a verdict and without anything inapplicable: no engine asked for takes part in them."""
        explained = {absence.case for absence in self.inapplicable}
        return [case for case, group in self.verdicts.items() if not group and case not in explained]

    @property
    def uncompared(self) -> list[str]:
        """Engines that were asked for by name and have no verdict."""
        judged = {engine for verdict in self.all if verdict.kind != "control" for _, engine in verdict.sides}
        return [engine for engine in self.asked if engine not in judged]

    @kept
    def never_applicable(self) -> dict[str, list[str]]:
        """For each engine the cases of which it can represent nothing."""
        judged = {(verdict.case, engine) for verdict in self.all for _, engine in verdict.sides}
        engines_of: dict[str, dict[str, None]] = {}
        for absence in self.inapplicable:
            if absence.lies_with_engine and (absence.case, absence.engine) not in judged:
                engines_of.setdefault(absence.engine, {})[absence.case] = None
        return {engine: list(cases) for engine, cases in engines_of.items()}

    @property
    def not_offered(self) -> dict[str, int]:
        """For each engine the number of channels that would be judged and that it does not offer."""
        return dict(Counter(absence.engine for absence in self.inapplicable if absence.kind == "not offered"))

    @property
    def undetermined(self) -> int:
        """The number of channels, by case and variant, that would be judged and that the motion does not determine."""
        return self._number_of("not determined")

    @property
    def partly_determined(self) -> int:
        """The number of channels, by case and variant, that are judged in some components only, as the motion does not
        determine the others."""
        return self._number_of("partly determined")

    def _number_of(self, kind: Kind) -> int:
        alike = (absence for absence in self.inapplicable if absence.kind == kind)
        return len({(absence.case, absence.variant, absence.channel) for absence in alike})

    @property
    def unaccounted(self) -> list[Unjudged]:
        """Channels that are offered and judged by nothing, and may not be."""
        return [channel for channel in self.unjudged if not channel.excused]

    @property
    def loosened(self) -> list[Verdict]:
        """Verdicts as expected by goals that are looser than those of the case, since an engine claims no more."""
        return [verdict for verdict in self.all if verdict.ok and verdict.loosened]

    @property
    def own_failures(self) -> list[Verdict]:
        """Verdicts other than agreement that the user expects, and not the case."""
        return [verdict for verdict in self.all if verdict.ok and verdict.own_failure]

    @property
    def worse(self) -> list[Verdict]:
        """Verdicts as expected whose E or U has grown beyond figures that were accepted on the same basis."""
        return [verdict for verdict in self.all if verdict.ok and verdict.worse and not verdict.stale]

    @property
    def stale(self) -> list[Verdict]:
        """Verdicts as expected, whose figures were accepted on another basis."""
        return [verdict for verdict in self.all if verdict.ok and verdict.stale]

    @property
    def outgrown(self) -> list[Verdict]:
        """Stale verdicts whose E or U has grown beyond the accepted one."""
        return [verdict for verdict in self.stale if verdict.worse]

    @property
    def unrecorded(self) -> list[Verdict]:
        """Verdicts as expected between the library's own engines, for which no figures were accepted yet."""
        return [
            verdict for verdict in self.all if verdict.ok and verdict.accepted is None and recordable(verdict, BUILT_IN)
        ]

    def work_of(self, verdict: Verdict) -> tuple[RunWork | None, RunWork | None]:
        """What the finest runs of a verdict's sides took; None where there was no run, as of a reference."""
        a, b = map(self.work.get, keys_of(verdict))
        return a, None if verdict.kind == "conservation" else b

    @property
    def main_work(self) -> dict[tuple[str, str, str], RunWork]:
        """What the finest runs took that are no controls and no refinements, by case, variant and engine."""
        return {key[:3]: work for key, work in self.work.items() if key[3] == MAIN}

    @kept
    def flagged(self) -> list[FlaggedGoal]:
        """Goals that are met by too little or by too much, by case and comparison."""
        return list(flagged(self.all))

    @property
    def dearer(self) -> list[WorkChange]:
        """Runs that take more work than those that made the reference."""
        return [change for change in self.work_changes if change.dearer]

    @kept
    def lost(self) -> list[Absence]:
        """Runs that were asked for and did not run, or that failed without a verdict that shows it, as envelopes do.

        Refusing and diverging are answers, and a case without a comparison of the engine expects nothing of it.
        """
        judged = {(verdict.case, *side) for verdict in self.all for side in verdict.sides}
        return [
            absence
            for absence in self.absences
            if absence.status == "did not run"
            or (absence.status in FAULTS and (absence.case, absence.variant, absence.engine) not in judged)
            or (absence.status in FAULTS and absence.role == ENVELOPE)
        ]

    @property
    def ok(self) -> bool:
        """Whether every verdict is as expected, everything asked for was judged, and no run is lost."""
        complete = not self.unfinished and bool(self.all) and not self.lost and not self.broken
        idle = self.uncompared or self.idle_claims or self.lost_controls
        sound = complete and not self.unexpected and not idle
        lacking = self.worse or self.outgrown or self.unrecorded or self.unreferenced or self.unaccounted or self.dearer
        return sound and not (self.strict and lacking)

    @property
    def headline(self) -> str:
        """The session in one sentence."""
        if self.unfinished:
            return "Unfinished: the session has not come to its end"
        if not self.all:
            why = self._broken if self.broken else self._uncompared if self.inapplicable else ""
            return "Nothing was compared" + (f": {why}" if why else "")
        if self.ok:
            grown = f", {len(self.worse)} of them worse than recorded" if self.worse else ""
            return f"All {len(self.all)} verdicts are as expected{grown}{self._by_claims}{self._unoffered}"
        parts = []
        if self.unexpected:
            parts.append(f"{len(self.unexpected)} of {len(self.all)} verdicts are not as expected")
        if self.lost:
            runs = "run" if len(self.lost) == 1 else "runs"
            parts.append(f"{len(self.lost)} {runs} asked for gave no result")
        if self.worse:
            parts.append(f"{len(self.worse)} of {len(self.all)} verdicts are worse than recorded")
        if self.strict and self.outgrown:
            parts.append(f"{len(self.outgrown)} of {len(self.all)} verdicts are beyond stale figures: accept them anew")
        if self.strict and self.unrecorded:
            parts.append(f"{len(self.unrecorded)} of {len(self.all)} verdicts have no accepted figures")
        if self.strict and self.unreferenced:
            cases = "case has" if len(self.unreferenced) == 1 else "cases have"
            parts.append(f"{len(self.unreferenced)} {cases} a recipe and no reference")
        if self.strict and self.unaccounted:
            count = len(self.unaccounted)
            parts.append(f"{count} channel{'s are' if count > 1 else ' is'} offered and judged by nothing")
        if self.strict and self.dearer:
            count = len(self.dearer)
            parts.append(f"{count} count{'s of runs are' if count > 1 else ' of a run is'} more work than recorded")
        if self.uncompared:
            parts.append(self._uncompared)
        if self.broken:
            parts.append(self._broken)
        if self.lost_controls:
            faults = "fault was" if len(self.lost_controls) == 1 else "faults were"
            parts.append(f"{len(self.lost_controls)} deliberate {faults} compared in nothing")
        if self.idle_claims:
            parts.append(f"{len(self.idle_claims)} of your own expectations name nothing")
        return " and ".join(parts)

    @property
    def _uncompared(self) -> str:
        were = "was" if len(self.uncompared) == 1 else "were"
        return f"{', '.join(self.uncompared)} {were} asked for and compared in nothing"

    @property
    def _by_claims(self) -> str:
        loosened = f", {len(self.loosened)} of them by goals looser than the case's" if self.loosened else ""
        return loosened + (f", {len(self.own_failures)} of them failures that you expect" if self.own_failures else "")

    @property
    def _unoffered(self) -> str:
        told = [f"{engine} {count} channel{'s' if count > 1 else ''}" for engine, count in self.not_offered.items()]
        offered = f"; not offered and not judged: {', '.join(told)}" if told else ""
        whole, parts = (f"{n} channel{'s' if n > 1 else ''}" for n in (self.undetermined, self.partly_determined))
        not_judged = [whole] if self.undetermined else []
        not_judged += [f"components of {parts}"] if self.partly_determined else []
        return offered + (f"; not determined and not judged: {', '.join(not_judged)}" if not_judged else "")

    @property
    def _broken(self) -> str:
        lines = "line is" if len(self.broken) == 1 else "lines are"
        return f"{len(self.broken)} {lines} no record: what stood there is lost"

    def counts(self) -> Counter[str]:
        """Number of verdicts of each status, controls apart: there *differ* is the good news."""
        return Counter(verdict.status for verdict in self.all if verdict.kind != "control")

    def controls(self) -> tuple[int, int]:
        """The number of channels in which negative controls were noticed, and of all."""
        noticed = [verdict.ok for verdict in self.all if verdict.kind == "control"]
        return sum(noticed), len(noticed)


def conclude(session: Session, strict: bool = False) -> SessionOutcome:
    verdicts: dict[str, list[Verdict]] = {}
    inapplicable: tuple[Inapplicable, ...] = ()
    left: tuple[Unjudged, ...] = ()
    lost_controls: tuple[LostControl, ...] = ()
    for case in session.cases:
        verdicts[case.case.case], apart = set_apart(case, judge(case))
        inapplicable += apart
        left += unjudged(case, verdicts[case.case.case], apart)
        lost_controls += tuple(_lost_controls(case, verdicts[case.case.case]))
    whole = {(absence.case, absence.variant, absence.engine) for absence in inapplicable if absence.kind == "refused"}
    absences = [absence for case in session.cases for absence in _absences(case)]
    return SessionOutcome(
        verdicts=verdicts,
        absences=[absence for absence in absences if (absence.case, absence.variant, absence.engine) not in whole],
        broken=tuple(str(line) for line in session.broken),
        strict=strict,
        inapplicable=inapplicable,
        asked=tuple(dict.fromkeys(engine for case in session.cases for engine in case.case.asked)),
        unreferenced=tuple(case.case.case for case in session.cases if case.case.unreferenced),
        made_with=_made_with(session),
        idle_claims=idle_claims(session.cases, verdicts, inapplicable),
        unjudged=left,
        lost_controls=lost_controls,
        contracts={
            name: state for environment in session.environments for name, state in environment.contracts.items()
        },
        work_changes=tuple(change for case in session.cases for change in work_changes(case)),
        work=dict(item for case in session.cases for item in work_by_run(case)),
    )


def _lost_controls(case: CaseResults, verdicts: Iterable[Verdict]) -> Iterator[LostControl]:
    """The controls without a verdict that counts, though no engine refused their scenes."""
    judged = {verdict.comparison for verdict in verdicts if verdict.kind == "control"}
    for item in case.case.run.controls:
        faulty = case.get(item.a.variant, item.a.engine, f"control:{item.name}")
        sides = faulty, case.get(item.a.variant, item.a.engine), case.get(item.b.variant, item.b.engine)
        if item.name not in judged and not any(side.status == "refused" for side in sides):
            yield LostControl(case.case.case, item.name, tuple(item.goals))


def _made_with(session: Session) -> str:
    if not session.environments:
        return ""
    last = session.environments[-1]
    return ", ".join([*(f"{name} {version}" for name, version in last.packages.items()), last.processor])


def _absences(case: CaseResults) -> list[Absence]:
    """Every (variant, engine) of the case, every control, and every envelope asked for, whose result is missing."""
    run = case.case.run
    wanted = [(variant.name, engine, "main") for variant in run.variants for engine in variant.engines]
    wanted += [(control.a.variant, control.a.engine, f"control:{control.name}") for control in run.controls]
    envelopes = [key for key in case.results if key[2] == ENVELOPE]
    wanted += [key for key in envelopes if case.get(*key[:2]).status == "finished"]
    absences = []
    for variant, engine, role in wanted:
        result = case.get(variant, engine, role)
        if result.status != "finished":
            absences.append(Absence(case.case.case, variant, engine, role, result.status, result.message))
    return absences


def idle_claims(
    cases: Sequence[CaseResults], verdicts: Mapping[str, Sequence[Verdict]], inapplicable: Iterable[Inapplicable]
) -> tuple[str, ...]:
    """Each pattern of channels that names none in any case of its entry, with its place.

    Only entries all of whose cases are in the session are judged, and engines that finished everything there: what the
    others would offer is not known.
    """
    apart = tuple(inapplicable)
    places: dict[tuple[str, str, str], list[CaseResults]] = {}  # place, engine, pattern
    for case in cases:
        claims = case.case.claims
        named: list[tuple[ClaimedGoals | ClaimedFailure, str]]
        named = [(goal, pattern) for goal in claims.goals for pattern in goal.goals]
        named += [(failure, pattern) for failure in claims.failures for pattern in failure.channels]
        for each, pattern in named:
            if each.whole:
                places.setdefault((each.place, each.engine, pattern), []).append(case)
    found = []
    for (place, engine, pattern), group in places.items():
        names = {case.case.case for case in group}
        judged = [verdict for name in names for verdict in verdicts[name] if _judges(verdict, engine)]
        known = {verdict.channel for verdict in judged}
        known |= {verdict.channel for verdict in apart if verdict.case in names and verdict.engine == engine}
        certain = judged and all(_finished(case, engine) for case in group)
        if certain and not any(matches(pattern, channel) for channel in known):
            found.append(f'{place}: "{pattern}" names no channel of {engine} that is judged: correct it')
    return tuple(found)


def _judges(verdict: Verdict, engine: str) -> bool:
    return verdict.kind != "control" and any(side == engine for _, side in verdict.sides)


def _finished(case: CaseResults, engine: str) -> bool:
    mine = [result for (_, name, role), result in case.results.items() if name == engine and role == "main"]
    return bool(mine) and all(result.status == "finished" for result in mine)
