"""Rules of references to variants and engines: they must exist, and the engine must run the variant."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from crosscheck.library.case import ComparisonSide, RunFile, Variant
from crosscheck.library.check.ranges import problem
from flexmb.scene.problems import Defect, Place, closest


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
