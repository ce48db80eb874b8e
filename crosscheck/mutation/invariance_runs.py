"""Invariances of cases: the counterparts of a scene are run, transformed back, and compared with the scene's run.

Both use the engine's whole ladder of efforts, so that each has its own uncertainty: a boosted or rescaled run
has other steps. Transforming back adds the rounding of what it subtracts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
import numpy as np

from crosscheck.engines.checked import NO_START
from crosscheck.engines.registry import PROVIDER
from crosscheck.judging.results import CaseResults, Result, collect
from crosscheck.judging.uncertainty import Uncertainty
from crosscheck.judging.verdict import Finding, Signal, Status, compare
from crosscheck.library.channels import LINEAR_KINDS, is_judged, most_specific
from crosscheck.library.find import Case
from crosscheck.mutation.invariances import INVARIANCES, Counterpart, NotApplicable
from crosscheck.mutation.subject import JudgedVariant, reduced, subject
from crosscheck.records.archive import read
from crosscheck.records.kinds import CaseRecord, RunRecord
from crosscheck.records.packing import pack, unpack
from crosscheck.records.session import last_session
from crosscheck.running.job import MAIN, Job
from crosscheck.running.plan import plan, scene_identity
from crosscheck.running.scheduler import BY_DEFAULT, Limits
from crosscheck.running.sweep import Listener, run_planned
from flexmb.output.files import take_away, write_whole
from flexmb.run.channels import magnitude
from flexmb.run.rounding import roundoff_floor
from flexmb.scene.check import check_scene

RECORDS = "invariances.jsonl"
VERDICTS = "invariance.json"
BOTH = 2.0  # factor of goals: here the uncertainty of the engine counts twice
ANY = 1.0  # the goal if the case sets none, so that only E > U is a difference


class InvarianceVerdict(msgspec.Struct, frozen=True, kw_only=True):
    """One invariance of one case: the gravest status of its channels; `channel` has the largest E/U.

    `status` is "not applicable" if the invariance does not hold for the scene. `E` and `U` are relative to the
    channel's range. `differing` are all channels that differ.
    """

    case: str
    variant: str
    engine: str
    invariance: str
    status: Status | str
    channel: str = ""
    E: float | None = None
    U: float | None = None
    channels: int = 0
    differing: tuple[str, ...] = ()
    reason: str = ""

    @property
    def ok(self) -> bool:
        """Whether the invariance holds or is not applicable."""
        return self.status in ("agree", "not applicable")


class InvarianceFile(msgspec.Struct, frozen=True, kw_only=True):
    """invariance.json: a verdict for each case and invariance."""

    format: int = 1
    verdicts: tuple[InvarianceVerdict, ...] = ()


@dataclass(frozen=True)
class _Set:
    """The counterparts of a subject by the name of the invariance, and the reasons why others have none."""

    what: JudgedVariant
    counterparts: dict[str, Counterpart]
    without: dict[str, str]
    record: CaseRecord
    jobs: list[Job]


def run_invariances(
    cases: Sequence[Case],
    out: Path,
    *,
    engine: str = "native",
    fresh: bool = False,
    provider: str = PROVIDER,
    limits: Limits = BY_DEFAULT,
    listener: Listener = lambda jobs, event: None,
) -> tuple[InvarianceVerdict, ...]:
    """Run every applicable invariance of the cases in one engine; `invariance.json` in `out` has the verdicts.

    CaseError where a case judges nothing that the engine runs.
    """
    sets = [_planned(subject(case, engine), provider, limits) for case in cases]
    plans = [(invariance.record, invariance.jobs) for invariance in sets]
    take_away(out / VERDICTS)  # so that a killed session leaves none of an earlier one
    run_planned(plans, (engine,), out / RECORDS, fresh=fresh, limits=limits, listener=listener)
    found = {case.case.case: case for case in collect(last_session(read(out / RECORDS))).cases}
    verdicts = tuple(
        verdict for invariance in sets for verdict in _judged(invariance, found[invariance.what.case.name])
    )
    text = msgspec.json.format(msgspec.json.encode(InvarianceFile(verdicts=verdicts)), indent=1)
    write_whole(out / VERDICTS, text + b"\n")
    return verdicts


def _planned(what: JudgedVariant, provider: str, limits: Limits) -> _Set:
    record, (true,) = plan(reduced(what), (), provider, limits.time_s)
    counterparts: dict[str, Counterpart] = {}
    without: dict[str, str] = {}
    jobs = [true]
    for invariance in INVARIANCES:
        if true.scene is None:
            without[invariance.name] = f"the case's own scene cannot be made: {true.error}"
            continue
        try:
            counterpart = invariance.of(true.scene)
        except NotApplicable as error:
            without[invariance.name] = str(error)
            continue
        counterparts[invariance.name] = counterpart
        jobs.append(_job(true, invariance.name, counterpart))
    # The efforts stand in the jobs: a counterpart with another unit of time has other steps.
    bare = msgspec.structs.replace(what.variant, efforts=())
    record = msgspec.structs.replace(record, run=msgspec.structs.replace(record.run, variants=(bare,)))
    return _Set(what, counterparts, without, record, jobs)


def _job(true: Job, name: str, counterpart: Counterpart) -> Job:
    """The counterpart's job. Fixed steps are converted to its clock."""
    times = counterpart.starts_s + counterpart.clock * true.times
    efforts = tuple(
        replace(effort, value=counterpart.clock * effort.value) if effort.kind == "step" else effort
        for effort in true.efforts
    )
    job = replace(
        true,
        role=role(name),
        scene=counterpart.scene,
        scene_id=scene_identity(counterpart.scene, times),
        times=times,
        efforts=efforts,
    )
    try:
        check_scene(counterpart.scene, t_end=float(times[-1]), t_start=float(times[0]))
    except ValueError as error:
        return replace(job, scene=None, error=str(error))
    return job


