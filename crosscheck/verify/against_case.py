"""Verdicts on a CSV of any code: its columns become channels, which are compared with the stored reference of a case.

If the case has no stored reference, or another variant or an engine is asked for, an engine runs as the reference.
A CSV with times of its own is compared at these: its values are never interpolated.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from crosscheck.engines.registry import PROVIDER
from crosscheck.judging.against_reference import CLOCK, shared_times
from crosscheck.judging.sizes import size_of
from crosscheck.judging.uncertainty import RungSignal, Uncertainty, estimate
from crosscheck.judging.verdict import Finding, Signal, Verdict, compare
from crosscheck.library.case import CaseError, Variant
from crosscheck.library.channels import kind_named
from crosscheck.library.find import Case
from crosscheck.library.reference import current_reference
from crosscheck.running.plan import sample_times, variant_scene
from crosscheck.running.pool import run_jobs
from crosscheck.running.scheduler import Scheduler
from crosscheck.verify.causes import diagnose, other_clock
from crosscheck.verify.clock import at_jumps, suspect
from crosscheck.verify.columns import FEWEST, Columns, TimesError, VerifyError, read_columns, short_names
from crosscheck.verify.evidence import Evidence
from crosscheck.verify.outcome import CsvOutcome, Detail, outcome_json
from crosscheck.verify.target import Target, chosen_variant, goal_of, has_stored, target_of
from flexmb.output.files import as_text
from flexmb.run.channels import distance, family, signal_range
from flexmb.scene.schema import Scene
from flexmb.typing import Real

# A CSV to fill in.


def sample_times_csv(case: Case, variant: str | None) -> str:
    """The times of the reference and a column for every component of every channel with a goal.

    Without a stored reference of the variant: the case's times, and all markers, hinges and wheels.
    """
    chosen = chosen_variant(case, variant, stored=True)
    if has_stored(case, chosen):
        reference = current_reference(case)
        times = reference.times
        shapes = {name: rows.shape[1] for name, rows in reference.channels.items()}
        shapes = {name: width for name, width in shapes.items() if goal_of(case.run, chosen, name) is not None}
    else:
        times = sample_times(case.run, chosen)
        shapes = _shapes(variant_scene(case.scene(chosen), chosen))
    names = dict.fromkeys(column for channel, width in shapes.items() for column in short_names(channel, width))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["t", *map(as_text, names)])
    writer.writerows([[repr(float(t)), *([""] * len(names))] for t in times])
    return text.getvalue()


def _shapes(scene: Scene) -> dict[str, int]:
    """Channels of the markers, hinges and wheels of a scene, with their widths."""
    items = {
        "marker": [marker.name for marker in scene.markers],
        "load": [hinge.name for hinge in scene.hinges],
        "total_load": [total.name for total in scene.total_loads],
        "wheel_load": [wheel.name for wheel in scene.wheels],
    }
    return {
        f"{kind}:{name}.{part.name}": len(part.letters)
        for kind, names in items.items()
        for name in names
        for part in kind_named(kind).parts
    }


YOURS = "csv"


@dataclass(frozen=True)
class _Asked:
    """A CSV as it is compared: its columns `mine` at the times compared, `rough` at some of them (`shared`)."""

    case: Case
    variant: Variant
    target: Target
    mine: Columns
    rough: Columns | None
    shared: np.ndarray

    def goal(self, channel: str) -> float | None:
        return goal_of(self.case.run, self.variant, channel)


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
    """Verdicts on every channel of a CSV against the stored reference of a case.

    No engine runs if the CSV has the reference's times or some of them. At other times the reference is computed by an
    engine of its recipe, in runs that reproduce what is stored. An `engine`, or a `variant` of which there is no stored
    reference, is run instead (by default "native" on the first variant). The CSV's own U is 3 x its distance from the
    `coarse` CSV at the times that both have; without one it is taken to claim just the case's goal. Of a complete
    trajectory.csv or reference.csv the channels are compared that have a goal and that the reference contains. Where a
    channel differs, the engine may run again, to find out whether a jump or shifted times explain it.
    """
    chosen = chosen_variant(case, variant, stored=engine is None)
    target = target_of(case, chosen, engine, provider, scheduler)
    try:
        whole = read_columns(file, target.times)
    except TimesError as error:
        unit = other_clock(file, target, lambda columns: _moving_and_agreeing(case, chosen, target, columns))
        raise (TimesError(f"{error}; {unit}") if unit else error) from None
    mine = compared(whole, target.times)
    rough, shared = None, np.zeros(0, int)
    if coarse is not None:
        rough, shared = _coarse(coarse, file, mine, target)
    asked = _Asked(case, chosen, target, mine, rough, shared)
    outcome = _judged(asked)
    if not outcome.ok and whole.times[-1] > 2.0 * target.times[-1]:
        unit = other_clock(file, target, lambda columns: _moving_and_agreeing(case, chosen, target, columns))
        if unit:
            raise TimesError(f"{file}: {unit}")
    return replace(outcome, interpolated=_own_times(whole, mine, target))


def read_signals(file: Path, times: Real) -> dict[str, Real]:
    """Channels (T, k) of a CSV whose times are the case's; groups such as tip.px, tip.py, tip.pz must be whole."""
    return compared(read_columns(file, times), times).channels


