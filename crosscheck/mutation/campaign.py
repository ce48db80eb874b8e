"""A mutation campaign: the mutants of cases are run by the usual workers, judged as negative controls, and scored.

The true run uses the engine's whole ladder of efforts, which gives its uncertainty; every mutant runs at the finest
effort and has the uncertainty of the true run. Faults of an answer are planted in the true run and need no other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import msgspec
import numpy as np

from crosscheck.engines.registry import PROVIDER
from crosscheck.engines.trajectories import signals_of
from crosscheck.judging.against_reference import ReferenceSignals, at_samples, hold, of_record, shared_times
from crosscheck.judging.case_verdicts import judge
from crosscheck.judging.results import CaseResults, Result, collect
from crosscheck.judging.verdict import Signal, Verdict, compare
from crosscheck.library.channels import most_specific
from crosscheck.library.find import Case
from crosscheck.mutation.answers import FAULTS, AnswerFault, run_of
from crosscheck.mutation.mutants import CaseMutants, PassedOver, mutants_of
from crosscheck.mutation.score import Mutant, MutationScore, ShownIn, mutation_score, outcome
from crosscheck.mutation.subject import JudgedVariant, subject
from crosscheck.records.archive import read
from crosscheck.records.kinds import CaseRecord, ReferenceGoals
from crosscheck.records.session import last_session
from crosscheck.running.job import MAIN, Job
from crosscheck.running.plan import plan, recorded_reference, variant_scene
from crosscheck.running.scheduler import BY_DEFAULT, Limits
from crosscheck.running.sweep import Listener, run_planned
from flexmb.kept import kept
from flexmb.output.files import take_away, write_whole
from flexmb.run.channels import distance, family, magnitude
from flexmb.run.rounding import roundoff_floor
from flexmb.scene.schema import Scene
from flexmb.typing import Real

# Whether the stored reference of a case notices a fault, as for a foreign code, of which there is no true run. A
# channel counts if the engine's own true run agrees with the reference: otherwise a difference is no evidence of the
# fault. The faulty answer has the uncertainty of the true run, to which that of the reference is added.


@dataclass(frozen=True)
class ByReference:
    """The reference of a subject and the engine's finished true run; `asked` are its goals and scales."""

    true: Result
    reference: ReferenceSignals
    asked: ReferenceGoals

    @kept
    def trusted(self) -> frozenset[str]:
        verdicts = hold(self.true, self.reference, self.asked, self.true.open)
        return frozenset(name for name, _, finding in verdicts if finding.status == "agree")

    def of_scene(self, faulty: Result) -> dict[str, ShownIn]:
        """The findings on the run of a faulty scene by channel, or by pattern if it did not finish."""
        verdicts = hold(faulty, self.reference, self.asked, self.true.open, like=self.true)
        return {
            name: ShownIn(status=finding.status, E=finding.E, U=finding.U, goal=goal)
            for name, goal, finding in verdicts
            if name in self.trusted or (self.trusted and faulty.status != "finished")
        }

    def of_answer(self, wrong: Mapping[str, Real]) -> dict[str, ShownIn]:
        """The findings on falsified channels (T, k) of the true run, those that the reference has."""
        places = shared_times(self.reference.times, self.true.times)
        shown = {}
        for name in self.trusted & set(wrong):
            assert places is not None  # otherwise no channel would be trusted
            pattern = most_specific(self.asked.goals, name)
            assert pattern is not None
            goal, scaled = self.asked.goals[pattern], most_specific(self.asked.scales, name)
            right = self.true.signal(name, across=False)
            false = at_samples(Signal(wrong[name], right.uncertainty, right.sizes), places)
            scale = None if scaled is None else self.asked.scales[scaled]
            finding = compare(name, false, self.reference.signal(name), goal, scale)
            shown[name] = ShownIn(status=finding.status, E=finding.E, U=finding.U, goal=goal)
        return shown


