"""Verdicts on a CSV of any code: its columns become channels, which are compared with the stored reference of a case.

If the case has no stored reference, or another variant or an engine is asked for, an engine runs as the reference.
"""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec
import numpy as np

from crosscheck.judging.against_reference import REFERENCE, of_stored
from crosscheck.judging.outcome import SessionOutcome
from crosscheck.judging.results import Result, collect
from crosscheck.judging.sizes import size_of
from crosscheck.judging.uncertainty import RungSignal, Uncertainty, estimate
from crosscheck.judging.verdict import Finding, Signal, Verdict, compare
from crosscheck.library.case import RunFile, Variant
from crosscheck.library.channels import kind_named
from crosscheck.library.find import Case
from crosscheck.library.patterns import most_specific
from crosscheck.library.reference import current_reference, has_reference
from crosscheck.records.archive import read
from crosscheck.running.job import MAIN
from crosscheck.running.plan import plan, sample_times, variant_scene
from crosscheck.running.pool import run_jobs
from crosscheck.running.scheduler import Limits, Scheduler
from crosscheck.running.sweep import PROVIDER, run_planned
from crosscheck.verify.causes import likely_cause
from crosscheck.verify.columns import Columns, VerifyError, read_columns, short_names
from flexmb.run.channels import distance, signal_range
from flexmb.scene.schema import Scene
from flexmb.typing import Real

YOURS = "csv"
INTERPOLATION = "interpolation from times of its own"


@dataclass(frozen=True)
class Detail:
    """For one channel the time (s) of the largest distance from the reference, and a guess of the cause."""

    worst_s: float
    cause: str = ""


@dataclass(frozen=True)
class CsvOutcome(SessionOutcome):
    """The outcome of a CSV, with details by channel; `left_out` are columns that were not compared.

    `against` describes the reference, `interpolated` the interpolation of a CSV with its own times ("" if there is
    none)."""

    details: dict[str, Detail] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()
    against: str = ""
    interpolated: str = ""


@dataclass(frozen=True)
class Target:
    """The reference of a CSV: signals at `times` (T,) s, made by `engine` and described by `title`."""

    engine: str
    title: str
    times: Real
    signals: dict[str, Signal]


def verify_csv(
    case: Case,
    file: Path,
    *,
    coarse: Path | None = None,
    variant: str | None = None,
    engine: str | None = None,
    provider: str = PROVIDER,
    scheduler: Scheduler = run_jobs,
) -> CsvOutcome:
    """Verdicts on every channel of a CSV against the stored reference of a case, for which no engine runs.

    An `engine`, or a `variant` of which there is no stored reference, is run instead (by default "native" on the first
    variant). The CSV's own U is 3 x its distance from the `coarse` CSV; without one it is taken to claim just the
    case's goal, plus the error of interpolation from other times. Of a complete trajectory.csv or reference.csv
    the channels are compared that have a goal and that the reference contains.
    """
    chosen = _variant(case, variant, stored=engine is None)
    target = _target(case, chosen, engine, provider, scheduler)
    mine = read_columns(file, target.times)
    rough = read_columns(coarse, target.times) if coarse is not None else Columns({})
    lacking = [name for name in mine.channels if name not in rough.channels]
    if coarse is not None and lacking:
        raise VerifyError(f"{coarse} lacks {', '.join(lacking)}, which {file} has: give both the same columns")
    verdicts, details, left_out = [], {}, list(mine.left_out)
    for name, values in mine.channels.items():
        channel = _known_as(name, target)
        goal = _goal(case.run, chosen, channel)
        if mine.own and (goal is None or channel not in target.signals):
            left_out.append(channel)
            continue
        added = mine.doubts.get(name, 0.0)
        finding = _judge(target, channel, values, rough.channels.get(name), goal, added)
        if goal is not None and finding.E is not None:
            details[channel] = detail = _detail(target, channel, values, goal, finding)
            cause = f"; {detail.cause}?" if detail.cause else ""
            finding = replace(finding, reason=f"{finding.reason}; worst at t = {detail.worst_s:.6g} s{cause}")
        verdicts.append(_verdict(case, chosen, channel, target, goal or 0.0, finding))
    return CsvOutcome(
        {case.name: verdicts},
        [],
        details=details,
        left_out=tuple(left_out),
        against=target.title,
        interpolated=_interpolation(mine, target),
    )


