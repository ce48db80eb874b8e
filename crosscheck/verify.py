"""Holding a CSV of somebody's code against a case: columns to channels, one engine as reference, the usual verdicts."""

from __future__ import annotations

import csv
import io
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from crosscheck.case import RunFile, Variant
from crosscheck.execute import execute
from crosscheck.library import Case
from crosscheck.plan import MAIN, plan, sample_times, variant_scene
from crosscheck.records import RunRecord
from crosscheck.report.outcome import Outcome
from crosscheck.results import Result, collect
from crosscheck.sweep import PROVIDER
from crosscheck.uncertainty import Rung, Uncertainty, estimate
from crosscheck.verdict import Finding, Signal, Verdict, compare
from flexmb.channels import matches, signal_range

Array = NDArray[np.float64]
MARKER_GROUPS = {
    "position": ("px", "py", "pz"),
    "orientation": ("qw", "qx", "qy", "qz"),
    "velocity": ("vx", "vy", "vz"),
    "angular_velocity": ("wx", "wy", "wz"),
}
LOAD_GROUPS = {"torque": ("tx", "ty", "tz"), "force": ("fx", "fy", "fz")}
TIME_MATCH_S = 1e-9
YOURS = "csv"


class VerifyError(ValueError):
    """A CSV or a request that cannot be compared; the message says what to change."""


def verify_csv(
    case: Case,
    file: Path,
    *,
    coarse: Path | None = None,
    variant: str | None = None,
    engine: str = "native",
    provider: str = PROVIDER,
) -> Outcome:
    """Verdicts on every channel of a CSV against `engine` on a variant (by default the first) of a case.

    The CSV's own U is 3 x its distance from the `coarse` CSV; without one it is taken to claim just the case's goal.
    """
    chosen = _variant(case, variant)
    times = sample_times(case.run, chosen)
    signals = read_signals(file, times)
    rough = read_signals(coarse, times) if coarse is not None else {}
    reference = _reference(case, chosen, engine, provider)
    verdicts = []
    for channel, values in signals.items():
        goal = _goal(case.run, chosen, channel)
        finding = _judge(reference, channel, values, rough.get(channel), goal)
        verdicts.append(_verdict(case, chosen, channel, engine, goal or 0.0, finding))
    return Outcome(verdicts={case.name: verdicts}, absences=[])


def read_signals(file: Path, times: Array) -> dict[str, Array]:
    """Channels (T, k) of a CSV whose times are the case's; groups such as tip.px, tip.py, tip.pz must be whole."""
    columns = _columns(file)
    if len(columns["t"]) != len(times) or np.max(np.abs(columns["t"] - times)) > TIME_MATCH_S:
        asked = f"{len(times)} samples, every {times[1] - times[0]:.10g} s from 0 to {times[-1]:g} s"
        raise VerifyError(f"{file}: its times are not the case's ({asked}); --template writes a file with them")
    return _grouped(file, {name: values for name, values in columns.items() if name != "t"})


def _columns(file: Path) -> dict[str, Array]:
    """Columns of a CSV by name; an empty cell is NaN."""
    try:
        with file.open(encoding="utf-8", newline="") as stream:
            header, *rows = csv.reader(stream)
        table = np.array([[float(cell) if cell.strip() else np.nan for cell in row] for row in rows])
        columns = dict(zip((name.strip() for name in header), table.T, strict=True))
    except (OSError, ValueError) as error:
        raise VerifyError(f"{file} cannot be read as a CSV of numbers with one header line: {error}") from None
    if next(iter(columns)) != "t":
        raise VerifyError(f'{file}: the first column must be "t"; it is "{next(iter(columns))}"')
    return columns


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


def _grouped(file: Path, columns: dict[str, Array]) -> dict[str, Array]:
    """Whole groups of filled columns as channels; VerifyError for a column that belongs to no whole group."""
    found: dict[str, Array] = {}
    filled = {name: values for name, values in columns.items() if not np.all(np.isnan(values))}
    for item in dict.fromkeys(name.rpartition(".")[0] for name in filled):
        for prefix, groups in (("marker", MARKER_GROUPS), ("load", LOAD_GROUPS)):
            for part, letters in groups.items():
                names = [f"{item}.{letter}" for letter in letters]
                if all(name in filled for name in names):
                    found[f"{prefix}:{item}.{part}"] = np.column_stack([filled.pop(name) for name in names])
    if filled:
        raise VerifyError(f"{file}: no whole group contains {', '.join(filled)}; the groups are {_groups_text()}")
    if not found:
        raise VerifyError(f"{file}: there is nothing in it but times")
    return found


def _groups_text() -> str:
    groups = (*MARKER_GROUPS.values(), *LOAD_GROUPS.values())
    return ", ".join("NAME." + "/".join(group) for group in groups)


def _variant(case: Case, name: str | None) -> Variant:
    return case.run.variants[0] if name is None else case.run.variant(name)


def _reference(case: Case, variant: Variant, engine: str, provider: str) -> Result:
    """The engine's result on the variant, run here and now."""
    run = msgspec.structs.replace(
        case.run,
        variants=(msgspec.structs.replace(variant, engines=(engine,), also=(), refined=None),),
        comparisons=(),
        controls=(),
        conservations=(),
        charts=(),
    )
    record, (job,) = plan(replace(case, run=run), (), provider)
    runs: list[RunRecord] = []
    execute(job, lambda event: runs.append(event) if isinstance(event, RunRecord) else None)
    (results,) = collect([record, *runs]).cases
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


def _judge(reference: Result, channel: str, values: Array, rough: Array | None, goal: float | None) -> Finding:
    if channel not in reference.channels:
        return Finding("did not run", f"the reference has no channel {channel}: check the name")
    if goal is None:
        return Finding("refused", "the case sets no goal for this channel")
    if not np.all(np.isfinite(values)):
        return Finding("failed", "there are empty cells or values that are not numbers")
    target = reference.signal(channel, across=False)
    if rough is not None:
        doubt = estimate(channel, "tolerance", [Rung(2.0, rough), Rung(1.0, values)], 0, target.sizes[0])
    else:
        doubt = _claimed(channel, target, goal)
    return compare(channel, Signal(values, doubt, target.sizes), target, goal)


def _claimed(channel: str, target: Signal, goal: float) -> Uncertainty:
    """The U that, with the reference's, just makes the goal (less a rounding, so that it does)."""
    allowed = goal * signal_range(channel, target.values) * (1.0 - 1e-12)
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
