"""The routes to a reference: engines that run the variant at their efforts, and files of the case's folder.

Engines run as usual, by `sweep` and its workers. A file has a closed form, or equations of its own; it is Python code,
which is executed only here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec
import numpy as np

from crosscheck.judging.results import Result, collect
from crosscheck.judging.uncertainty import Uncertainty
from crosscheck.library import basis
from crosscheck.library.case import CaseError, Comparison, ComparisonSide, Variant
from crosscheck.library.code import function_of
from crosscheck.library.find import Case
from crosscheck.library.recipe import ReferenceRecipe, ReferenceRoute
from crosscheck.library.work import Counts, StoredWork, key
from crosscheck.records.archive import read
from crosscheck.records.kinds import RunRecord
from crosscheck.running.job import MAIN
from crosscheck.running.plan import jobs_at, plan
from crosscheck.running.scheduler import Limits, Scheduler
from crosscheck.running.sweep import Listener, run_planned
from flexmb.run.channels import family, magnitude, matches
from flexmb.run.rounding import roundoff_floor
from flexmb.typing import Real


@dataclass(frozen=True)
class RouteSignals:
    """The result of a route at the reference's times: channels (T, k) with their U, in SI and World axes.

    `title` describes the route, `work` counts what each of its efforts took, by the keys of reference.toml. `engine`
    and its integrator `method` are "" for a file of the case. `made_with` is the engine's version. A `witness` has to
    agree, and does not say how well the numbers are known.
    """

    name: str
    title: str
    engine: str
    method: str
    made_with: str
    times: Real
    channels: Mapping[str, Real]
    uncertainties: Mapping[str, Uncertainty]
    witness: bool = False
    work: StoredWork = field(default_factory=dict)

    def independent_of(self, other: RouteSignals) -> bool:
        """Whether the two are of different codes, or of one code by two engines with two integrators.

        Engines of one code have names that begin alike, such as `native` and `native-frisch`.
        """
        if self.engine.partition("-")[0] == other.engine.partition("-")[0]:
            return self.engine != other.engine and self.method != other.method
        return True


def run_routes(
    case: Case,
    recipe: ReferenceRecipe,
    times: Real,
    provider: str,
    limits: Limits,
    scheduler: Scheduler,
    listener: Listener,
) -> list[RouteSignals]:
    """The signals of every route of the recipe at `times` (T,); CaseError if a route gives none.

    Files are evaluated first, since they may have errors.
    """
    answers = {
        place: _of_file(case.folder / (route.exact or route.equations), route, times)
        for place, route in enumerate(recipe.routes)
        if not route.engine
    }
    results = _engine_results(case, recipe, times, provider, limits, scheduler, listener)
    for place, route in enumerate(recipe.routes):
        if route.engine:
            answers[place] = _of_engine(case, route, route.variant or recipe.variant, results[_name(place)])
    return [answers[place] for place in sorted(answers)]


def _name(place: int) -> str:
    return f"route {place + 1}"


def _engine_results(
    case: Case,
    recipe: ReferenceRecipe,
    times: Real,
    provider: str,
    limits: Limits,
    scheduler: Scheduler,
    listener: Listener,
) -> dict[str, Result]:
    """The results of all routes that are engines, by name, each run as a variant of its own."""
    variants = tuple(
        _as_variant(case.run.variant(route.variant or recipe.variant), recipe.variant, _name(place), route, times)
        for place, route in enumerate(recipe.routes)
        if route.engine
    )
    if not variants:
        return {}
    with TemporaryDirectory() as folder:
        records = Path(folder) / "records.jsonl"
        run = msgspec.structs.replace(case.run.alone(*variants), comparisons=_refining(variants))
        record, jobs = plan(replace(case, run=run), (), provider, limits.time_s)
        planned = record, jobs_at(jobs, times)
        run_planned([planned], (), records, limits=limits, scheduler=scheduler, listener=listener)
        (results,) = collect(read(records)).cases
    return {variant.name: results.get(variant.name, variant.engines[0], MAIN) for variant in variants}


def _refining(variants: Sequence[Variant]) -> tuple[Comparison, ...]:
    """Comparisons across variants, for which alone refined runs are planned: of the first with those refined."""
    first, *others = (ComparisonSide(variant=variant.name, engine=variant.engines[0]) for variant in variants)
    refined = {variant.name for variant in variants if variant.refined is not None}
    return tuple(
        Comparison(name=other.variant, a=first, b=other, goals={}) for other in others if other.variant in refined
    )


def _as_variant(variant: Variant, given: str, name: str, route: ReferenceRoute, times: Real) -> Variant:
    """A route as a variant of its own. A witness by another discretisation than the `given` one knows no more than that
    says of its own error."""
    efforts = tuple(effort for effort in route.efforts or variant.efforts if effort.engine == route.engine)
    return msgspec.structs.replace(
        variant,
        name=name,
        engines=(route.engine,),
        also=(),
        efforts=efforts,
        refined=variant.refined if route.witness and variant.name != given else None,
        duration_s=float(times[-1]),
        samples=len(times),
    )


def _of_engine(case: Case, route: ReferenceRoute, variant: str, result: Result) -> RouteSignals:
    if result.status != "finished":
        what = f"{result.variant}, {result.engine}, {result.status}: {result.message}"
        raise CaseError(f"{case.folder / 'run.toml'}: [reference] {what}: correct the route, or take another")
    efforts = [run.effort for run in result.runs if run.effort_method == result.finest.effort_method]
    given = [name for name in result.determined_channels if _given(route, name)]
    return RouteSignals(
        name=result.engine,
        title=basis.title(result.engine, ", ".join(efforts), route.witness),
        engine=result.engine,
        method=result.finest.effort_method,
        made_with=_version(result.finest),
        times=result.times,
        channels={name: result.values(name) for name in given},
        uncertainties={name: result.doubt(name, across=True) for name in given},
        witness=route.witness,
        work={
            key(result.engine, variant, run.effort): Counts(run.evaluations, run.steps, run.operations)
            for run in result.runs
            if (run.evaluations or run.steps or run.operations) and not result.rests  # there rounding decides on steps
        },
    )


def _given(route: ReferenceRoute, channel: str) -> bool:
    return not route.channels or any(matches(pattern, channel) for pattern in route.channels)


def _version(run: RunRecord) -> str:
    return f"{run.engine} {run.version}".strip()


def _of_file(file: Path, route: ReferenceRoute, times: Real) -> RouteSignals:
    """Channels of a closed form, or of equations of the case's own, with U relative to the largest size in each
    channel's family."""
    exact = _function(file)
    try:
        given = exact(times.copy())
        kept = {name: values for name, values in given.items() if _given(route, name)}
        channels = {name: np.array(values, float).reshape(len(times), -1) for name, values in kept.items()}
    except Exception as error:  # the file is anybody's
        raise CaseError(f"{file}: exact(times) failed: {type(error).__name__}: {error}") from None
    for name, values in channels.items():
        if not np.all(np.isfinite(values)):
            raise CaseError(f"{file}: exact(times) gives {name} values that are not finite")
    sizes: dict[str, float] = {}
    for name, values in channels.items():
        sizes[family(name)] = max(sizes.get(family(name), 0.0), magnitude(name, values))
    what = basis.CLOSED_FORM if route.exact else basis.OWN_EQUATIONS
    how = f"{what}, evaluated to {route.relative_uncertainty:g} of its size"
    doubts = {name: route.relative_uncertainty * sizes[family(name)] for name in channels}
    floors = {name: roundoff_floor(sizes[family(name)], 1) for name in channels}
    return RouteSignals(
        name=file.name,
        title=basis.title(file.name, what, route.witness),
        engine="",
        method="",
        made_with="",
        times=times,
        channels=channels,
        uncertainties={
            name: Uncertainty(np.full(len(times), doubts[name] + floors[name]), doubts[name] + floors[name], how)
            for name in channels
        },
        witness=route.witness,
    )


def _function(file: Path) -> Callable[[Real], Mapping[str, Real]]:
    return function_of(file, "exact", "times", "channels by name", "a route of [reference] names it")