def by_reference(what: JudgedVariant, true: Result) -> ByReference | str:
    """The stored reference of the subject's case, or why there is none that can be used."""
    run = msgspec.structs.replace(what.case.run, variants=(what.variant,))
    recorded = recorded_reference(what.case, run)
    if recorded is None or recorded.variant != what.variant.name:
        return "the case has no stored reference of this variant that the engine is held against"
    if recorded.fault:
        return f"the stored reference cannot be used: {recorded.fault}"
    if true.status != "finished":
        return f"there is no true run: {true.message}"
    references = ByReference(true, of_record(recorded), recorded.asked[what.engine])
    return references if references.trusted else "the engine's true run agrees with the stored reference in no channel"


RECORDS = "mutants.jsonl"
SCORES = "mutation.json"
MUTANT_LIMIT_S = 120.0
PATIENCE = 20.0  # times the true run's time, after which a mutant counts as having another motion


class MutationFile(msgspec.Struct, frozen=True, kw_only=True):
    """mutation.json: the scores of the cases, sorted by name. docs/mutations.md explains every key."""

    format: int = 1
    cases: tuple[MutationScore, ...] = ()


def run_campaign(
    cases: Sequence[Case],
    out: Path,
    *,
    engine: str = "native",
    all_targets: bool = False,
    fresh: bool = False,
    provider: str = PROVIDER,
    limits: Limits = BY_DEFAULT,
    listener: Listener = lambda jobs, event: None,
) -> tuple[MutationScore, ...]:
    """Run all mutants of the cases in one engine and score them; `mutation.json` in `out` has the result.

    Results in `mutants.jsonl` in `out` of the same scenes and sources are not run again unless `fresh`.
    CaseError where a case judges nothing that the engine runs.
    """
    subjects = [subject(case, engine) for case in cases]
    faulty = [mutants_of(subject, all_targets) for subject in subjects]
    plans = [_plan(case.case, provider, limits) for case in faulty]
    take_away(out / SCORES)  # so that a killed campaign leaves none of an earlier one
    run_planned(plans, (engine,), out / RECORDS, fresh=fresh, limits=limits, listener=listener)
    found = {case.case.case: case for case in collect(last_session(read(out / RECORDS))).cases}
    scores = tuple(scored(one, mutants, found[one.case.name]) for one, mutants in zip(subjects, faulty, strict=True))
    ordered = tuple(sorted(scores, key=lambda score: score.case))
    text = msgspec.json.format(msgspec.json.encode(MutationFile(cases=ordered)), indent=1)
    write_whole(out / SCORES, text + b"\n")
    return scores


def _plan(case: Case, provider: str, limits: Limits) -> tuple[CaseRecord, list[Job]]:
    """The jobs: the true run with the case's time limit, mutants with `MUTANT_LIMIT_S`, unless `limits` says
    otherwise."""
    record, jobs = plan(case, (), provider, limits.time_s)
    if limits.time_s is not None:
        return record, jobs
    return record, [
        job if job.role == MAIN else replace(job, time_limit_s=min(job.time_limit_s, MUTANT_LIMIT_S)) for job in jobs
    ]


def scored(what: JudgedVariant, mutants: CaseMutants, results: CaseResults) -> MutationScore:
    verdicts: dict[str, list[Verdict]] = {name: [] for name in mutants.mutants}
    for verdict in judge(results):
        verdicts[verdict.comparison].append(verdict)
    true = results.get(what.variant.name, what.engine)
    patient = true.status == "finished" and PATIENCE * true.finest.wall_s <= MUTANT_LIMIT_S
    references = by_reference(what, true)
    stored, no_reference = (None, references) if isinstance(references, str) else (references, "")
    of_scene = []
    for name, control in mutants.mutants.items():
        faulty = results.get(what.variant.name, what.engine, f"control:{name}")
        reference = stored.of_scene(faulty) if stored is not None else {}
        channels = {
            verdict.channel: ShownIn(status=verdict.status, E=verdict.E, U=verdict.U, goal=verdict.goal)
            for verdict in verdicts[name]
        }
        worst = max(verdicts[name], key=lambda verdict: verdict.E or 0.0, default=None)
        reason = "no verdict" if worst is None else worst.reason
        of_scene.append(_mutant("scene", control.mutation, control.target, reason, channels, reference, patient))
    of_answer, not_asked = _answers(what, true, stored)
    return mutation_score(
        what.case.name,
        what.variant.name,
        what.engine,
        [*of_scene, *of_answer],
        [*mutants.passed_over, *not_asked],
        no_reference,
    )


