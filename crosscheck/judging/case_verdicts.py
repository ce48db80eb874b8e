"""The verdicts of a case from its results: every channel of every comparison, control and conservation check."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

import numpy as np

from crosscheck.judging.against_reference import judge_reference
from crosscheck.judging.basis import basis
from crosscheck.judging.finer_efforts import finer_efforts
from crosscheck.judging.question import Question, coordinates_of, with_worst_entry
from crosscheck.judging.results import CaseResults, Result
from crosscheck.judging.verdict import (
    SEVERITY,
    Finding,
    Verdict,
    compare,
    conserve,
    determined,
    not_determined,
    with_open,
)
from crosscheck.library.accepted import key
from crosscheck.library.case import Band, Comparison, ComparisonSide, Conservation, Control
from crosscheck.library.channels import CONSERVED, most_specific
from flexmb.run.channels import matches, norms

CLOCK = 1e-9  # relative difference up to which two times are the same: old records have the engines' own times
TRUE_MODEL = "conservation law"


def judge(case: CaseResults) -> list[Verdict]:
    """All verdicts of a case, in the order of its run file, then those against its stored reference."""
    run = case.case.run
    verdicts: list[Verdict] = []
    for comparison in run.comparisons:
        verdicts += _comparison(case, comparison)
    for control in run.controls:
        verdicts += _control(case, control)
    for conservation in run.conservations:
        verdicts += (_conservation(case, conservation, engine) for engine in conservation.engines)
    verdicts += judge_reference(case)
    return verdicts


def _comparison(case: CaseResults, item: Comparison) -> Iterator[Verdict]:
    a, b = (case.get(side.variant, side.engine) for side in item.sides)
    stands_on = basis(case.case.variants, (a, b), item.scales)
    question = Question(case.case, item.name, "comparison", *item.sides, item.expect, item.reason, stands_on)
    across, is_open = question.a.variant != question.b.variant, case.undetermined(a.variant, b.variant)
    for channel, goal, finding in _channels(item.goals, a, b, case):
        wanted = question.goal(channel, goal)
        if finding is None:
            scale = _scale(item.scales, channel)
            one, other = (determined(channel, side.signal(channel, across), is_open) for side in (a, b))
            finding = with_open(compare(channel, one, other, wanted, scale), channel, is_open)
            names = coordinates_of(case.case.variants.get(a.variant))
            finding = with_worst_entry(finding, channel, one.values, other.values, a.times, names)
            finding = _with_surrogates(finding, a, b)
        beyond = outside(item, channel, finding) if finding.status == item.expect else ""
        advice = finer_efforts(case.case, channel, wanted, finding, (a, b))
        yield question.verdict(channel, goal, finding, beyond, advice)
    if _missing(a, b) is None and _elsewhere(a, b) is None:
        patterns: dict[str, Iterable[str]] = {"scale": item.scales, "band": item.band}
        for pattern, finding in (*_unused(item.goals, patterns, a, b, case), *_vanished(question, item, a, b, case)):
            yield question.verdict(pattern, 0.0, finding, finding.reason)


def _with_surrogates(finding: Finding, *results: Result) -> Finding:
    """A difference names what an engine has another model of, as soft constraints: no effort takes that away."""
    models = [f"{result.engine}: {result.finest.support}" for result in results if result.finest.support]
    if finding.status != "differ" or not models:
        return finding
    return replace(finding, reason="; ".join((finding.reason, *models)))


def _unused(
    goals: Iterable[str], given: Mapping[str, Iterable[str]], a: Result, b: Result, case: CaseResults
) -> Iterator[tuple[str, Finding]]:
    """Scales and bands whose pattern names no judged channel: a misspelt pattern must not be ignored silently."""
    there = _union(_union(a.channels, b.channels), tuple(case.undetermined(a.variant, b.variant).by_channel))
    judged = [name for name in there if most_specific(goals, name) is not None]
    for what, patterns in given.items():
        for pattern in patterns if judged else ():
            if not any(matches(pattern, name) for name in judged):
                text = f'a {what} is given for "{pattern}", which is no channel judged here'
                yield pattern, Finding("unresolved", text)


def _vanished(
    question: Question, item: Comparison, a: Result, b: Result, case: CaseResults
) -> Iterator[tuple[str, Finding]]:
    """Channels with accepted figures that are not judged any more, since an engine ceased to offer them."""
    judged = {channel for channel, _, _ in _channels(item.goals, a, b, case)}
    for place in question.case.accepted.get(item.name, {}):
        channel = place.partition(" | ")[0]
        ours = place == key(channel, (a.engine, a.variant), (b.engine, b.variant))
        if ours and channel not in judged:
            why = "it has accepted figures and is not judged any more: take them out of accepted.toml if that is meant"
            yield channel, Finding("did not run", why)


def _control(case: CaseResults, item: Control) -> Iterator[Verdict]:
    """The faulty run has the U of the same engine's unmutated run: the same ladder on nearly the same scene."""
    why = f"negative control ({item.mutation} of {item.target or 'the scene'}): the fault must be noticed"
    question = Question(case.case, item.name, "control", item.a, item.b, "differ", why)
    faulty = case.get(item.a.variant, item.a.engine, f"control:{item.name}")
    twin, b = case.get(item.a.variant, item.a.engine), case.get(item.b.variant, item.b.engine)
    across, is_open = item.a.variant != item.b.variant, faulty.open | b.open
    for channel, goal, finding in _channels(item.goals, faulty, b, case):
        if finding is None:
            finding = _absent(twin, channel)
        if finding is None:
            signals = faulty.control_signal(channel, twin, across), b.signal(channel, across)
            signal, other = (determined(channel, each, is_open) for each in signals)
            finding = with_open(compare(channel, signal, other, goal, _scale(item.scales, channel)), channel, is_open)
            names = coordinates_of(case.case.variants.get(b.variant))
            finding = with_worst_entry(finding, channel, signal.values, other.values, b.times, names)
        yield question.verdict(channel, goal, finding)
    if _missing(faulty, b) is None and _elsewhere(faulty, b) is None:
        for pattern, finding in _unused(item.goals, {"scale": item.scales}, faulty, b, case):
            yield question.verdict(pattern, 0.0, finding)


