"""The subject of a campaign in a case: one variant run by one engine, and the goals of its channels."""

from __future__ import annotations

from dataclasses import dataclass, replace

import msgspec

from crosscheck.library.case import CaseError, Comparison, Variant
from crosscheck.library.find import Case
from crosscheck.library.reference import has_reference
from crosscheck.library.selection import goals_for_reference


@dataclass(frozen=True)
class JudgedVariant:
    """A case reduced to one variant and one engine.

    `goals` and `scales` are those of the engine's comparisons of the variant that must agree (of others if it has
    none), and those of its comparison with the stored reference, if that is of the variant; of two goals for one
    pattern the stricter counts.
    """

    case: Case
    variant: Variant
    engine: str
    goals: dict[str, float]
    scales: dict[str, float]


def subject(case: Case, engine: str) -> JudgedVariant:
    """The variant of the case's reference if a comparison judges it, else the first judged one that the engine runs.

    CaseError where there is none. An engine that the case does not name (a user's own) runs the first judged variant.
    """
    judged = [_variants(comparison) for comparison in _agreeing(case)]
    names = [name for group in judged for name in group]
    recipe = case.run.reference
    if recipe is not None and recipe.variant in names:
        names.insert(0, recipe.variant)
    named = {engine for variant in case.run.variants for engine in (*variant.engines, *variant.also)}
    for name in dict.fromkeys(names):
        variant = case.run.variant(name)
        goals, scales = _asked(case, name, engine)
        if goals and (engine not in named or engine in (*variant.engines, *variant.also)):
            alone = msgspec.structs.replace(variant, engines=(engine,), also=(), refined=None)
            efforts = tuple(ladder for ladder in variant.efforts if ladder.engine == engine)
            return JudgedVariant(case, msgspec.structs.replace(alone, efforts=efforts), engine, goals, scales)
    raise CaseError(f"{case.name}: no comparison judges a variant that engine {engine} runs: it cannot notice anything")


def reduced(what: JudgedVariant) -> Case:
    """The case with nothing but the subject's run: no comparison, no control, no chart."""
    return replace(what.case, run=what.case.run.alone(what.variant), accepted={})


def _agreeing(case: Case) -> list[Comparison]:
    """Comparisons that must agree, or all if there are none."""
    return [comparison for comparison in case.run.comparisons if comparison.expect == "agree"] or list(
        case.run.comparisons
    )


def _variants(comparison: Comparison) -> list[str]:
    if comparison.variant is not None:
        return [comparison.variant]
    return [side.variant for side in (comparison.a, comparison.b) if side is not None]


def _engines(case: Case, comparison: Comparison) -> tuple[str, ...]:
    if comparison.variant is not None:
        return comparison.engines or case.run.variant(comparison.variant).engines
    return tuple(side.engine for side in (comparison.a, comparison.b) if side is not None)


def _asked(case: Case, variant: str, engine: str) -> tuple[dict[str, float], dict[str, float]]:
    """Goals and scales of a variant's comparisons: of those with the engine that must agree, if there are any.

    Those of the engine's comparison with the stored reference are added.
    """
    goals: dict[str, float] = {}
    scales: dict[str, float] = {}
    about = [comparison for comparison in case.run.comparisons if variant in _variants(comparison)]
    agreeing = [comparison for comparison in about if comparison.expect == "agree"] or about
    for comparison in [candidate for candidate in agreeing if engine in _engines(case, candidate)] or agreeing:
        for pattern, goal in comparison.goals.items():
            goals[pattern] = min(goal, goals.get(pattern, goal))
        scales |= comparison.scales
    further, sizes = _held(case, variant, engine)
    goals |= {pattern: min(goal, goals.get(pattern, goal)) for pattern, goal in further.items()}
    return goals, sizes | scales


def _held(case: Case, variant: str, engine: str) -> tuple[dict[str, float], dict[str, float]]:
    """Goals and scales of the engine's comparison with the stored reference of a variant, empty if there is none."""
    recipe = case.run.reference
    if recipe is None or recipe.variant != variant or not has_reference(case.folder):
        return {}, {}
    return goals_for_reference(case.run, (engine,)).get(engine, ({}, {}))