def _mutant(
    of: Literal["scene", "answer"], mutation: str, target: str, reason: str, channels: dict[str, ShownIn],
    reference: dict[str, ShownIn], patient: bool = False,
) -> Mutant:  # fmt: skip
    """What became of a fault, by the verdicts on the channels and those by the stored reference."""
    what, beyond = outcome(channels, patient)
    return Mutant(
        mutation=mutation,
        target=target,
        of=of,
        outcome=what,
        beyond_goal=beyond,
        reason=reason,
        channels=channels,
        by_reference=outcome(reference, patient)[0] if reference else None,
        reference=reference,
    )


def _answers(what: JudgedVariant, true: Result, stored: ByReference | None) -> tuple[list[Mutant], list[PassedOver]]:
    """Faults planted in the true run; those that change nothing, or nothing that the case judges, are passed over."""
    mutants: list[Mutant] = []
    passed: list[PassedOver] = []
    if true.status != "finished":
        return mutants, [PassedOver(mutation="answers", target="", reason=f"no true run: {true.message}")]
    scene = variant_scene(what.case.scene(what.variant), what.variant)
    rounding = _rounding(true)
    for fault in FAULTS:
        wrong = _falsified(true, scene, fault, rounding)
        changed, channels = list(wrong), _judged(what, true, wrong)
        if not changed:
            passed.append(PassedOver(mutation=fault.name, target="", reason="it changes nothing in this run"))
        elif not channels:
            reason = f"the case sets no goal for what it changes: {', '.join(changed)}"
            passed.append(PassedOver(mutation=fault.name, target="", reason=reason))
        else:
            reference = stored.of_answer(wrong) if stored is not None else {}
            worst = max(channels, key=lambda name: channels[name].E or 0.0)
            reason = f"{fault.what}: {worst}"
            mutants.append(_mutant("answer", fault.name, "", reason, channels, reference))
    return mutants, passed


def _rounding(true: Result) -> dict[str, float]:
    """The rounding (SI) of each family of channels, by which body and World components of an axis may differ."""
    sizes: dict[str, float] = {}
    for name in true.determined_channels:
        values = true.values(name)
        sizes[family(name)] = max(sizes.get(family(name), 0.0), magnitude(name, values))
    sums = max(true.finest.evaluations, len(true.times))
    return {group: roundoff_floor(size, sums) for group, size in sizes.items()}


def _falsified(true: Result, scene: Scene, fault: AnswerFault, rounding: dict[str, float]) -> dict[str, Real]:
    """The channels (T, k) with the fault, those that it changes by more than their rounding."""
    right = {name: true.values(name) for name in true.determined_channels}
    wrong = signals_of(fault.falsify(run_of(true.times, right), scene))
    return {
        name: values
        for name, values in wrong.items()
        if np.max(distance(name, values, right[name])) > rounding[family(name)]
    }


def _judged(what: JudgedVariant, true: Result, wrong: dict[str, Real]) -> dict[str, ShownIn]:
    """The findings on the falsified channels that the case judges, compared with the true ones."""
    channels: dict[str, ShownIn] = {}
    for name, values in wrong.items():
        pattern = most_specific(what.goals, name)
        if pattern is None:
            continue
        signal = true.signal(name, across=False)
        false = Signal(values, signal.uncertainty, signal.sizes)
        scale = most_specific(what.scales, name)
        finding = compare(name, false, signal, what.goals[pattern], None if scale is None else what.scales[scale])
        channels[name] = ShownIn(status=finding.status, E=finding.E, U=finding.U, goal=what.goals[pattern])
    return channels
