"""The rules of a run file and of accepted figures: every problem with its place and the remedy, all at once."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise

from crosscheck.judging.accepted import Accepted
from crosscheck.library.case import (
    Band,
    CaseError,
    Chart,
    Comparison,
    Conservation,
    Control,
    EffortLadder,
    Refined,
    RunFile,
    Side,
    Variant,
)
from crosscheck.library.patterns import fault
from flexmb.scene.problems import Place, Problem, closest

DURATIONS_S = (1e-9, 1e7)
TIME_LIMITS_S = (1e-3, 1e7)
MOST_SAMPLES = 100_000  # of a few hundred channels each: what memory and records can hold
MOST_STEPS = 1e8  # of one run with fixed steps: hours
MOST_EFFORTS = 20
MOST_PIECES = 10_000
TOLERANCES = (1e-15, 0.5)  # below, rounding decides; above, nothing is solved
SIZES = (1e-30, 1e30)  # of anything in SI: beyond lies a slip
ORDERS = (0.1, 16.0)
WIDEST = 100.0  # a band that lets a difference grow more is none
WIDEST_PART = 0.25  # of a run's duration, as a bound of the time at which it diverges
ROOT = Place()
BOUNDS = {"differ": "band", "unresolved": "band", "diverged": "diverged_s", "failed": "because", "refused": "because"}
FIGURE_OF = {"differ": "E", "unresolved": "U"}


def check_run_file(run: RunFile) -> None:
    """Refuse what cannot be run or judged; CaseError lists every problem with its place and the remedy."""
    _refuse(_run(run))


def check_accepted(accepted: Accepted, run: RunFile) -> None:
    """Refuse accepted figures that are none, or that belong to no comparison of the run file."""
    _refuse(_accepted(accepted, run))


def check_recorded(run: RunFile) -> None:
    """Refuse a run file as records hold it, every comparison a pair, that names a variant or engine it does not have.

    Its numbers are judged as they are: judging is total, and archives outlive the rules that have been added since.
    """
    _refuse(_recorded(run))


def _refuse(problems: Iterator[Problem]) -> None:
    found = [str(problem) for problem in problems]
    if found:
        raise CaseError("\n".join(found))


def _run(run: RunFile) -> Iterator[Problem]:
    if not run.title.strip():
        yield _problem(ROOT.key("title"), "it is empty", "say what the case is")
    if not run.variants:
        yield _problem(ROOT.key("variant"), "there is none", "add at least one variant with its engines")
    yield from _duration(run.duration_s, ROOT)
    yield from _samples(run.samples, ROOT)
    if run.time_limit_s is not None:
        yield from _within(run.time_limit_s, TIME_LIMITS_S, ROOT.key("time_limit_s"))
    yield from _unique([variant.name for variant in run.variants], ROOT.key("variant"), "variants")
    names = [item.name for item in run.comparisons]
    yield from _unique(names, ROOT.key("comparison"), "comparisons")
    yield from _unique([item.name for item in run.controls], ROOT.key("control"), "controls")
    for i, variant in enumerate(run.variants):
        yield from _variant(run, variant, _place("variant", i, variant.name))
    for i, comparison in enumerate(run.comparisons):
        yield from _comparison(run, comparison, _place("comparison", i, comparison.name))
    for i, control in enumerate(run.controls):
        yield from _control(run, control, _place("control", i, control.name))
    seen: set[tuple[str, str, str]] = set()
    for i, conservation in enumerate(run.conservations):
        yield from _conservation(run, conservation, ROOT.key("conservation", i), seen)
    for i, chart in enumerate(run.charts):
        yield from _chart(run, chart, ROOT.key("chart", i))


def _recorded(run: RunFile) -> Iterator[Problem]:
    yield from _unique([variant.name for variant in run.variants], ROOT.key("variant"), "variants")
    for kind, items in (("comparison", run.comparisons), ("control", run.controls)):
        for i, item in enumerate(items):
            for side in (item.a, item.b):
                if side is None:
                    yield _problem(ROOT.key(kind, i), "it does not name its two sides", "run the case again")
                else:
                    yield from _sides_run(run, side.variant, (side.engine,), ROOT.key(kind, i))
    for i, conservation in enumerate(run.conservations):
        yield from _sides_run(run, conservation.variant, conservation.engines, ROOT.key("conservation", i))
    for i, chart in enumerate(run.charts):
        yield from _chart(run, chart, ROOT.key("chart", i))


def _variant(run: RunFile, variant: Variant, place: Place) -> Iterator[Problem]:
    if not variant.engines:
        yield _problem(place.key("engines"), "name at least one engine", "for example [\"native\"]")
    yield from _engines_once(variant.engines, place.key("engines"))
    yield from _engines_once(variant.also, place.key("also"))
    twice = sorted(set(variant.engines) & set(variant.also))
    if twice:
        yield _problem(place.key("also"), f"{', '.join(twice)} is among the engines already", "name it once")
    if variant.duration_s is not None:
        yield from _duration(variant.duration_s, place)
    if variant.samples is not None:
        yield from _samples(variant.samples, place)
    for key, transform in (("segments", "segments"), ("pieces", "substructures")):
        count = getattr(variant, key)
        if (count is not None) != (variant.transform == transform):
            yield _problem(place.key(key), f'give it exactly with "{transform}"', f'transform = "{transform}"')
        if count is not None:
            yield from _count(count, place.key(key), 1)
    pieces = variant.transform == "substructures"
    if variant.eigenmodes and not pieces:
        yield _problem(place.key("eigenmodes"), 'give it with "substructures" only', "take it out")
    yield from _count(variant.eigenmodes, place.key("eigenmodes"), 0)
    if variant.split_body is not None and variant.transform not in ("segments", "substructures"):
        yield _problem(place.key("split_body"), 'give it with "segments" or "substructures"', "take it out")
    if variant.refined is not None:
        yield from _refined(variant, variant.refined, place.key("refined"))
    duration = variant.duration_s if variant.duration_s is not None else run.duration_s
    for i, ladder in enumerate(variant.efforts):
        yield from _ladder(variant, ladder, duration, place.key("efforts", i))


def _refined(variant: Variant, refined: Refined, place: Place) -> Iterator[Problem]:
    counts = {key: getattr(refined, key) for key in ("segments", "pieces", "elements")}
    if all(count is None for count in counts.values()):
        yield _problem(place, "it refines nothing", "give segments, pieces or elements")
    for key, transform in (("segments", "segments"), ("pieces", "substructures")):
        fine, coarse = counts[key], getattr(variant, key)
        if fine is not None and coarse is None:
            yield _problem(place.key(key), f'give it with "{transform}" only', "take it out")
        elif fine is not None and not coarse < fine <= MOST_PIECES:
            yield _problem(place.key(key), f"{fine} is not finer than {coarse}", f"give more than {coarse}")
    if counts["elements"] is not None:
        yield from _count(counts["elements"], place.key("elements"), 1)
    yield from _within(refined.order, ORDERS, place.key("order"))


def _ladder(variant: Variant, ladder: EffortLadder, duration: float, place: Place) -> Iterator[Problem]:
    yield from _engines_run(variant, (ladder.engine,), place.key("engine"))
    where = place.key("values")
    if not 2 <= len(ladder.values) <= MOST_EFFORTS:
        text = f"an uncertainty needs at least two efforts, and {MOST_EFFORTS} are enough"
        yield _problem(where, text, "list them from coarse to fine")
    if not all(coarse > fine for coarse, fine in pairwise(ladder.values)):
        yield _problem(where, "they do not fall", "list them from coarse to fine (falling)")
    for i, value in enumerate(ladder.values):
        if ladder.kind == "tolerance":
            yield from _within(value, TOLERANCES, where.key(i))
        elif not 0.0 < value <= duration <= MOST_STEPS * value:
            text = f"a step of {value:g} s makes no run of {duration:g} s"
            yield _problem(where.key(i), text, f"give a step for at most {MOST_STEPS:g} of them")


def _comparison(run: RunFile, item: Comparison, place: Place) -> Iterator[Problem]:
    yield from _patterns(item.goals, item.scales, place)
    yield from _expectation(run, item, place)
    for pattern, band in item.band.items():
        yield from _pattern(pattern, place.key("band"))
        yield from _band(band, place.key("band", pattern))
    if item.variant is not None:
        if item.a is not None or item.b is not None:
            yield _problem(place, "give either variant, or a and b", "take one of them out")
        variant = _find(run, item.variant)
        if len(item.engines or (variant.engines if variant is not None else ())) == 1:
            text = "one engine has nobody to be compared with"
            yield _problem(place.key("engines"), text, "name two, or none for all of the variant's if these are more")
        yield from _engines_once(item.engines, place.key("engines"))
        yield from _sides_run(run, item.variant, item.engines, place)
        return
    if item.engines:
        yield _problem(place.key("engines"), "engines belongs to variant; a and b name theirs", "take it out")
    if item.a is None or item.b is None:
        yield _problem(place, "give either variant, or a and b", "name both sides")
        return
    for key, side in (("a", item.a), ("b", item.b)):
        yield from _sides_run(run, side.variant, (side.engine,), place.key(key))
    yield from _same_times(run, item.a, item.b, place)
    if item.a == item.b:
        yield _problem(place.key("b"), "it is a: a result agrees with itself", "name another engine or variant")


def _control(run: RunFile, item: Control, place: Place) -> Iterator[Problem]:
    yield from _patterns(item.goals, item.scales, place)
    for key, side in (("a", item.a), ("b", item.b)):
        yield from _sides_run(run, side.variant, (side.engine,), place.key(key))
    yield from _same_times(run, item.a, item.b, place)


def _conservation(run: RunFile, item: Conservation, place: Place, seen: set[tuple[str, str, str]]) -> Iterator[Problem]:
    yield from _sides_run(run, item.variant, item.engines, place)
    yield from _engines_once(item.engines, place.key("engines"))
    yield from _fraction(item.limit, place.key("limit"))
    if item.scale is not None:
        yield from _within(item.scale, SIZES, place.key("scale"))
    yield from _expectation(run, item, place)
    if item.band is not None:
        yield from _band(item.band, place.key("band"))
    variant = _find(run, item.variant)
    for engine in item.engines or (variant.engines if variant is not None else ()):
        if (item.variant, item.quantity, engine) in seen:
            yield _problem(place, f"{item.quantity} of {engine} is judged above already", "take one of them out")
        seen.add((item.variant, item.quantity, engine))


def _chart(run: RunFile, chart: Chart, place: Place) -> Iterator[Problem]:
    yield from _pattern(chart.observable, place.key("observable"))
    names = [variant.name for variant in run.variants]
    for key, name in (*(("variants", each) for each in chart.variants), ("reference", chart.reference)):
        if name not in names:
            yield _no_variant(name, names, place.key(key))


def _expectation(run: RunFile, item: Comparison | Conservation, place: Place) -> Iterator[Problem]:
    """An expectation other than agreement has a reason, and the bounds that belong to it and no other."""
    if item.expect != "agree" and not item.reason.strip():
        yield _problem(place.key("reason"), "an expected status needs a reason", "say why it is so")
    needed = BOUNDS.get(item.expect)
    for key in dict.fromkeys(BOUNDS.values()):
        value = getattr(item, key)
        given = bool(value.strip() if isinstance(value, str) else value)
        if key == needed and not given:
            text = f"an expected {item.expect} needs its bounds"
            yield _problem(place.key(key), text, _remedy(item, key))
        if given and key != needed:
            yield _problem(place.key(key), f'it bounds nothing where "{item.expect}" is expected', "take it out")
    if needed == "band" and isinstance(item, Comparison) and item.band:
        yield from _covered(item, place.key("band"))
    if item.diverged_s is not None:
        low, high = item.diverged_s
        duration = _longest(run, item)
        if not 0.0 <= low < high < math.inf or high > duration:
            remedy = "give the earliest and the latest time, in seconds"
            yield _problem(place.key("diverged_s"), f"[{low:g}, {high:g}] is no time of {duration:g} s", remedy)
        elif high - low > WIDEST_PART * duration:
            text = f"[{low:g}, {high:g}] is more than {WIDEST_PART:g} of the run's {duration:g} s"
            yield _problem(place.key("diverged_s"), text, "narrow it to what was measured")


def _longest(run: RunFile, item: Comparison | Conservation) -> float:
    """Duration (s) of what is compared, the longer one of two."""
    sides = (item.a, item.b) if isinstance(item, Comparison) else ()
    names = {item.variant, *(side.variant for side in sides if side is not None)}
    found = [_find(run, name) for name in names if name is not None]
    return max((each.duration_s or run.duration_s for each in found if each is not None), default=run.duration_s)


def _remedy(item: Comparison | Conservation, key: str) -> str:
    form = "[low, high]" if isinstance(item, Conservation) else '{ "pattern of channels" = [low, high] }'
    return {
        "band": f"band = {form} of {FIGURE_OF.get(item.expect, '')}, from what was measured",
        "diverged_s": "diverged_s = [earliest, latest] of the last sample time reached, in seconds",
        "because": 'because = "..." with words that the engine gives as its reason',
    }[key]


def _covered(item: Comparison, place: Place) -> Iterator[Problem]:
    """Every goal's pattern has its band: the same pattern, or one that names it or a part of it."""
    for pattern in item.goals:
        if not any(_related(pattern, each) for each in item.band):
            yield _problem(place, f'no band for "{pattern}"', f'add "{pattern}" = [low, high]')


