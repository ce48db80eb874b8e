"""The stored reference of a case, for the record of the case."""

from __future__ import annotations

from crosscheck.library.case import CaseError, RunFile
from crosscheck.library.find import Case
from crosscheck.library.reference import current_reference, has_reference
from crosscheck.library.selection import goals_for_reference
from crosscheck.records.packing import pack
from crosscheck.records.recorded_reference import RecordedReference, ReferenceGoals


def recorded_reference(case: Case, run: RunFile) -> RecordedReference | None:
    """The case's stored reference with the engines of the reduced run file `run` that are compared with it.

    None if there is no reference or no such engine. If the stored files cannot be used or belong to another scene, the
    record contains the fault, so that these comparisons show as not run.
    """
    recipe = case.run.reference
    if recipe is None or not has_reference(case.folder):
        return None
    running = [engine for variant in run.variants if variant.name == recipe.variant for engine in variant.engines]
    found = goals_for_reference(case.run, running)
    asked = {engine: ReferenceGoals(goals=goals, scales=scales) for engine, (goals, scales) in found.items()}
    if not asked:
        return None
    try:
        stored = current_reference(case)
    except CaseError as error:
        return RecordedReference(variant=recipe.variant, asked=asked, fault=str(error))
    return RecordedReference(
        variant=recipe.variant,
        asked=asked,
        times=pack(stored.times),
        channels={name: pack(rows) for name, rows in stored.channels.items()},
        uncertainties={name: known.uncertainty for name, known in stored.knowledge.channels.items()},
        routes=stored.knowledge.routes,
    )