def compared(whole: Columns, times: Real) -> Columns:
    """The columns at the times of the reference if they are all there, else at all their own times up to its end."""
    places = shared_times(times, whole.times)
    if places is not None:
        return replace(whole.at(places), times=times)
    slack = CLOCK * times[-1]
    inside = whole.at(np.flatnonzero((whole.times >= times[0] - slack) & (whole.times <= times[-1] + slack)))
    return replace(inside, times=np.clip(inside.times, times[0], times[-1]))


def _coarse(file: Path, other: Path, mine: Columns, target: Target) -> tuple[Columns, np.ndarray]:
    """The coarse columns, and the places among the times of `mine`, at the times that both have."""
    rough = read_columns(file, target.times)
    lacking = [name for name in mine.channels if name not in rough.channels]
    if lacking:
        raise VerifyError(f"{file} lacks {', '.join(lacking)}, which {other} has: give both the same columns")
    after = np.clip(np.searchsorted(rough.times, mine.times), 1, len(rough.times) - 1)
    nearest = np.where(mine.times - rough.times[after - 1] < rough.times[after] - mine.times, after - 1, after)
    shared = np.flatnonzero(np.abs(rough.times[nearest] - mine.times) <= CLOCK * target.times[-1])
    if len(shared) < min(FEWEST, len(mine.times)):
        said = f"{file} has only {len(shared)} of the {len(mine.times)} times that are compared of {other}"
        raise VerifyError(f"{said}: write both at the same times, or one at some of the other's")
    return rough.at(nearest[shared]), shared


def _judged(asked: _Asked) -> CsvOutcome:
    """The verdicts, with details."""
    target, mine = asked.target, asked.mine
    signals = target.signals(mine.times)
    goals, findings, values = {}, {}, {}
    left_out = list(mine.left_out)
    for name, rows in mine.channels.items():
        channel = _known_as(name, signals, target)
        goal = asked.goal(channel)
        if mine.own and (goal is None or channel not in {*signals, *target.known}):
            left_out.append(channel)
            continue
        goals[channel], values[channel] = goal, rows
        findings[channel] = _finding(asked, channel, name, rows, signals, goal)
    details = {
        channel: Detail(_worst(channel, values[channel], signals[channel], mine.times))
        for channel, finding in findings.items()
        if goals[channel] is not None and finding.E is not None
    }
    seen = {
        channel: _evidence(asked, channel, values[channel], signals, goals[channel] or 0.0)
        for channel in details
        if findings[channel].status == "differ"
    }
    for channel, places in _jumping(asked, seen, goals).items():
        kept = np.setdiff1d(np.arange(len(mine.times)), places)
        again = _finding(asked, channel, channel, values[channel], signals, goals[channel], kept)
        when = tuple(float(t) for t in mine.times[places])
        worst = _worst(channel, values[channel][kept], _only(signals[channel], kept), mine.times[kept])
        findings[channel], details[channel] = again, Detail(worst, left_out=when)
        if again.status != "differ":
            del seen[channel]
    for channel, causes in diagnose(seen, target).items():
        details[channel] = replace(details[channel], causes=causes)
    verdicts = [
        _verdict(asked, channel, goals[channel] or 0.0, _told(finding, details.get(channel)))
        for channel, finding in findings.items()
    ]
    judgeable = [name for name in (target.known or tuple(signals)) if asked.goal(name) is not None]
    return CsvOutcome(
        {asked.case.name: verdicts},
        [],
        details=details,
        left_out=tuple(left_out),
        against=target.title,
        not_given=tuple(name for name in judgeable if name not in findings),
    )


def _finding(
    asked: _Asked,
    channel: str,
    name: str,
    values: Real,
    signals: Mapping[str, Signal],
    goal: float | None,
    kept: np.ndarray | None = None,
) -> Finding:
    """The finding on a channel, which the file calls `name`; of the samples `kept` alone, if only they count."""
    if channel not in signals and channel in asked.target.known:
        return Finding("unresolved", "no engine of the reference gives this channel at your times: take the template's")
    if channel not in signals:
        return Finding("did not run", f"the reference has no channel {channel}: check the name")
    if goal is None:
        return Finding("refused", "the case sets no goal for this channel")
    target = signals[channel] if kept is None else _only(signals[channel], kept)
    if asked.rough is not None:
        coarse = asked.rough.channels.get(name)
        assert coarse is not None  # `_coarse` refuses files that lack a channel
        ladder = [RungSignal(2.0, coarse), RungSignal(1.0, values[asked.shared])]
        doubt = estimate(channel, "tolerance", ladder, target.sizes[0])
    else:
        doubt = _claimed(channel, target, goal)
    mine = Signal(values if kept is None else values[kept], doubt, target.sizes)
    return compare(channel, mine, target, goal)


