"""`crosscheck regenerate`: the reference of a case, made again by its routes, and written if that is permitted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import msgspec
import numpy as np

from crosscheck.engines.registry import PROVIDER
from crosscheck.library.case import CaseError
from crosscheck.library.find import Case
from crosscheck.library.recipe import ReferenceRecipe
from crosscheck.library.reference import (
    VALUES,
    Knowledge,
    StoredReference,
    digest,
    has_reference,
    load_reference,
    scene_digest,
    values_text,
)
from crosscheck.library.work import changes
from crosscheck.references.agreement import Agreed, agree, meet
from crosscheck.references.files import beyond_uncertainty, knowledge_text, largest_share, write_both
from crosscheck.references.routes import RouteSignals, run_routes
from crosscheck.running.plan import sample_times
from crosscheck.running.pool import run_jobs
from crosscheck.running.scheduler import BY_DEFAULT, Limits, Scheduler
from crosscheck.running.sweep import Listener
from flexmb.scene.reading import read_text
from flexmb.typing import Real

PROVENANCE = "provenance.toml"
Done = Literal["confirmed", "written", "would be written"]


@dataclass(frozen=True)
class Regenerated:
    """The outcome for a case's reference, the number of its channels, its horizon (s), and a remark.

    "confirmed": the stored files agree within their stated uncertainties and are left as they are.
    """

    case: str
    done: Done
    channels: int
    horizon_s: float
    remark: str = ""


def regenerate(
    case: Case,
    *,
    check: bool = False,
    provider: str = PROVIDER,
    limits: Limits = BY_DEFAULT,
    scheduler: Scheduler = run_jobs,
    listener: Listener = lambda jobs, event: None,
) -> Regenerated:
    """Make the reference of a case by its recipe, and write it; with `check` nothing is written.

    CaseError says why there is none: no recipe, a manufactured motion, a route without result, channels by fewer than
    two independent routes or by routes that do not agree, a published number that is not met, or a change beyond the
    stated uncertainty while provenance.toml is as it was.
    """
    recipe = case.run.reference
    if recipe is None:
        raise CaseError(f"{case.folder / 'run.toml'}: it has no table [reference]: add one with two routes at least")
    if recipe.manufactured:
        what = "its reference is a manufactured motion, exact, and has no routes"
        raise CaseError(f"{case.name}: {what}: `{recipe.manufactured}` writes it, into an empty folder")
    try:
        before = load_reference(case.folder) if has_reference(case.folder) else None
        routes = run_routes(case, recipe, _times(case, recipe), provider, limits, scheduler, listener)
        agreed = agree(routes, recipe.channels)
        meet(agreed, case.provenance.anchors if case.provenance is not None else ())
    except CaseError as error:
        raise CaseError(f"{case.name}: {error}") from None
    values = values_text(agreed.times, agreed.channels)
    knowledge = _knowledge(case, recipe, routes, agreed, values)
    remark = "" if before is None else _permitted(case, before, agreed, knowledge)
    if before is not None and not remark and _describes_the_same(before, agreed, knowledge):
        stated = _changed(before.knowledge, knowledge)
        if stated:  # keeps the values, states what is new
            values = values_text(before.times, before.channels)
            new = {"provenance": knowledge.provenance, "work": knowledge.work, "made_with": knowledge.made_with}
            knowledge = msgspec.structs.replace(before.knowledge, **new)
            return _put(case, values, knowledge, check, f"reproduced; {'; '.join(stated)}")
        share = f"reproduced, farthest off by {largest_share(before, agreed):.2g} of the stated uncertainty"
        return Regenerated(case.name, "confirmed", len(agreed.channels), knowledge.horizon_s, share)
    return _put(case, values, knowledge, check, remark)


def _put(case: Case, values: str, knowledge: Knowledge, check: bool, remark: str) -> Regenerated:
    """Write the two files, unless this is a check."""
    if not check:
        write_both(case.folder, values, knowledge_text(knowledge))
    done: Done = "would be written" if check else "written"
    return Regenerated(case.name, done, len(knowledge.channels), knowledge.horizon_s, remark)


def _times(case: Case, recipe: ReferenceRecipe) -> Real:
    """The times (s) of the reference: every so many of the variant's, up to the horizon."""
    times = sample_times(case.run, case.run.variant(recipe.variant))
    kept = times[:: (len(times) - 1) // ((recipe.samples or len(times)) - 1)]
    return kept if recipe.horizon_s is None else kept[kept <= recipe.horizon_s * (1.0 + 1e-9)]


def _knowledge(
    case: Case, recipe: ReferenceRecipe, routes: list[RouteSignals], agreed: Agreed, values: str
) -> Knowledge:
    return Knowledge(
        variant=recipe.variant,
        horizon_s=float(agreed.times[-1]),
        values=digest(values),
        provenance=_provenance(case),
        scene=scene_digest(case, case.run.variant(recipe.variant)),
        routes=tuple(route.title for route in routes),
        made_with=tuple(dict.fromkeys(route.made_with for route in routes if route.made_with)),
        work={run: counts for route in routes for run, counts in route.work.items()},
        channels=agreed.known,
    )


def _changed(before: Knowledge, now: Knowledge) -> list[str]:
    """What a reproduced reference states otherwise than before, in words: its provenance, and the work of its runs."""
    found = [f"{PROVENANCE} was changed since"] if before.provenance != now.provenance else []
    if now.work.keys() - before.work.keys():
        return [*found, "the work of its runs was not counted"]
    if gone := before.work.keys() - now.work.keys():
        return [*found, f"the work of {len(gone)} runs is not counted any more"]
    for run, then in before.work.items():
        for count, old, new in changes(then, now.work.get(run, then)):
            found.append(f"{run} took {old} {count}, now {new}")
    return found


def _provenance(case: Case) -> str:
    file = case.folder / PROVENANCE
    return digest(read_text(file) if file.exists() else "")


def _permitted(case: Case, before: StoredReference, agreed: Agreed, knowledge: Knowledge) -> str:
    """Changes beyond the stated uncertainty, for which the provenance was changed; CaseError if it was not."""
    changes = beyond_uncertainty(before, agreed)
    if changes and before.knowledge.provenance == knowledge.provenance:
        listed = "\n".join(f"  {change}" for change in changes)
        raise CaseError(
            f"{case.name}: {VALUES} is not replaced, as more would change than was stated:\n{listed}\n"
            "  A reference is not moved to make a run green. If the case is meant to be another, say so in "
            f"{case.folder / PROVENANCE}: with that changed too, the reference is replaced."
        )
    return f"{len(changes)} changes beyond what was stated, with {PROVENANCE}: {changes[0]}" if changes else ""


def _describes_the_same(before: StoredReference, agreed: Agreed, knowledge: Knowledge) -> bool:
    """Whether variant, scene, routes, times and channels are the same as before."""
    return (
        all(getattr(before.knowledge, key) == getattr(knowledge, key) for key in ("variant", "scene", "routes"))
        and before.times.shape == agreed.times.shape
        and bool(np.allclose(before.times, agreed.times, rtol=1e-9))
        and list(before.channels) == list(agreed.channels)
    )