def outcome_json(outcome: CsvOutcome) -> str:
    """The outcome as JSON: the reference, whether all channels agree, and each channel with its figures."""
    channels = {
        verdict.channel: {
            "status": verdict.status,
            "E": verdict.E,
            "U": verdict.U,
            "goal": verdict.goal,
            "worst_s": detail.worst_s if (detail := outcome.details.get(verdict.channel)) else None,
            "cause": detail.cause if detail else "",
            "reason": verdict.reason,
        }
        for verdict in outcome.all
    }
    found = {
        "case": next(iter(outcome.verdicts)),
        "against": outcome.against,
        "ok": outcome.ok,
        "interpolated": outcome.interpolated,
        "left_out": outcome.left_out,
        "channels": channels,
    }
    return msgspec.json.format(msgspec.json.encode(found)).decode()


def read_signals(file: Path, times: Real) -> dict[str, Real]:
    """Channels (T, k) of a CSV whose times are the case's; groups such as tip.px, tip.py, tip.pz must be whole."""
    return read_columns(file, times).channels


def sample_times_csv(case: Case, variant: str | None) -> str:
    """A CSV to fill in: the times of the reference and a column for every component of every channel with a goal.

    Without a stored reference of the variant: the case's times, and all markers, hinges and wheels.
    """
    chosen = _variant(case, variant, stored=True)
    if _has_stored(case, chosen):
        reference = current_reference(case)
        times = reference.times
        shapes = {name: rows.shape[1] for name, rows in reference.channels.items()}
        shapes = {name: width for name, width in shapes.items() if _goal(case.run, chosen, name) is not None}
    else:
        times = sample_times(case.run, chosen)
        shapes = _shapes(variant_scene(case.scene(chosen), chosen))
    names = dict.fromkeys(column for channel, width in shapes.items() for column in short_names(channel, width))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["t", *names])
    writer.writerows([[repr(float(t)), *([""] * len(names))] for t in times])
    return text.getvalue()


def _shapes(scene: Scene) -> dict[str, int]:
    """Channels of the markers, hinges and wheels of a scene, with their widths."""
    items = {
        "marker": [marker.name for marker in scene.markers],
        "load": [hinge.name for hinge in scene.hinges],
        "wheel_load": [wheel.name for wheel in scene.wheels],
    }
    return {
        f"{kind}:{name}.{part.name}": len(part.letters)
        for kind, names in items.items()
        for name in names
        for part in kind_named(kind).parts
    }


def _variant(case: Case, name: str | None, stored: bool) -> Variant:
    """The variant called `name`; without a name that of the `stored` reference if it counts, else the first."""
    if name is not None:
        return case.run.variant(name)
    recipe = case.run.reference
    if stored and recipe is not None and has_reference(case.folder):
        return case.run.variant(recipe.variant)
    return case.run.variants[0]


def _has_stored(case: Case, variant: Variant) -> bool:
    recipe = case.run.reference
    return recipe is not None and recipe.variant == variant.name and has_reference(case.folder)


def _target(case: Case, variant: Variant, engine: str | None, provider: str, scheduler: Scheduler) -> Target:
    """The stored reference, or the result of an engine that runs now."""
    if engine is None and _has_stored(case, variant):
        stored = current_reference(case)
        signals = of_stored(stored)
        title = f"the stored reference of variant {variant.name}, to {stored.times[-1]:g} s"
        return Target(REFERENCE, title, stored.times, {name: signals.signal(name) for name in signals.channels})
    name = engine or "native"
    result = _run(case, variant, name, provider, scheduler)
    signals_now = {channel: result.signal(channel, across=False) for channel in result.channels}
    return Target(name, f"{name}, run now on variant {variant.name}", result.times, signals_now)


def _run(case: Case, variant: Variant, engine: str, provider: str, scheduler: Scheduler) -> Result:
    """The engine's result on the variant, run now in a worker process."""
    run = case.run.alone(msgspec.structs.replace(variant, engines=(engine,), also=(), refined=None))
    with TemporaryDirectory() as folder:
        records = Path(folder) / "records.jsonl"
        planned = plan(replace(case, run=run), (), provider)
        run_planned([planned], (), records, limits=Limits(workers=1), scheduler=scheduler)
        (results,) = collect(read(records)).cases
    result = results.get(variant.name, engine, MAIN)
    if result.status != "finished":
        raise VerifyError(f"the reference, {engine} on {variant.name}, is not there: {result.status}: {result.message}")
    return result