def _related(goal: str, band: str) -> bool:
    one, other = goal.partition(":")[0].partition(".")[0], band.partition(":")[0].partition(".")[0]
    return one == other


def _patterns(goals: dict[str, float], scales: dict[str, float], place: Place) -> Iterator[Problem]:
    if not goals:
        yield _problem(place.key("goals"), "name at least one channel and its goal", '{ "marker" = 1e-6 }')
    for pattern, goal in goals.items():
        yield from _pattern(pattern, place.key("goals"))
        yield from _fraction(goal, place.key("goals", pattern))
    for pattern, scale in scales.items():
        yield from _pattern(pattern, place.key("scales"))
        yield from _within(scale, SIZES, place.key("scales", pattern))


def _pattern(pattern: str, place: Place) -> Iterator[Problem]:
    why = fault(pattern)
    if why:
        remedy = "write a kind of channel, or kind:name, or kind:name.part"
        yield _problem(place, f'"{pattern}" can name no channel: {why}', remedy)


def _band(band: Band, place: Place) -> Iterator[Problem]:
    low, high = band
    if not 0.0 < low < high < math.inf:
        yield _problem(place, f"[{low:g}, {high:g}] is no band", "give two positive numbers, the lower first")
    elif high > WIDEST * low:
        text = f"[{low:g}, {high:g}] would let the figure grow by more than {WIDEST:g}"
        yield _problem(place, text, "narrow it, with finer patterns of channels if they differ that much")


