"""Rivals: the engines of a case, the errors of their efforts against the stored reference, and their verdicts.

Nothing is timed before it is judged. Every engine runs its efforts in a worker as usual, and its results are
compared with `reference.csv` by the usual verdicts.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

import msgspec
import numpy as np

from crosscheck.engines.answers import clean
from crosscheck.engines.contract import Effort
from crosscheck.engines.registry import PROVIDER, NoSuchEngine, find_engine
from crosscheck.judging.against_reference import ReferenceSignals, hold, of_record, shared_times
from crosscheck.judging.results import CaseResults, Result, collect
from crosscheck.judging.verdict import Finding
from crosscheck.library.case import CaseError, Chart, Variant
from crosscheck.library.channels import relative_error
from crosscheck.library.find import Case
from crosscheck.records.archive import read
from crosscheck.records.kinds import RecordedReference, ReferenceGoals, RunRecord
from crosscheck.running.job import Job
from crosscheck.running.plan import plan, recorded_reference
from crosscheck.running.scheduler import Limits
from crosscheck.running.sweep import Listener, run_planned
from crosscheck.timing.charted import chart_jobs
from crosscheck.timing.turns import Timed, in_turns
from flexmb.typing import Real


@dataclass(frozen=True)
class Rung:
    """One effort of a rival: its status, and its relative errors in the judged channels that it has recorded.

    `solve_s` is the engine's own time of that single solve.
    """

    effort: Effort
    status: str
    message: str
    solve_s: float
    evaluations: int
    errors: Mapping[str, float] = field(default_factory=dict)

    @property
    def error(self) -> float:
        """The largest of its errors; infinite if it has none."""
        return max(self.errors.values(), default=np.inf)


@dataclass(frozen=True)
class Rival:
    """One engine on one variant: its efforts, coarse to fine, and the verdict on the finest.

    `status` is the gravest of the verdicts', with its `reason`. `level` is that of the scene's bodies,
    `compile_s` the time of the first compilation, or of loading cached kernels.
    """

    job: Job
    level: str
    version: str
    status: str
    reason: str
    compile_s: float
    rungs: tuple[Rung, ...]
    scales: Mapping[str, float]

    @property
    def name(self) -> str:
        """Its name in reports."""
        return f"{self.job.variant} · {self.job.engine}"

    def errors(self, times: Real, channels: Mapping[str, Real], reference: ReferenceSignals) -> dict[str, float]:
        """Relative errors of signals (T, k) at `times` (T,) in the channels that are judged, those that it has."""
        return _errors(times, channels, reference, self.scales)


@dataclass(frozen=True)
class Rivals:
    """All rivals of a case, and the stored reference with which they are compared."""

    case: Case
    variant: str
    reference: ReferenceSignals
    found: tuple[Rival, ...]

    @property
    def engines(self) -> list[str]:
        """The names of their engines, sorted."""
        return sorted({run.job.engine for run in self.found})


ORDER = ("did not run", "crashed", "did not finish", "failed", "refused", "diverged", "differ", "unresolved", "agree")
"""Statuses of verdicts from the gravest; refused channels count only for an engine that offers none."""


def find_rivals(
    case: Case,
    engines: Sequence[str] = (),
    variants: Sequence[str] = (),
    *,
    provider: str = PROVIDER,
    limits: Limits,
    listener: Listener = lambda jobs, event: None,
    charted: bool = False,
) -> Rivals:
    """Run every engine (`engines`, by default those of the variants) and judge it by the case's reference.

    Where they are `charted`, they have further efforts, tuned to the targets of charts, which are judged by nothing.
    `variants` are by default that of the reference; all are compared with it. CaseError if the case has no
    reference that can be used, or no such variant.
    """
    held = _reference(case)
    chosen = [_asked(case.run.variant(name), engines) for name in variants or (held.variant,)]
    chosen = [variant for variant in chosen if variant.engines]
    if not chosen:
        raise CaseError(f"{case.name}: none of {', '.join(engines)} runs {', '.join(variants or (held.variant,))}")
    reference = of_record(held)
    record, jobs = plan(replace(case, run=case.run.alone(*chosen)), (), provider, limits.time_s)
    if charted:
        charts = tuple(_drawn(name, chosen, held.variant) for name in chart_channels(case, tuple(reference.channels)))
        run = msgspec.structs.replace(record.run, charts=charts)
        record = msgspec.structs.replace(record, run=run, reference=held)
    jobs = [replace(job, kept=tuple(reference.channels)) for job in jobs]
    with TemporaryDirectory() as folder:
        records = Path(folder) / "records.jsonl"
        run_planned([(record, jobs)], (), records, limits=limits, listener=listener, follow=chart_jobs)
        (results,) = collect(read(records)).cases
    return Rivals(
        case=case,
        variant=held.variant,
        reference=reference,
        found=tuple(_rival(job, record.variants[job.variant].level, results, reference, held) for job in jobs),
    )


def chart_channels(case: Case, judged: Sequence[str]) -> list[str]:
    """Those of the `judged` channels that the case's charts show; if there are none, the first."""
    wanted = dict.fromkeys(chart.observable for chart in case.run.charts)
    return [name for name in wanted if name in judged] or list(judged[:1])


