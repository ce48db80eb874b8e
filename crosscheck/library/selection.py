"""The run file of a case, reduced to the engines that were asked for.

In the reduced run file every comparison is an explicit pair, and `engines` of a variant include those of `also`.

Without engines: everything. With one: every comparison of it, including its partners. With several: the comparisons
among these. An engine that the case names in no variant (ours, a user's own, or a misspelt one) joins every
variant whose engines are compared with each other, and the variant of the stored reference; if it does not exist, it is
*did not run*. What it cannot represent there is *not applicable*, see `crosscheck.judging.applicable`. An engine that
the case names runs only its variants.

A comparison that lists engines does so since other ones of the case lack a channel, or come less near. Where it expects
agreement an engine that joins is compared with those listed, in the channels that no comparison of all engines has. So
is its conserved quantity, where the case lists engines and expects them to conserve it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import combinations, product

import msgspec

from crosscheck.library.case import Chart, Comparison, ComparisonSide, Conservation, Control, RunFile, Variant
from flexmb.run.channels import matches
from flexmb.scene.problems import closest


def select(run: RunFile, asked: tuple[str, ...]) -> RunFile:
    """The reduced run file; variants keep the engines that are needed, and are removed if none is."""
    foreign = joining(run, asked)
    run = _joined(run, asked)
    comparisons = [pair for comparison in run.comparisons for pair in _pairs(run, comparison, foreign)]
    kept = tuple(pair for pair in comparisons if _wanted(asked, pair.sides))
    controls = tuple(control for control in run.controls if _wanted(asked, control.sides))
    conserved = (_narrowed(run, item, asked, foreign) for item in run.conservations)
    conservations = tuple(item for item in conserved if item is not None)
    pairs: tuple[Comparison | Control, ...] = (*kept, *controls)
    needed = {(side.variant, side.engine) for pair in pairs for side in pair.sides}
    needed |= {(item.variant, engine) for item in conservations for engine in item.engines}
    needed |= {(v.name, engine) for v in run.variants for engine in _all(v) if engine in asked or not asked}
    variants = tuple(variant for candidate in run.variants if (variant := _keep(candidate, needed)).engines)
    return msgspec.structs.replace(
        run,
        variants=variants,
        comparisons=kept,
        controls=controls,
        conservations=conservations,
        charts=tuple(_charts(run.charts, variants)),
    )


def alone(run: RunFile, asked: tuple[str, ...]) -> RunFile:
    """The run file reduced to the variant of the stored reference, and there to the engines that were asked for.

    Without any these are all that are compared with it. There are no comparisons of engines with each other.
    """
    of = run.reference.variant if run.reference is not None else ""
    foreign = joining(run, asked)
    run = _joined(run, asked)
    running = [engine for variant in run.variants if variant.name == of for engine in _all(variant)]
    kept = tuple(engine for engine in running if engine in (asked or goals_for_reference(run, running)))
    needed = {(of, engine) for engine in kept}
    conserved = (_narrowed(run, item, kept, foreign) for item in run.conservations if item.variant == of and kept)
    return msgspec.structs.replace(
        run,
        variants=tuple(variant for candidate in run.variants if (variant := _keep(candidate, needed)).engines),
        comparisons=(),
        controls=(),
        conservations=tuple(item for item in conserved if item is not None),
        charts=(),
    )


def joining(run: RunFile, asked: Iterable[str]) -> tuple[str, ...]:
    """Those of the engines asked for that no variant of the run file names."""
    known = {engine for variant in run.variants for engine in _all(variant)}
    return tuple(engine for engine in asked if engine not in known)


def goals_for_reference(run: RunFile, engines: Iterable[str]) -> dict[str, tuple[dict[str, float], dict[str, float]]]:
    """Goals and scales, by engine, of those of `engines` that are compared with the stored reference.

    These are engines that a comparison of its variant expects to agree, or those that the table `[reference]` names; if
    the table gives goals, also engines without a comparison there; and engines that the case does not name.
    Goals are the table's, or those of the engine's comparisons, the first before later ones.
    """
    recipe = run.reference
    if recipe is None:
        return {}
    engines = tuple(engines)
    foreign = joining(run, engines)
    run = _joined(run, engines)
    pairs = [pair for comparison in run.comparisons for pair in _pairs(run, comparison, foreign)]
    pairs = [pair for pair in pairs if all(side.variant == recipe.variant for side in pair.sides)]
    named = {side.engine for pair in pairs for side in pair.sides}
    pairs = [pair for pair in pairs if pair.expect == "agree"]
    known = _all(run.variant(recipe.variant))
    goals_of = {}
    for engine in engines:
        own = [pair for pair in pairs if any(side.engine == engine for side in pair.sides)]
        free = bool(recipe.goals) and engine not in named
        chosen = engine in recipe.engines if recipe.engines else bool(own) or free
        if engine in known and (chosen or engine in foreign):
            goals: dict[str, float] = dict(recipe.goals)
            scales: dict[str, float] = {}
            for pair in own or pairs:
                goals |= {} if recipe.goals else {key: goal for key, goal in pair.goals.items() if key not in goals}
                scales |= {key: scale for key, scale in pair.scales.items() if key not in scales}
            if goals:
                goals_of[engine] = goals, scales
    return goals_of


def expected_otherwise(run: RunFile, variant: str, engine: str) -> Comparison | None:
    """The first comparison of an engine's run of a variant, where none expects agreement; None if one does, or there is
    none. Such a run has nothing to be held against: what is expected of it, and why, is what that comparison says.

    `run` is a reduced run file.
    """
    about = [
        comparison for comparison in run.comparisons
        if (variant, engine) in ((side.variant, side.engine) for side in comparison.sides)
    ]  # fmt: skip
    return about[0] if about and all(comparison.expect != "agree" for comparison in about) else None


def without_part(runs: Iterable[RunFile], asked: tuple[str, ...]) -> str:
    """A message about engines that were asked for and take part in none of the run files; "" if there are none."""
    runs = tuple(runs)
    busy = {engine for run in runs for variant in select(run, asked).variants for engine in variant.engines}
    idle = [engine for engine in asked if engine not in busy]
    known = {engine for run in runs for variant in run.variants for engine in _all(variant)}
    if not idle:
        return ""
    return f"no case that was asked for has a part for engine {', '.join(idle)}: {closest(idle[0], known)}"


def _joined(run: RunFile, asked: tuple[str, ...]) -> RunFile:
    """The run file with unknown engines added to the variants whose engines are compared with each other."""
    foreign = joining(run, asked)
    open_to_all = {
        comparison.variant
        for comparison in run.comparisons
        if comparison.variant and (not comparison.engines or _admits(comparison))
    }
    open_to_all |= {run.reference.variant} if run.reference is not None else set()
    variants = tuple(
        msgspec.structs.replace(variant, engines=variant.engines + foreign) if variant.name in open_to_all else variant
        for variant in run.variants
    )
    return msgspec.structs.replace(run, variants=variants)


def _admits(comparison: Comparison) -> bool:
    """Whether engines that join are compared with those that the comparison lists."""
    return bool(comparison.engines) and comparison.expect == "agree"


def _pairs(run: RunFile, comparison: Comparison, foreign: tuple[str, ...]) -> list[Comparison]:
    """The pairs of a comparison; `run` has the `foreign` engines in the variants that they join."""
    if comparison.variant is None:
        return [comparison]
    engines = comparison.engines or run.variant(comparison.variant).engines
    pairs = [_pair(comparison, *combination) for combination in combinations(engines, 2)]
    if foreign and _admits(comparison):
        left = _not_open(run, comparison)
        among = (*product(engines, foreign), *combinations(foreign, 2)) if left.goals else ()
        pairs += [_pair(left, *engine_pair) for engine_pair in among]
    return pairs


def _pair(comparison: Comparison, first: str, second: str) -> Comparison:
    """The comparison of one variant, of two engines."""
    assert comparison.variant is not None
    return msgspec.structs.replace(
        comparison,
        variant=None,
        engines=(),
        a=ComparisonSide(variant=comparison.variant, engine=first),
        b=ComparisonSide(variant=comparison.variant, engine=second),
    )


def _not_open(run: RunFile, comparison: Comparison) -> Comparison:
    """The comparison with those of its goals and scales that no comparison of all engines of the variant includes."""
    of_all = [
        candidate for candidate in run.comparisons
        if candidate.variant == comparison.variant and not candidate.engines and candidate.expect == "agree"
    ]  # fmt: skip
    included = [pattern for comparison in of_all for pattern in comparison.goals]
    goals = {
        pattern: goal
        for pattern, goal in comparison.goals.items()
        if not any(matches(one, pattern) for one in included)
    }
    scales = {
        pattern: scale
        for pattern, scale in comparison.scales.items()
        if any(matches(pattern, one) or matches(one, pattern) for one in goals)
    }
    return msgspec.structs.replace(comparison, goals=goals, scales=scales)


def _wanted(asked: tuple[str, ...], sides: tuple[ComparisonSide, ComparisonSide]) -> bool:
    """Whether two sides are compared if these engines are asked for."""
    involved = {side.engine for side in sides}
    if not asked:
        return True
    if len(asked) == 1:
        return asked[0] in involved
    return involved <= set(asked)


def _narrowed(
    run: RunFile, item: Conservation, asked: tuple[str, ...], foreign: tuple[str, ...]
) -> Conservation | None:
    """A conserved quantity of the engines asked for; `run` has the `foreign` ones in the variants that they join."""
    engines = run.variant(item.variant).engines
    if item.engines:
        engines = (*item.engines, *(engine for engine in foreign if engine in engines and item.expect == "agree"))
    kept = tuple(engine for engine in engines if not asked or engine in asked)
    return msgspec.structs.replace(item, engines=kept) if kept else None


def _keep(variant: Variant, needed: set[tuple[str, str]]) -> Variant:
    engines = tuple(engine for engine in _all(variant) if (variant.name, engine) in needed)
    efforts = tuple(ladder for ladder in variant.efforts if ladder.engine in engines)
    return msgspec.structs.replace(variant, engines=engines, also=(), efforts=efforts)


def _all(variant: Variant) -> tuple[str, ...]:
    return (*variant.engines, *variant.also)


def _charts(charts: tuple[Chart, ...], variants: tuple[Variant, ...]) -> Iterator[Chart]:
    """Charts whose reference still runs, with the variants and engines that do."""
    running = {variant.name: _all(variant) for variant in variants}
    for chart in charts:
        names = tuple(name for name in chart.variants if name in running)
        engines = tuple(engine for engine in chart.engines if any(engine in running[name] for name in names))
        if chart.reference in running and bool(engines) == bool(chart.engines):
            yield msgspec.structs.replace(chart, variants=names, engines=engines)