def _fraction(number: float, place: Place) -> Iterator[Problem]:
    if not 0.0 < number <= 1.0:
        yield _problem(place, f"{number:g} is no part of the range", "give a number above 0, at most 1")


def _within(number: float, limits: Band, place: Place) -> Iterator[Problem]:
    low, high = limits
    if not low <= number <= high:
        yield _problem(place, f"{number:g} makes no sense", f"give a number from {low:g} to {high:g}")


def _count(number: int, place: Place, least: int) -> Iterator[Problem]:
    if not least <= number <= MOST_PIECES:
        yield _problem(place, f"{number} makes no sense", f"give a number from {least} to {MOST_PIECES}")


def _duration(duration: float, place: Place) -> Iterator[Problem]:
    shortest, longest = DURATIONS_S
    if not shortest <= duration <= longest:
        remedy = f"give {shortest:g} to {longest:g} seconds"
        yield _problem(place.key("duration_s"), f"a run needs a duration, and {duration:g} is none", remedy)


def _samples(samples: int, place: Place) -> Iterator[Problem]:
    if not 2 <= samples <= MOST_SAMPLES:
        remedy = f"give 2 to {MOST_SAMPLES}: every channel of every run is held at all of them"
        yield _problem(place.key("samples"), f"a run cannot have {samples} samples", remedy)


