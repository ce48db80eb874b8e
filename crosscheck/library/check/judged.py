"""Rules of comparisons, controls, conserved quantities and charts."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Set

from crosscheck.library.accepted import Accepted
from crosscheck.library.case import Chart, Comparison, Conservation, Control, OpenChannels, RunFile
from crosscheck.library.channels import fault, part_of
from crosscheck.library.check.bounds import check_band, check_expectation
from crosscheck.library.check.ranges import ROOT, SIZES, check_fraction, check_within, problem
from crosscheck.library.check.variants import (
    check_engines_once,
    check_same_times,
    check_sides_run,
    find_variant,
    no_variant,
)
from crosscheck.library.expect_file import ExpectFile
from flexmb.scene.problems import Defect, Place, closest


def check_comparison(run: RunFile, item: Comparison, place: Place) -> Iterator[Defect]:
    yield from check_patterns(item.goals, item.scales, place)
    yield from check_expectation(run, item, place)
    for pattern, band in item.band.items():
        yield from check_pattern(pattern, place.key("band"))
        yield from check_band(band, place.key("band", pattern))
    if item.variant is not None:
        if item.a is not None or item.b is not None:
            yield problem(place, "give either variant, or a and b", "take one of them out")
        variant = find_variant(run, item.variant)
        if len(item.engines or (variant.engines if variant is not None else ())) == 1:
            text = "one engine has nobody to be compared with"
            yield problem(place.key("engines"), text, "name two, or none for all of the variant's if these are more")
        yield from check_engines_once(item.engines, place.key("engines"))
        yield from check_sides_run(run, item.variant, item.engines, place)
        return
    if item.engines:
        yield problem(place.key("engines"), "engines belongs to variant; a and b name theirs", "take it out")
    if item.a is None or item.b is None:
        yield problem(place, "give either variant, or a and b", "name both sides")
        return
    for key, side in (("a", item.a), ("b", item.b)):
        yield from check_sides_run(run, side.variant, (side.engine,), place.key(key))
    yield from check_same_times(run, item.a, item.b, place)
    if item.a == item.b:
        yield problem(place.key("b"), "it is a: a result agrees with itself", "name another engine or variant")


def check_control(run: RunFile, item: Control, place: Place) -> Iterator[Defect]:
    yield from check_patterns(item.goals, item.scales, place)
    for key, side in (("a", item.a), ("b", item.b)):
        yield from check_sides_run(run, side.variant, (side.engine,), place.key(key))
    yield from check_same_times(run, item.a, item.b, place)


def check_conservation(
    run: RunFile, item: Conservation, place: Place, seen: set[tuple[str, str, str]]
) -> Iterator[Defect]:
    """The problems of a conserved quantity; `seen` are those checked before it: (variant, quantity, engine)."""
    yield from check_sides_run(run, item.variant, item.engines, place)
    yield from check_engines_once(item.engines, place.key("engines"))
    yield from check_fraction(item.limit, place.key("limit"))
    if item.scale is not None:
        yield from check_within(item.scale, SIZES, place.key("scale"))
    yield from check_expectation(run, item, place)
    if item.band is not None:
        yield from check_band(item.band, place.key("band"))
    variant = find_variant(run, item.variant)
    for engine in item.engines or (variant.engines if variant is not None else ()):
        if (item.variant, item.quantity, engine) in seen:
            yield problem(place, f"{item.quantity} of {engine} is judged above already", "take one of them out")
        seen.add((item.variant, item.quantity, engine))


def check_open(run: RunFile, item: OpenChannels, place: Place) -> Iterator[Defect]:
    if not item.channels:
        yield problem(place.key("channels"), "name at least one channel", '["momentum"]')
    for pattern in item.channels:
        yield from check_pattern(pattern, place.key("channels"))
    if not item.reason.strip():
        yield problem(place.key("reason"), "nothing says why these channels are judged by nothing", "give the reason")
    names = [variant.name for variant in run.variants]
    for name in item.variants:
        if name not in names:
            yield no_variant(name, names, place.key("variants"))
    yield from check_engines_once(item.engines, place.key("engines"))
    there = [variant for variant in run.variants if variant.name in (item.variants or names)]
    known = {engine for variant in there for engine in (*variant.engines, *variant.also)}
    for engine in item.engines:
        if engine not in known:
            yield problem(place.key("engines"), f'engine "{engine}" runs none of the variants', closest(engine, known))


def check_chart(run: RunFile, chart: Chart, place: Place) -> Iterator[Defect]:
    yield from check_pattern(chart.observable, place.key("observable"))
    names = [variant.name for variant in run.variants]
    for key, name in (*(("variants", variant) for variant in chart.variants), ("reference", chart.reference)):
        if name not in names:
            yield no_variant(name, names, place.key(key))
    running = {
        engine for each in run.variants if each.name in chart.variants for engine in (*each.engines, *each.also)
    }
    for engine in chart.engines:
        if engine not in running:
            yield problem(
                place.key("engines"), f'"{engine}" runs none of the chart\'s variants', " or ".join(sorted(running))
            )


def check_patterns(goals: dict[str, float], scales: dict[str, float], place: Place) -> Iterator[Defect]:
    if not goals:
        yield problem(place.key("goals"), "name at least one channel and its goal", '{ "marker" = 1e-6 }')
    for pattern, goal in goals.items():
        yield from check_pattern(pattern, place.key("goals"))
        yield from check_fraction(goal, place.key("goals", pattern))
    for pattern, scale in scales.items():
        yield from check_pattern(pattern, place.key("scales"))
        yield from check_within(scale, SIZES, place.key("scales", pattern))


def check_pattern(pattern: str, place: Place) -> Iterator[Defect]:
    """A pattern must be able to match a channel."""
    why = fault(pattern)
    if why:
        remedy = "write a kind of channel, or kind:name, or kind:name.part"
        yield problem(place, f'"{pattern}" can name no channel: {why}', remedy)


# Rules of `crosscheck-expect.toml`: engines that exist, patterns that can name a channel, numbers, reasons.

EFFORTS = (1e-15, 1e3)  # steps in s, or relative tolerances
MOST_EFFORTS = 10


def check_expect_file(content: ExpectFile, engines: Iterable[str]) -> Iterator[Defect]:
    """All problems; `engines` are those that there are."""
    engines = tuple(engines)
    for number, goal in enumerate(content.goals):
        place = ROOT.key("goal", number)
        yield from _common(goal.engine, goal.cases, engines, place)
        yield from _reason(goal.reason, place)
        if not goal.goals:
            yield problem(place.key("goals"), "it names no channel", '{ "*" = 1e-3 }')
        for pattern, value in goal.goals.items():
            yield from check_pattern(pattern, place.key("goals"))
            yield from check_fraction(value, place.key("goals", pattern))
    for number, failure in enumerate(content.failures):
        place = ROOT.key("expected_failure", number)
        yield from _common(failure.engine, failure.cases, engines, place)
        yield from _reason(failure.reason, place)
        if not failure.channels:
            yield problem(place.key("channels"), "it names no channel", "leave it out to mean all channels")
        for pattern in failure.channels:
            yield from check_pattern(pattern, place.key("channels"))
    for number, efforts in enumerate(content.efforts):
        place = ROOT.key("efforts", number)
        yield from _common(efforts.engine, efforts.cases, engines, place)
        if not 1 <= len(efforts.values) <= MOST_EFFORTS:
            yield problem(place.key("values"), f"{len(efforts.values)} efforts", f"give 1 to {MOST_EFFORTS}")
        for value in efforts.values:
            yield from check_within(value, EFFORTS, place.key("values"))


def _common(engine: str, cases: tuple[str, ...], engines: tuple[str, ...], place: Place) -> Iterator[Defect]:
    if engine not in engines:
        yield problem(place.key("engine"), f'there is no engine "{engine}"', closest(engine, engines))
    if not cases:
        yield problem(place.key("cases"), "it means no case", 'leave it out to mean all, or write ["pendulums/*"]')


def _reason(reason: str, place: Place) -> Iterator[Defect]:
    if not reason.strip():
        yield problem(place.key("reason"), "it is empty", "say why, for those who review the file")


# Rules of accepted figures: each is a valid number and belongs to something that the run file judges.

SIDE = re.compile(r"[^()]+ \((.+)\)")


def check_figures(accepted: Accepted, run: RunFile) -> Iterator[Defect]:
    names = [item.name for item in run.comparisons]
    names += [f"{item.quantity.replace('_', ' ')} conserved" for item in run.conservations]
    variants = {variant.name for variant in run.variants}
    stale = "take it out; `crosscheck run --accept` writes what is there now"
    for name, table in accepted.items():
        place = ROOT.key(name)
        if name not in names:
            yield problem(place, "the run file has no such comparison", stale)
        for where, figure in table.items():
            if what := _of_no_verdict(where, variants):
                yield problem(place.key(where), what, stale)
            if not (0.0 <= figure.E < math.inf and 0.0 <= figure.U < math.inf):
                yield problem(place.key(where), f"E = {figure.E:g}, U = {figure.U:g} are no figures", stale)


def _of_no_verdict(where: str, variants: Set[str]) -> str:
    """Why no verdict of the run file can have this key of an accepted figure; "" if one can."""
    channel, *sides = where.split(" | ")
    if len(sides) != 2:
        return "it is no channel with two sides"
    if part_of(channel) is None:
        return f'there is no kind of channel such as "{channel}"'
    for side in sides:
        match = SIDE.fullmatch(side)
        if match is None:
            return f'"{side}" is not an engine with a variant in brackets'
        if match[1] not in variants:
            return f'the run file has no variant "{match[1]}"'
    return ""