def _claimed(channel: str, target: Signal, goal: float) -> Uncertainty:
    """The U that together with the reference's just meets the goal (within rounding)."""
    value = max(_allowed(channel, target, goal) - target.uncertainty.value, 0.0)
    return Uncertainty(np.full(len(target.values), value), value, "claimed: the case's goal")


def _allowed(channel: str, target: Signal, goal: float) -> float:
    """The distance (SI) up to which a file that claims the goal agrees; sizes are those of verdicts."""
    own = 0.0 if family(channel) == "energy" else signal_range(channel, target.values)
    size = size_of(own, target.sizes, target.uncertainty.value)
    return goal * size * (1.0 - 1e-12)


def _evidence(asked: _Asked, channel: str, values: Real, signals: Mapping[str, Signal], goal: float) -> Evidence:
    target = signals[channel]
    allowed = max(_allowed(channel, target, goal), target.uncertainty.value)
    return Evidence(
        channel, values, asked.mine.times, {name: signal.values for name, signal in signals.items()}, allowed
    )


def _jumping(
    asked: _Asked, differing: Mapping[str, Evidence], goals: Mapping[str, float | None]
) -> dict[str, np.ndarray]:
    """For channels with few samples that are too far off, those at which the reference jumps."""
    t_end, suspects = float(asked.target.times[-1]), {}
    for channel, seen in differing.items():
        near_s = max(goals[channel] or 0.0, CLOCK) * t_end
        found = suspect(channel, seen.values, seen.reference, seen.allowed, near_s)
        if found is not None:
            suspects[channel] = found
    if not suspects:
        return {}
    try:
        found_at = at_jumps(suspects, asked.mine.times, lambda times: _rows(asked.target, times), t_end)
    except (CaseError, VerifyError):  # no engine of the reference runs here: nothing is excused
        return {}
    return {channel: places for channel, places in found_at.items() if len(places)}


def _rows(target: Target, times: Real) -> dict[str, Real]:
    return {name: signal.values for name, signal in target.signals(times).items()}


def _moving_and_agreeing(case: Case, variant: Variant, target: Target, columns: Columns) -> tuple[int, int]:
    """How many channels that move agree, and how many there are, without a search for causes."""
    mine = compared(columns, target.times)
    signals = target.signals(mine.times)
    asked = _Asked(case, variant, target, mine, None, np.zeros(0, int))
    agreeing, count = 0, 0
    for name, rows in mine.channels.items():
        channel = _known_as(name, signals, target)
        goal = goal_of(case.run, variant, channel)
        if goal is None or channel not in signals:
            continue
        if _evidence(asked, channel, rows, signals, goal).varies:
            count += 1
            agreeing += _finding(asked, channel, name, rows, signals, goal).status == "agree"
    return agreeing, count


def _known_as(channel: str, signals: Mapping[str, Signal], target: Target) -> str:
    """The channel's name in the reference: that of a wheel's load if no hinge has the name."""
    wheel, known = f"wheel_{channel}", {*signals, *target.known}
    return wheel if channel not in known and wheel in known else channel


def _only(signal: Signal, kept: np.ndarray) -> Signal:
    """Some samples of a signal, with the U and the sizes of the whole."""
    doubt = replace(signal.uncertainty, envelope=signal.uncertainty.envelope[kept])
    return Signal(signal.values[kept], doubt, signal.sizes)


def _worst(channel: str, values: Real, target: Signal, times: Real) -> float:
    """When (s) the distance is largest."""
    return float(times[int(np.argmax(distance(channel, values, target.values)))])


def _told(finding: Finding, detail: Detail | None) -> Finding:
    """The finding with its details in words."""
    if detail is None:
        return finding
    cause = f"; {detail.cause.removesuffix('?')}?" if detail.cause else ""
    left = ""
    if detail.left_out:
        first, more = f"t = {detail.left_out[0]:.6g} s", len(detail.left_out) - 1
        left = f"; left out: the sample at {first}{f' and {more} more' if more else ''}, where the reference jumps"
    return replace(finding, reason=f"{finding.reason}; worst at t = {detail.worst_s:.6g} s{left}{cause}")


def _own_times(whole: Columns, mine: Columns, target: Target) -> str:
    """How a CSV with its own times was compared, in words; "" if it has those of the reference."""
    if shared_times(target.times, whole.times) is not None:
        return ""
    if shared_times(mine.times, target.times) is not None:
        return f"{len(mine.times)} samples, at some of the reference's {len(target.times)} times"
    return (
        f"{len(mine.times)} samples at times of its own; nothing was interpolated: the reference was computed at these "
        "times, by an engine that reproduces what is stored"
        if target.known
        else f"{len(mine.times)} samples at times of its own, at which {target.engine} ran"
    )


def _verdict(asked: _Asked, channel: str, goal: float, finding: Finding) -> Verdict:
    return Verdict(
        case=asked.case.name,
        comparison=f"your results against {asked.target.engine}",
        kind="comparison",
        channel=channel,
        variant_a=asked.variant.name,
        engine_a=YOURS,
        variant_b=asked.variant.name,
        engine_b=asked.target.engine,
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