def _unique(names: Sequence[str], place: Place, what: str) -> Iterator[Problem]:
    for i, name in enumerate(names):
        if not name.strip():
            yield _problem(place.key(i, "name"), "it is empty", "give a name")
        elif name in names[:i]:
            yield _problem(place.key(i, "name"), f'two {what} have the same name, "{name}"', "rename one")


def _engines_once(engines: Sequence[str], place: Place) -> Iterator[Problem]:
    for engine in dict.fromkeys(engine for engine in engines if engines.count(engine) > 1):
        yield _problem(place, f'engine "{engine}" is listed twice', "name it once")


def _sides_run(run: RunFile, name: str, engines: Iterable[str], place: Place) -> Iterator[Problem]:
    variant = _find(run, name)
    if variant is None:
        yield _no_variant(name, [each.name for each in run.variants], place)
    else:
        yield from _engines_run(variant, engines, place)


def _same_times(run: RunFile, a: Side, b: Side, place: Place) -> Iterator[Problem]:
    variants = [_find(run, side.variant) for side in (a, b)]
    if len({(each.duration_s or run.duration_s, each.samples or run.samples) for each in variants if each}) > 1:
        text = f'"{a.variant}" and "{b.variant}" have other sample times'
        yield _problem(place, text, "give both the same duration_s and samples")