def role(invariance: str) -> str:
    """The role of an invariance's runs in records."""
    return f"invariance:{invariance}"


def _judged(each: _Set, results: CaseResults) -> list[InvarianceVerdict]:
    what = each.what
    true = results.get(what.variant.name, what.engine, MAIN)
    verdicts = []
    for invariance in INVARIANCES:
        head = InvarianceVerdict(
            case=what.case.name,
            variant=what.variant.name,
            engine=what.engine,
            invariance=invariance.name,
            status="not applicable",
        )
        if invariance.name in each.without:
            verdicts.append(msgspec.structs.replace(head, reason=each.without[invariance.name]))
            continue
        other = results.get(what.variant.name, what.engine, role(invariance.name))
        if other.status == "refused" and NO_START in other.message:
            verdicts.append(msgspec.structs.replace(head, reason=other.message))
            continue
        ended = next((one for one in (true, other) if one.status != "finished"), None)
        if ended is not None:
            verdicts.append(msgspec.structs.replace(head, status=ended.status, reason=ended.message))
            continue
        if true.rests and not _is_linearised(true):
            verdicts.append(msgspec.structs.replace(head, reason="nothing moves"))
            continue
        verdicts.append(_verdict(head, _findings(what, true, other, each.counterparts[invariance.name])))
    return verdicts


def _is_linearised(true: Result) -> bool:
    return any(_is_linear(name) for name in true.channels)


def _is_linear(channel: str) -> bool:
    """Whether a channel is one of the linearised motion, which there is at rest too."""
    return channel.partition(".")[0] in LINEAR_KINDS


def _findings(what: JudgedVariant, true: Result, other: Result, counterpart: Counterpart) -> dict[str, Finding]:
    """A finding for every channel of the true run that the counterpart has too, whether or not the case judges it."""
    told = _told(other, counterpart)
    findings: dict[str, Finding] = {}
    for name in true.channels:
        if name not in told.channels or not is_judged(name) or (true.rests and not _is_linear(name)):
            continue
        pattern = most_specific(what.goals, name)
        scale = most_specific(what.scales, name)
        finding = compare(
            name,
            _with_rounding(name, told, other, len(counterpart.scene.bodies)),
            true.signal(name, across=False),
            ANY if pattern is None else min(BOTH * what.goals[pattern], ANY),
            None if scale is None else what.scales[scale],
        )
        if pattern is not None or finding.status != "unresolved":  # a channel without a goal may be only rounding
            findings[name] = finding
    return findings


def _told(other: Result, counterpart: Counterpart) -> Result:
    """The counterpart's result on the true run's clock and in its frame, as far as coarse runs store all channels."""
    runs = tuple(_run(run, other, counterpart) for run in other.runs)
    return Result(other.variant, other.engine, other.status, other.message, runs)


def _run(run: RunRecord, other: Result, counterpart: Counterpart) -> RunRecord:
    if run.times is None or set(run.channels) != set(other.finest.channels):
        return msgspec.structs.replace(run, channels={})
    times = (unpack(run.times) - counterpart.starts_s) / counterpart.clock
    determined = {name: packed for name, packed in run.channels.items() if name not in other.open}
    channels = counterpart.told(times, {name: unpack(packed) for name, packed in determined.items()})
    return msgspec.structs.replace(
        run,
        times=pack(times),
        channels={name: pack(values) for name, values in channels.items()},
        effort_value=run.effort_value / counterpart.clock if run.effort_kind == "step" else run.effort_value,
    )


def _with_rounding(name: str, told: Result, other: Result, bodies: int) -> Signal:
    """A channel transformed back, with the rounding of what was added or subtracted, and of the terms of its sum.

    A vanishing load is a vanishing sum of moments of forces and of gyroscopic torques, which are of the size of the
    kinetic energy; likewise the work of large forces. In other axes and units such a sum rounds differently, as do
    positions along a chain of bodies."""
    signal = told.signal(name, across=False)
    sizes = signal.sizes
    is_sum = name == "work" or name.endswith(".torque")
    if is_sum and "energy.kinetic" in told.channels:
        sizes = (*sizes, magnitude("energy.kinetic", told.values("energy.kinetic")))
    moved = magnitude(name, other.values(name) - told.values(name))
    terms = max(sizes) if is_sum else 0.0
    floor = roundoff_floor(max(moved, terms), max(told.finest.evaluations, len(told.times)) + bodies)
    doubt = signal.uncertainty
    raised = Uncertainty(doubt.envelope + floor, doubt.value + floor, doubt.how, doubt.order)
    return Signal(signal.values, raised, sizes)


def _verdict(head: InvarianceVerdict, findings: dict[str, Finding]) -> InvarianceVerdict:
    """The verdict on all channels: the gravest of their statuses, shown by the channel with the largest E/U."""
    if not findings:
        return msgspec.structs.replace(head, status="did not run", reason="no channel could be compared")

    def excess(name: str) -> tuple[bool, float]:
        finding = findings[name]
        return finding.status not in ("agree", "unresolved"), (finding.E or 0.0) / (finding.U or np.inf)

    worst = max(findings, key=excess)
    unjudged = [name for name, found in findings.items() if found.status == "unresolved"]
    status = findings[worst].status
    if status == "agree" and unjudged:
        worst, status = unjudged[0], "unresolved"
    return msgspec.structs.replace(
        head,
        status=status,
        channel=worst,
        E=findings[worst].E,
        U=findings[worst].U,
        channels=len(findings),
        differing=tuple(name for name, found in findings.items() if found.status == "differ"),
        reason=findings[worst].reason,
    )
