"""Rules of the table `[reference]` with its routes, and of published numbers."""

from __future__ import annotations

from collections.abc import Iterator
from math import isfinite

from crosscheck.library.case import Provenance, RunFile, Variant
from crosscheck.library.channels import fault
from crosscheck.library.check.judged import check_pattern, check_patterns
from crosscheck.library.check.ranges import MOST_SAMPLES, ROOT, check_within, problem
from crosscheck.library.check.variants import check_engines_once, check_ladder, find_variant, no_variant
from crosscheck.library.recipe import ReferenceRecipe, ReferenceRoute
from flexmb.scene.problems import Defect, Place

RELATIVE = (1e-16, 1e-2)  # range of the accuracy of a closed form


def check_reference(run: RunFile, recipe: ReferenceRecipe, place: Place) -> Iterator[Defect]:
    names = [variant.name for variant in run.variants]
    variant = find_variant(run, recipe.variant)
    if variant is None:
        yield no_variant(recipe.variant, names, place.key("variant"))
        return
    yield from _times(run, recipe, variant, place)
    for pattern in recipe.channels:
        yield from check_pattern(pattern, place.key("channels"))
    if recipe.goals:
        yield from check_patterns(recipe.goals, {}, place)
    yield from check_engines_once(recipe.engines, place.key("engines"))
    for engine in recipe.engines:
        if engine not in (*variant.engines, *variant.also):
            text = f'engine "{engine}" does not run variant "{variant.name}"'
            yield problem(place.key("engines"), text, "add it to the variant's engines, or take it out here")
    if recipe.manufactured:
        if recipe.routes:
            text = "a manufactured motion is exact, and has no routes"
            yield problem(place.key("route"), text, "take them out, or take out `manufactured`")
    elif len(recipe.routes) < 2:
        text = f"a reference comes by two independent routes at least, and this one has {len(recipe.routes)}"
        yield problem(place.key("route"), text, "add a [[reference.route]] with another engine, or a closed form")
    if sum(not route.witness for route in recipe.routes) < 2 <= len(recipe.routes):
        text = "fewer than two routes are no witnesses, and only these say how well the numbers are known"
        yield problem(place.key("route"), text, "take `witness` out of the others")
    elif recipe.routes and recipe.routes[0].witness:
        text = "the first route gives the numbers, so that it cannot be a witness"
        yield problem(place.key("route", 0), text, "put another route before it")
    for i, route in enumerate(recipe.routes):
        yield from _route(run, recipe, route, place.key("route", i))


def check_anchors(provenance: Provenance) -> Iterator[Defect]:
    for i, anchor in enumerate(provenance.anchors):
        place = ROOT.key("anchor", i)
        why = fault(anchor.channel)
        if why:
            yield problem(place.key("channel"), f'"{anchor.channel}" can be no channel: {why}', "name one channel")
        if not isfinite(anchor.value):
            yield problem(place.key("value"), f"{anchor.value:g} is no number to be met", "give it in SI")
        if not 0.0 < anchor.uncertainty < float("inf"):
            text = f"an uncertainty of {anchor.uncertainty:g} is none"
            yield problem(place.key("uncertainty"), text, "give the half of the last digit printed, at least")
        if not 0.0 <= anchor.t_s < float("inf"):
            yield problem(place.key("t_s"), f"{anchor.t_s:g} s is no time of a run", "give a time from 0")
        if not anchor.source.strip():
            yield problem(place.key("source"), "it is empty", "say where the number was published")


def _times(run: RunFile, recipe: ReferenceRecipe, variant: Variant, place: Place) -> Iterator[Defect]:
    """The reference's samples must be some of the variant's, so that no comparison needs interpolation."""
    samples = variant.samples or run.samples
    if not 2 <= samples <= MOST_SAMPLES:  # reported by `check_samples`
        return
    duration = variant.duration_s or run.duration_s
    if recipe.samples is not None and (recipe.samples < 2 or (samples - 1) % (recipe.samples - 1)):
        fitting = [n + 1 for n in range(samples - 1, 0, -1) if (samples - 1) % n == 0]
        text = f"{recipe.samples} samples are not some of the {samples} of the variant"
        yield problem(place.key("samples"), text, f"give one of {', '.join(map(str, fitting[:8]))}")
        return
    if recipe.horizon_s is not None:
        first = duration / ((recipe.samples or samples) - 1)
        yield from check_within(recipe.horizon_s, (first, duration), place.key("horizon_s"))


def _route(run: RunFile, recipe: ReferenceRecipe, route: ReferenceRoute, place: Place) -> Iterator[Defect]:
    if sum(map(bool, (route.engine, route.exact, route.equations))) != 1:
        text = "a route is an engine or a closed form, or equations of the case's own, and only one of them"
        yield problem(place, text, 'give engine = "...", exact = "..." or equations = "..."')
    name = route.variant or recipe.variant
    variant = find_variant(run, name)
    if variant is None:
        yield no_variant(name, [variant.name for variant in run.variants], place.key("variant"))
        return
    for key, file in (("exact", route.exact), ("equations", route.equations)):
        if file and (route.efforts or route.variant):
            yield problem(place, "a file of the case has no efforts and no variant", "take them out")
        if "/" in file or "\\" in file:
            yield problem(place.key(key), "a file of the case lies in the case's folder", "name just the file")
    for pattern in route.channels:
        yield from check_pattern(pattern, place.key("channels"))
    yield from check_within(route.relative_uncertainty, RELATIVE, place.key("relative_uncertainty"))
    for i, ladder in enumerate(route.efforts):
        where = place.key("efforts", i)
        if ladder.engine != route.engine:
            text = f'efforts of engine "{ladder.engine}" in a route of "{route.engine}"'
            yield problem(where.key("engine"), text, "name the same engine")
        yield from check_ladder(ladder, variant.duration_s or run.duration_s, where)