def _drawn(observable: str, variants: Sequence[Variant], reference: str) -> Chart:
    return Chart(observable=observable, variants=tuple(variant.name for variant in variants), reference=reference)


def timed(entered: Iterable[tuple[Rival, Rung]], rounds: int) -> dict[int, Timed]:
    """Time rivals at these efforts in turns: what was measured, by the `id` of the effort's `Rung`."""
    pairs = list(entered)
    measured = in_turns([(rival.job, rung.effort) for rival, rung in pairs], rounds)
    return {id(rung): timing for (_, rung), timing in zip(pairs, measured, strict=True)}


def _reference(case: Case) -> RecordedReference:
    held = recorded_reference(case, case.run)
    if held is None:
        raise CaseError(f"{case.name}: no stored reference to hold rivals against: `crosscheck regenerate` makes it")
    if held.fault:
        raise CaseError(f"{case.name}: its stored reference cannot be used: {held.fault}")
    return held


def _asked(variant: Variant, engines: Sequence[str]) -> Variant:
    """The variant with all its engines, including those in `also`, or with those asked for."""
    everyone = tuple(engines) or (*variant.engines, *variant.also)
    efforts = tuple(ladder for ladder in variant.efforts if ladder.engine in everyone)
    return msgspec.structs.replace(variant, engines=everyone, also=(), efforts=efforts, refined=None)


def _rival(job: Job, level: str, case: CaseResults, reference: ReferenceSignals, held: RecordedReference) -> Rival:
    asked, result = held.asked.get(job.engine) or _of_all(held), case.get(job.variant, job.engine)
    charts = case.charted.get((job.variant, job.engine))
    more = () if charts is None else charts.runs
    findings = list(hold(result, reference, asked, result.open))
    known = ((name, finding.scale) for name, _, finding in findings if finding.scale is not None)
    scales = {name: scale for name, scale in known if scale > 0.0 and name not in result.open}
    offered = [finding for _, _, finding in findings if finding.status != "refused"] or [
        finding[2] for finding in findings
    ]
    worst = min(offered, key=_place, default=Finding("did not run", "nothing of it can be judged"))
    return Rival(
        job=job,
        level=level,
        version=result.runs[-1].version if result.runs else "",
        status=worst.status,
        reason=worst.reason,
        compile_s=result.runs[0].compile_s if result.runs else 0.0,
        rungs=tuple(_rung(run, result, reference, scales) for run in (*result.runs, *more)),
        scales=scales,
    )


def _of_all(held: RecordedReference) -> ReferenceGoals:
    """Goals and scales for an engine that no comparison expects to agree: those of the first other engine."""
    return next(iter(held.asked.values()))


def _place(finding: Finding) -> int:
    return ORDER.index(finding.status) if finding.status in ORDER else 0


def _rung(run: RunRecord, result: Result, reference: ReferenceSignals, scales: Mapping[str, float]) -> Rung:
    errors: dict[str, float] = {}
    if run.status == "finished" and result.status == "finished":
        channels = {name: result.values(name, run) for name in run.channels}
        errors = _errors(result.times, channels, reference, scales)
    kind: Literal["tolerance", "step"] = "tolerance" if run.effort_kind == "tolerance" else "step"
    effort = Effort(kind, run.effort_value, run.effort_method)
    return Rung(effort, run.status, run.message, run.wall_s, run.evaluations, errors)


def _errors(
    times: Real, channels: Mapping[str, Real], reference: ReferenceSignals, scales: Mapping[str, float]
) -> dict[str, float]:
    """The largest distance up to the horizon over the size of the signal; infinite if it is not finite."""
    places = shared_times(reference.times, times)
    if places is None:
        return {}
    errors = {}
    for name, scale in scales.items():
        if name in channels and channels[name].shape[1:] == reference.channels[name].shape[1:]:
            errors[name] = relative_error(name, channels[name][places], reference.channels[name], scale)
    return errors


# Statements of engines for a timing report: their algorithm and how they are run.

UNSAID = "it does not say with which settings it runs"


@dataclass(frozen=True)
class EngineFacts:
    """An engine's `algorithm` ("" if unknown) and its `settings`, in words."""

    algorithm: str
    settings: str


def facts_of(names: Iterable[str], provider: str) -> dict[str, EngineFacts]:
    """The facts of each engine by its name; of an engine that cannot be made the reason."""
    return {name: _facts(name, provider) for name in names}


def _facts(name: str, provider: str) -> EngineFacts:
    try:
        engine = find_engine(provider, name)
        algorithm, settings = (getattr(engine, what, "") for what in ("algorithm", "settings"))
    except NoSuchEngine as error:
        return EngineFacts("", str(error))
    except Exception as error:  # a plug-in may raise anything
        return EngineFacts("", clean(f"it cannot be asked: {error}"))
    return EngineFacts(clean(str(algorithm)), clean(str(settings)) or UNSAID)
