"""Rules of comparisons, controls, conserved quantities and charts."""

from __future__ import annotations

from collections.abc import Iterator

from crosscheck.library.case import Chart, Comparison, Conservation, Control, OpenChannels, RunFile
from crosscheck.library.check.bounds import check_band, check_expectation
from crosscheck.library.check.ranges import SIZES, check_fraction, check_within, problem
from crosscheck.library.check.runs import (
    check_engines_once,
    check_same_times,
    check_sides_run,
    find_variant,
    no_variant,
)
from crosscheck.library.patterns import fault
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
