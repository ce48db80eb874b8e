"""Holding a CSV of somebody's code against a case: columns to channels, one engine as reference, the usual verdicts."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec
import numpy as np

from crosscheck.judging.outcome import SessionOutcome
from crosscheck.judging.results import Result, collect
from crosscheck.judging.uncertainty import RungSignal, Uncertainty, estimate
from crosscheck.judging.verdict import Finding, Signal, Verdict, compare
from crosscheck.library.case import RunFile, Variant
from crosscheck.library.find import Case
from crosscheck.records.archive import read
from crosscheck.running.plan import MAIN, sample_times, variant_scene
from crosscheck.running.scheduler import Limits
from crosscheck.running.sweep import PROVIDER, sweep
from crosscheck.verify.causes import likely_cause
from crosscheck.verify.columns import LOAD_GROUPS, MARKER_GROUPS, Columns, VerifyError, read_columns
from flexmb.run.channels import distance, matches, signal_range
from flexmb.typing import Real

YOURS = "csv"


@dataclass(frozen=True)
class Detail:
    """Of one channel: the time (s) at which it is farthest from the reference, and why, if there is a guess."""

    worst_s: float
    cause: str = ""


@dataclass(frozen=True)
class CsvOutcome(SessionOutcome):
    """The outcome of a CSV, with details by channel; `left_out` are columns that were not compared."""

    details: dict[str, Detail] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()


def verify_csv(
    case: Case,
    file: Path,
    *,
    coarse: Path | None = None,
    variant: str | None = None,
    engine: str = "native",
    provider: str = PROVIDER,
) -> CsvOutcome:
    """Verdicts on every channel of a CSV against `engine` on a variant (by default the first) of a case.

    The CSV's own U is 3 x its distance from the `coarse` CSV; without one it is taken to claim just the case's goal. Of
    a whole trajectory.csv those channels are compared that the case sets a goal for and the engine offers.
    """
    chosen = _variant(case, variant)
    times = sample_times(case.run, chosen)
    mine = read_columns(file, times)
    rough = read_columns(coarse, times) if coarse is not None else Columns({})
    lacking = [name for name in mine.channels if name not in rough.channels]
    if coarse is not None and lacking:
        raise VerifyError(f"{coarse} lacks {', '.join(lacking)}, which {file} has: give both the same columns")
    reference = _reference(case, chosen, engine, provider)
    verdicts, details, left_out = [], {}, list(mine.left_out)
    for name, values in mine.channels.items():
        channel = _known_as(name, reference)
        goal = _goal(case.run, chosen, channel)
        if mine.own and (goal is None or channel not in reference.channels):
            left_out.append(channel)
            continue
        finding = _judge(reference, channel, values, rough.channels.get(name), goal)
        if goal is not None and finding.E is not None:
            details[channel] = detail = _detail(reference, channel, values, goal, times, finding)
            cause = f"; {detail.cause}?" if detail.cause else ""
            finding = replace(finding, reason=f"{finding.reason}; worst at t = {detail.worst_s:.6g} s{cause}")
        verdicts.append(_verdict(case, chosen, channel, engine, goal or 0.0, finding))
    return CsvOutcome({case.name: verdicts}, [], details=details, left_out=tuple(left_out))


def read_signals(file: Path, times: Real) -> dict[str, Real]:
    """Channels (T, k) of a CSV whose times are the case's; groups such as tip.px, tip.py, tip.pz must be whole."""
    return read_columns(file, times).channels


def sample_times_csv(case: Case, variant: str | None) -> str:
    """A CSV to fill in: the case's times and a column for every component of every marker and hinge."""
    chosen = _variant(case, variant)
    scene = variant_scene(case.scene(chosen), chosen)
    names = [f"{marker.name}.{part}" for marker in scene.markers for group in MARKER_GROUPS.values() for part in group]
    names += [f"{hinge.name}.{part}" for hinge in scene.hinges for group in LOAD_GROUPS.values() for part in group]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["t", *names])
    writer.writerows([[repr(float(t)), *([""] * len(names))] for t in sample_times(case.run, chosen)])
    return text.getvalue()


