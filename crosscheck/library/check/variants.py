"""Rules of variants: their engines, transformations, refinements and ladders of efforts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise

from crosscheck.library.case import ComparisonSide, Refined, RunFile, Variant
from crosscheck.library.check.ranges import (
    MOST_PIECES,
    check_count,
    check_duration,
    check_samples,
    check_within,
    problem,
)
from crosscheck.library.recipe import EffortLadder
from flexmb.scene.problems import Defect, Place, closest

# Rules of references to variants and engines: they must exist, and the engine must run the variant.


def check_sides_run(run: RunFile, name: str, engines: Iterable[str], place: Place) -> Iterator[Defect]:
    """The variant must exist and be run by the engines."""
    variant = find_variant(run, name)
    if variant is None:
        yield no_variant(name, [variant.name for variant in run.variants], place)
    else:
        yield from check_engines_run(variant, engines, place)


def check_engines_run(variant: Variant, engines: Iterable[str], place: Place) -> Iterator[Defect]:
    """The variant must be run by the engines."""
    for engine in engines:
        if engine not in (*variant.engines, *variant.also):
            text = f'engine "{engine}" does not run variant "{variant.name}"'
            yield problem(place, text, "add it to the variant's engines")


def check_engines_once(engines: Sequence[str], place: Place) -> Iterator[Defect]:
    """Each engine must be named once."""
    for engine in dict.fromkeys(engine for engine in engines if engines.count(engine) > 1):
        yield problem(place, f'engine "{engine}" is listed twice', "name it once")


def check_same_times(run: RunFile, a: ComparisonSide, b: ComparisonSide, place: Place) -> Iterator[Defect]:
    """Two sides that are compared must have the same sample times."""
    variants = [find_variant(run, side.variant) for side in (a, b)]
    if (
        len({(variant.duration_s or run.duration_s, variant.samples or run.samples) for variant in variants if variant})
        > 1
    ):
        text = f'"{a.variant}" and "{b.variant}" have other sample times'
        yield problem(place, text, "give both the same duration_s and samples")


def find_variant(run: RunFile, name: str) -> Variant | None:
    """The variant called `name`, or None."""
    return next((variant for variant in run.variants if variant.name == name), None)


def no_variant(name: str, names: Sequence[str], place: Place) -> Defect:
    """The problem that there is no variant called `name`."""
    return problem(place, f'no variant "{name}"; the variants are {", ".join(names)}', closest(name, names))


MOST_STEPS = 1e8  # of one run with fixed steps, which would take hours
MOST_EFFORTS = 20
TOLERANCES = (1e-15, 0.5)  # range of useful relative tolerances
ORDERS = (0.1, 16.0)


def check_variant(run: RunFile, variant: Variant, place: Place) -> Iterator[Defect]:
    if not variant.engines:
        yield problem(place.key("engines"), "name at least one engine", 'for example ["native"]')
    yield from check_engines_once(variant.engines, place.key("engines"))
    yield from check_engines_once(variant.also, place.key("also"))
    twice = sorted(set(variant.engines) & set(variant.also))
    if twice:
        yield problem(place.key("also"), f"{', '.join(twice)} is among the engines already", "name it once")
    if variant.duration_s is not None:
        yield from check_duration(variant.duration_s, place)
    if variant.samples is not None:
        yield from check_samples(variant.samples, place)
    if variant.asks and len(set(variant.asks)) < len(variant.asks):
        yield problem(place.key("linear"), "it asks for the same twice", 'linear = ["derivatives", "frequencies"]')
    for key, transform in (("segments", "segments"), ("pieces", "substructures")):
        count = getattr(variant, key)
        if (count is not None) != (variant.transform == transform):
            yield problem(place.key(key), f'give it exactly with "{transform}"', f'transform = "{transform}"')
        if count is not None:
            yield from check_count(count, place.key(key), 1)
    pieces = variant.transform == "substructures"
    if variant.eigenmodes and not pieces:
        yield problem(place.key("eigenmodes"), 'give it with "substructures" only', "take it out")
    yield from check_count(variant.eigenmodes, place.key("eigenmodes"), 0)
    if variant.split_body is not None and variant.transform not in ("segments", "substructures"):
        yield problem(place.key("split_body"), 'give it with "segments" or "substructures"', "take it out")
    if variant.refined is not None:
        yield from _refined(variant, variant.refined, place.key("refined"))
    duration = variant.duration_s if variant.duration_s is not None else run.duration_s
    for i, ladder in enumerate(variant.efforts):
        where = place.key("efforts", i)
        yield from check_engines_run(variant, (ladder.engine,), where.key("engine"))
        yield from check_ladder(ladder, duration, where)


def check_ladder(ladder: EffortLadder, duration: float, place: Place) -> Iterator[Defect]:
    """The problems of a ladder of efforts for a run of `duration` (s)."""
    where = place.key("values")
    if not 2 <= len(ladder.values) <= MOST_EFFORTS:
        text = f"an uncertainty needs at least two efforts, and {MOST_EFFORTS} are enough"
        yield problem(where, text, "list them from coarse to fine")
    if not all(coarse > fine for coarse, fine in pairwise(ladder.values)):
        yield problem(where, "they do not fall", "list them from coarse to fine (falling)")
    for i, value in enumerate(ladder.values):
        if ladder.kind == "tolerance":
            yield from check_within(value, TOLERANCES, where.key(i))
        elif not 0.0 < value <= duration <= MOST_STEPS * value:
            text = f"a step of {value:g} s makes no run of {duration:g} s"
            yield problem(where.key(i), text, f"give a step for at most {MOST_STEPS:g} of them")


def _refined(variant: Variant, refined: Refined, place: Place) -> Iterator[Defect]:
    counts = {key: getattr(refined, key) for key in ("segments", "pieces", "elements", "polynomials")}
    if all(count is None for count in counts.values()):
        yield problem(place, "it refines nothing", "give segments, pieces, elements or polynomials")
    for key, transform in (("segments", "segments"), ("pieces", "substructures")):
        fine, coarse = counts[key], getattr(variant, key)
        if fine is not None and coarse is None:
            yield problem(place.key(key), f'give it with "{transform}" only', "take it out")
        elif fine is not None and not coarse < fine <= MOST_PIECES:
            yield problem(place.key(key), f"{fine} is not finer than {coarse}", f"give more than {coarse}")
    for key in ("elements", "polynomials"):
        if counts[key] is not None:
            yield from check_count(counts[key], place.key(key), 1)
    yield from check_within(refined.order, ORDERS, place.key("order"))