def _conservation(case: CaseResults, item: Conservation, engine: str) -> Verdict:
    name = f"{item.quantity.replace('_', ' ')} conserved"
    side = ComparisonSide(variant=item.variant, engine=engine)
    law = ComparisonSide(variant=item.variant, engine=TRUE_MODEL)
    result = case.get(item.variant, engine)
    stands_on = basis(case.case.variants, (result,), item.scale)
    question = Question(case.case, name, "conservation", side, law, item.expect, item.reason, stands_on)
    channel = CONSERVED[item.quantity]
    finding = _absent(result, channel) or _drift(result, channel, item, question.goal(channel, item.limit))
    beyond = outside(item, channel, finding) if finding.status == item.expect else ""
    return question.verdict(channel, item.limit, finding, beyond)


def _drift(result: Result, channel: str, item: Conservation, limit: float) -> Finding:
    """Drift (SI): of the energy less the work done, or the change of the momentum vector."""
    drift, scale = drift_of(result, channel)
    return conserve(drift, item.scale if item.scale is not None else scale, limit)


def drift_of(result: Result, channel: str) -> tuple[np.ndarray, float]:
    """Drift (T,) (SI) of the energy less the work, or of a momentum, and the largest magnitude."""
    if channel == "energy.total":
        return _energy_drift(result)
    values = result.values(channel)
    return norms(values - values[:1]), float(np.max(norms(values), initial=0.0))


def _energy_drift(result: Result) -> tuple[np.ndarray, float]:
    """E(t) - E(0) - W(t) + W(0) (J), and the largest sum of magnitudes of the kinds of energy (J)."""
    drift = result.values("energy.total")[:, 0]
    if "work" in result.channels:
        drift = drift - result.values("work")[:, 0]
    kinds = [name for name in result.channels if name.startswith("energy.") and name != "energy.total"]
    sizes = sum((np.abs(result.values(name)[:, 0]) for name in kinds), np.zeros(len(drift)))
    return drift - drift[:1], float(np.max(sizes, initial=0.0))


def _channels(
    goals: dict[str, float], a: Result, b: Result, case: CaseResults
) -> Iterator[tuple[str, float, Finding | None]]:
    """Every channel to judge, with its goal, and with the finding if there is nothing to compare.

    If a result is missing, the pattern itself stands for its channels. A kind of energy that only one engine offers is
    left out; any other channel that only one offers is a refusal of the other. Channels of which the motion determines
    no component are not compared.
    """
    missing = _missing(a, b) or _elsewhere(a, b)
    undetermined = case.undetermined(a.variant, b.variant)
    for pattern, goal in goals.items():
        if missing is not None:
            yield pattern, goal, missing
            continue
        there = _union(_union(a.channels, b.channels), tuple(undetermined.by_channel))
        offered = [name for name in there if _belongs(name, pattern, goals)]
        if pattern not in offered:
            shared = set(a.channels) & set(b.channels)
            offered = [name for name in offered if name in shared or not name.startswith("energy.")]
        if not offered:
            yield pattern, goal, Finding("did not run", _without(pattern, goals, a, b))
        for name in offered:
            if undetermined.is_whole(name, _width(name, a, b)):
                yield name, goal, not_determined()
            else:
                yield name, goal, _absent(a, name) or _absent(b, name)


