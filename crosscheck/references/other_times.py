"""The stored reference of a case at other times than those it holds: its engines run again, at these times too.

Samples of a motion do not say what happens between them, and an interpolation is as accurate as it happens to be: with
the usual samples it is off by 1e-7 to 1e-2 of the range, where goals are 1e-6. Therefore the values at other times are
computed as the stored ones were, in the same runs with which the stored times are reached again: where these do not
reproduce the stored numbers, the reference is not known at other times either.
"""

from __future__ import annotations

from collections.abc import Iterator

import msgspec
import numpy as np

from crosscheck.judging.against_reference import CLOCK
from crosscheck.judging.uncertainty import Uncertainty
from crosscheck.judging.verdict import Signal
from crosscheck.library.case import CaseError
from crosscheck.library.find import Case
from crosscheck.library.recipe import ReferenceRecipe
from crosscheck.library.reference import StoredReference
from crosscheck.references.routes import RouteSignals, run_routes
from crosscheck.running.scheduler import BY_DEFAULT, Scheduler
from flexmb.run.channels import distance
from flexmb.run.rounding import Sizes
from flexmb.typing import Real


def reference_at(
    case: Case, stored: StoredReference, times: Real, provider: str, scheduler: Scheduler
) -> dict[str, Signal]:
    """The channels of a case's stored reference at `times` (T,) s, rising, between its first and its last.

    A channel is taken from the first engine of the recipe that offers it and that finishes; closed forms, which are
    code of the case's folder, are left to `crosscheck regenerate`. Its U is the largest of what the reference states,
    of the engine's own, and of its distance from the stored numbers. It is infinite if the engine does not reproduce
    these within both uncertainties. Channels that no engine offers at these times are left out. CaseError if none runs.
    """
    recipe = case.run.reference
    assert recipe is not None
    asked = _joined(stored.times, times)
    kept, wanted = np.searchsorted(asked, stored.times), _nearest(asked, times)
    references: dict[str, tuple[Real, Uncertainty]] = {}
    for route in _routes(case, recipe, stored, asked, provider, scheduler):
        for name in (name for name in stored.channels if name in route.channels and name not in references):
            references[name] = _channel(name, route, stored, kept, wanted)
    here = {name: rows for name, (rows, _) in references.items()}
    sizes = [Sizes(tuple(signals), signals.__getitem__) for signals in (stored.channels, here)]
    return {
        name: Signal(
            *references[name], tuple(max(pair) for pair in zip(*(size.of(name) for size in sizes), strict=True))
        )
        for name in stored.channels
        if name in references
    }


def _joined(stored: Real, times: Real) -> Real:
    """All times, rising; of two that are the same within the clock's tolerance the stored one."""
    apart = np.abs(times - stored[_nearest(stored, times)])
    return np.union1d(stored, times[apart > CLOCK * stored[-1]])


def _nearest(times: Real, wanted: Real) -> np.ndarray:
    """The index of the nearest of `times` for each one wanted."""
    after = np.clip(np.searchsorted(times, wanted), 1, len(times) - 1)
    return np.where(wanted - times[after - 1] < times[after] - wanted, after - 1, after)


def _routes(
    case: Case, recipe: ReferenceRecipe, stored: StoredReference, times: Real, provider: str, scheduler: Scheduler
) -> Iterator[RouteSignals]:
    """The routes that are engines and finish, in the recipe's order, until every stored channel is offered."""
    lacking, found, faults = set(stored.channels), 0, []
    for route in recipe.routes:
        if not (route.engine and lacking):
            continue
        alone = msgspec.structs.replace(recipe, routes=(route,))
        try:
            (signals,) = run_routes(case, alone, times, provider, BY_DEFAULT, scheduler, lambda jobs, event: None)
        except CaseError as error:  # missing here, or stopped: another route may do
            faults.append(str(error))
            continue
        found += 1
        lacking -= set(signals.channels)
        yield signals
    if not found:
        raise CaseError(
            f"{case.name}: its reference is stored at {len(stored.times)} times, and cannot be had at others, as no "
            f"engine of it runs here ({'; '.join(faults) or 'it has none'}): write your results at the times of "
            "--template"
        )


def _channel(
    name: str, route: RouteSignals, stored: StoredReference, kept: np.ndarray, wanted: np.ndarray
) -> tuple[Real, Uncertainty]:
    """A channel at the wanted places, with its U."""
    rows, own = route.channels[name], float(route.uncertainties[name].envelope[-1])
    stated = stored.knowledge.channels[name].uncertainty
    apart = float(np.max(distance(name, rows[kept], stored.channels[name]), initial=0.0))
    doubt = max(stated, own, apart)
    how = f"the reference at times that it does not store, by {route.name}"
    if not apart <= stated + own:
        doubt = np.inf
        how = f"{how}, which is {apart:.2g} from what is stored, where {stated + own:.2g} is the most that may be"
    return rows[wanted], Uncertainty(np.full(len(wanted), doubt), doubt, how)