def _engines_run(variant: Variant, engines: Iterable[str], place: Place) -> Iterator[Problem]:
    for engine in engines:
        if engine not in (*variant.engines, *variant.also):
            text = f'engine "{engine}" does not run variant "{variant.name}"'
            yield _problem(place, text, "add it to the variant's engines")


def _find(run: RunFile, name: str) -> Variant | None:
    return next((variant for variant in run.variants if variant.name == name), None)


def _no_variant(name: str, names: Sequence[str], place: Place) -> Problem:
    return _problem(place, f'no variant "{name}"; the variants are {", ".join(names)}', closest(name, names))


def _accepted(accepted: Accepted, run: RunFile) -> Iterator[Problem]:
    names = [item.name for item in run.comparisons]
    names += [f"{item.quantity.replace('_', ' ')} conserved" for item in run.conservations]
    stale = "take it out; `crosscheck run --accept` writes what is there now"
    for name, table in accepted.items():
        place = ROOT.key(name)
        if name not in names:
            yield _problem(place, "the run file has no such comparison", stale)
        for where, figure in table.items():
            if where.count(" | ") != 2:
                yield _problem(place.key(where), "it is no channel with two sides", stale)
            if not (0.0 <= figure.E < math.inf and 0.0 <= figure.U < math.inf):
                yield _problem(place.key(where), f"E = {figure.E:g}, U = {figure.U:g} are no figures", stale)


def _place(collection: str, index: int, name: str) -> Place:
    return ROOT.key(collection, index).named(f'{collection} "{name}"')


def _problem(place: Place, what: str, remedy: str) -> Problem:
    return Problem(str(place), what, remedy)