def _width(channel: str, *results: Result) -> int | None:
    """The number of components of a channel, None if no result has it."""
    return next((result.values(channel).shape[1] for result in results if channel in result.channels), None)


def _without(pattern: str, goals: Iterable[str], *results: Result) -> str:
    """Who has no channel of that name."""
    lacking = [
        result.engine for result in results if not any(_belongs(name, pattern, goals) for name in result.channels)
    ]
    if len(lacking) == 1:
        return f'{lacking[0]} has no channel "{pattern}"'
    if lacking:
        return f'neither {" nor ".join(lacking)} has a channel "{pattern}"'
    return f'{" and ".join(result.engine for result in results)} share no channel "{pattern}"'


def _belongs(channel: str, pattern: str, goals: Iterable[str]) -> bool:
    """Whether `pattern` is the most specific (longest) of the patterns that name the channel."""
    return most_specific(goals, channel) == pattern


def _missing(*results: Result) -> Finding | None:
    """The gravest ending of missing results, so that an expected refusal of one cannot hide a crash of the other."""
    endings = [result.ending for result in results if result.status != "finished"]
    if not endings:
        return None
    worst = min(endings, key=lambda ending: SEVERITY.index(ending.status))
    return Finding(
        worst.status, worst.reason, endings=tuple(ending for ending in endings if ending.status == worst.status)
    )


def _elsewhere(a: Result, b: Result) -> Finding | None:
    """The finding if two results have different times, or different scenes of one variant; else None."""
    if a.times.shape != b.times.shape or not np.allclose(a.times, b.times, rtol=CLOCK, atol=0.0):
        text = f"the results are at other times: {len(a.times)} samples to {a.times[-1]:g} s"
        return Finding("failed", f"{text}, and {len(b.times)} to {b.times[-1]:g} s")
    same = a.variant == b.variant and a.finest.role == b.finest.role
    if same and a.finest.scene != b.finest.scene:
        return Finding("failed", f"{a.engine} and {b.engine} ran different scenes as {a.variant}: run both again")
    return None


def _absent(result: Result, channel: str) -> Finding | None:
    """The finding if a result lacks the channel; None if it has it."""
    if result.status != "finished":
        return _missing(result)
    if channel not in result.channels:
        return Finding("refused", f"{result.engine} does not offer {channel}")
    return None


def _scale(scales: dict[str, float], channel: str) -> float | None:
    pattern = most_specific(scales, channel)
    return scales[pattern] if pattern is not None else None


def _union(first: Iterable[str], second: Iterable[str]) -> list[str]:
    return list(dict.fromkeys((*first, *second)))


def outside(item: Comparison | Conservation, channel: str, finding: Finding) -> str:
    """How a finding with the expected status is outside the bounds of `item`; "" if it is within them."""
    match item.expect:
        case "differ":
            return _beyond("E", finding.E, _band(item, channel))
        case "unresolved":
            return _beyond("U", finding.U, _band(item, channel))
        case "diverged":
            times = [ending.reached_s for ending in finding.endings if ending.status == "diverged"]
            reasons = [_beyond("the time reached (s)", time, item.diverged_s) for time in times or [None]]
            return next(filter(None, reasons), "")
        case "failed" | "refused":
            return _unlike(item.because, [ending.reason for ending in finding.endings] or [finding.reason])
    return ""


def _band(item: Comparison | Conservation, channel: str) -> Band | None:
    if isinstance(item, Conservation):
        return item.band
    pattern = most_specific(item.band, channel)
    return item.band[pattern] if pattern is not None else None


def _beyond(what: str, figure: float | None, band: Band | None) -> str:
    if band is None:
        return f"the case sets no bounds to {what}"
    low, high = band
    if figure is None:
        return f"there is no figure for {what}, expected is {low:.3g} to {high:.3g}"
    return "" if low <= figure <= high else f"{what} = {figure:.3g} is outside the expected {low:.3g} to {high:.3g}"


def _unlike(because: str, reasons: list[str]) -> str:
    if not because:
        return "the case sets no bounds to the reason"
    return "" if all(because in reason for reason in reasons) else f'the expected reason is "{because}"'