def _variant(case: Case, name: str | None) -> Variant:
    return case.run.variants[0] if name is None else case.run.variant(name)


def _reference(case: Case, variant: Variant, engine: str, provider: str) -> Result:
    """The engine's result on the variant, run now, in a worker: what hangs or ends its process gives no reference."""
    run = msgspec.structs.replace(
        case.run,
        variants=(msgspec.structs.replace(variant, engines=(engine,), also=(), refined=None),),
        comparisons=(),
        controls=(),
        conservations=(),
        charts=(),
    )
    with TemporaryDirectory() as folder:
        records = Path(folder) / "records.jsonl"
        sweep((replace(case, run=run),), (), records, provider=provider, limits=Limits(workers=1))
        (results,) = collect(read(records)).cases
    result = results.get(variant.name, engine, MAIN)
    if result.status != "finished":
        raise VerifyError(f"the reference, {engine} on {variant.name}, is not there: {result.status}: {result.message}")
    return result


def _goal(run: RunFile, variant: Variant, channel: str) -> float | None:
    """The goal of the first comparison of the variant that judges the channel."""
    for item in run.comparisons:
        sides = [side.variant for side in (item.a, item.b) if side is not None]
        if variant.name in (item.variant, *sides):
            naming = [pattern for pattern in item.goals if matches(pattern, channel)]
            if naming:
                return item.goals[max(naming, key=len)]
    return None


def _judge(reference: Result, channel: str, values: Real, rough: Real | None, goal: float | None) -> Finding:
    if channel not in reference.channels:
        return Finding("did not run", f"the reference has no channel {channel}: check the name")
    if goal is None:
        return Finding("refused", "the case sets no goal for this channel")
    target = reference.signal(channel, across=False)
    if rough is not None:
        doubt = estimate(channel, "tolerance", [RungSignal(2.0, rough), RungSignal(1.0, values)], 0, target.sizes[0])
    else:
        doubt = _claimed(channel, target, goal)
    return compare(channel, Signal(values, doubt, target.sizes), target, goal)


def _known_as(channel: str, reference: Result) -> str:
    """The channel's name in the reference: the load of a wheel where no hinge has that name."""
    wheel = f"wheel_{channel}"
    return wheel if channel not in reference.channels and wheel in reference.channels else channel


def _detail(reference: Result, channel: str, values: Real, goal: float, times: Real, finding: Finding) -> Detail:
    target = reference.values(channel)
    worst = float(times[int(np.argmax(distance(channel, values, target)))])
    if finding.status == "agree":
        return Detail(worst)
    allowed = max(goal * signal_range(channel, target), reference.uncertainty(channel).value)
    markers = {
        name.partition(":")[2].rpartition(".")[0]: reference.values(name)
        for name in reference.channels
        if name.endswith(".orientation")
    }
    return Detail(worst, likely_cause(channel, values, target, allowed, markers))


def _claimed(channel: str, target: Signal, goal: float) -> Uncertainty:
    """The U that, with the reference's, just makes the goal (less a rounding, so that it does).

    The goal is relative to what the verdict takes for the signal's size: that of its family where the signal is zero.
    """
    sizes = (signal_range(channel, target.values), *target.sizes)
    size = next((size for size in sizes if size > target.uncertainty.value), 0.0)
    allowed = goal * size * (1.0 - 1e-12)
    value = max(allowed - target.uncertainty.value, 0.0)
    return Uncertainty(np.full(len(target.values), value), value, "claimed: the case's goal")


def _verdict(case: Case, variant: Variant, channel: str, engine: str, goal: float, finding: Finding) -> Verdict:
    return Verdict(
        case=case.name,
        comparison=f"your results against {engine}",
        kind="comparison",
        channel=channel,
        variant_a=variant.name,
        engine_a=YOURS,
        variant_b=variant.name,
        engine_b=engine,
        level="",
        status=finding.status,
        expected="agree",
        E=finding.E,
        U=finding.U,
        goal=goal,
        scale=finding.scale,
        reason=finding.reason,
    )


__all__ = ["CsvOutcome", "Detail", "VerifyError", "read_signals", "sample_times_csv", "verify_csv"]