def _goal(run: RunFile, variant: Variant, channel: str) -> float | None:
    """The goal of the stored reference, or else of the first comparison of the variant that judges the channel."""
    recipe = run.reference
    asked = [recipe.goals] if recipe is not None and recipe.variant == variant.name else []
    for item in run.comparisons:
        sides = [side.variant for side in (item.a, item.b) if side is not None]
        if variant.name in (item.variant, *sides):
            asked.append(item.goals)
    for goals in asked:
        pattern = most_specific(goals, channel)
        if pattern is not None:
            return goals[pattern]
    return None


def _judge(
    reference: Target, channel: str, values: Real, rough: Real | None, goal: float | None, added: float
) -> Finding:
    """The finding on a channel; `added` (SI) is what interpolation adds to the U of its values."""
    if channel not in reference.signals:
        return Finding("did not run", f"the reference has no channel {channel}: check the name")
    if goal is None:
        return Finding("refused", "the case sets no goal for this channel")
    target = reference.signals[channel]
    if rough is not None:
        doubt = estimate(channel, "tolerance", [RungSignal(2.0, rough), RungSignal(1.0, values)], target.sizes[0])
        if added:
            doubt = Uncertainty(doubt.envelope + added, doubt.value + added, f"{doubt.how}; {INTERPOLATION}")
    else:
        doubt = _claimed(channel, target, goal, added)
    return compare(channel, Signal(values, doubt, target.sizes), target, goal)


def _known_as(channel: str, reference: Target) -> str:
    """The channel's name in the reference: that of a wheel's load if no hinge has the name."""
    wheel = f"wheel_{channel}"
    return wheel if channel not in reference.signals and wheel in reference.signals else channel


def _detail(reference: Target, channel: str, values: Real, goal: float, finding: Finding) -> Detail:
    target = reference.signals[channel]
    worst = float(reference.times[int(np.argmax(distance(channel, values, target.values)))])
    if finding.status == "agree":
        return Detail(worst)
    allowed = max(goal * signal_range(channel, target.values), target.uncertainty.value)
    markers = {
        name.partition(":")[2].rpartition(".")[0]: signal.values
        for name, signal in reference.signals.items()
        if name.endswith(".orientation")
    }
    return Detail(worst, likely_cause(channel, values, target.values, allowed, markers))


def _claimed(channel: str, target: Signal, goal: float, added: float) -> Uncertainty:
    """The U that together with the reference's just meets the goal (within rounding), or `added` if larger.

    The goal is relative to the signal's size, as in verdicts.
    """
    size = size_of(signal_range(channel, target.values), target.sizes, target.uncertainty.value)
    allowed = goal * size * (1.0 - 1e-12) - target.uncertainty.value
    value, how = (allowed, "claimed: the case's goal") if allowed >= added else (added, INTERPOLATION)
    value = max(value, 0.0)
    return Uncertainty(np.full(len(target.values), value), value, how)


def _interpolation(mine: Columns, target: Target) -> str:
    """The interpolation of a CSV with its own times, in words; "" if there was none."""
    if not mine.doubts:
        return ""
    sizes = {name: target.signals.get(_known_as(name, target)) for name in mine.doubts}
    shares = {
        name: mine.doubts[name] / size
        for name, signal in sizes.items()
        if signal is not None and (size := max(signal_range(name, signal.values), *signal.sizes)) > 0.0
    }
    most = max(shares, key=lambda name: shares[name], default="")
    part = f", at most {shares[most]:.2g} of the range, in {most}" if most else ""
    return (
        f"{mine.samples} samples at times of its own, interpolated at the reference's {len(target.times)} by splines "
        f"of degree 5; the difference from degree 3 is added to U{part}"
    )


def _verdict(case: Case, variant: Variant, channel: str, target: Target, goal: float, finding: Finding) -> Verdict:
    return Verdict(
        case=case.name,
        comparison=f"your results against {target.engine}",
        kind="comparison",
        channel=channel,
        variant_a=variant.name,
        engine_a=YOURS,
        variant_b=variant.name,
        engine_b=target.engine,
        level="",
        status=finding.status,
        expected="agree",
        E=finding.E,
        U=finding.U,
        goal=goal,
        scale=finding.scale,
        reason=finding.reason,
    )


__all__ = ["CsvOutcome", "Detail", "VerifyError", "outcome_json", "read_signals", "sample_times_csv", "verify_csv"]
