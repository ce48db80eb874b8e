"""What a CSV is held against: the stored reference of a case, or an engine that runs now, at the times of the CSV."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Protocol

import msgspec
import numpy as np

from crosscheck.judging.against_reference import CLOCK, REFERENCE, of_stored, shared_times
from crosscheck.judging.results import Result, collect
from crosscheck.judging.uncertainty import Uncertainty
from crosscheck.judging.verdict import Signal
from crosscheck.library.case import RunFile, Variant
from crosscheck.library.channels import most_specific
from crosscheck.library.find import Case
from crosscheck.library.reference import StoredReference, current_reference, has_reference
from crosscheck.records.archive import read
from crosscheck.references.other_times import reference_at
from crosscheck.running.job import MAIN
from crosscheck.running.plan import jobs_at, plan, sample_times
from crosscheck.running.scheduler import Limits, Scheduler
from crosscheck.running.sweep import run_planned
from crosscheck.verify.columns import VerifyError
from flexmb.scene.rigid_equivalent import total_mass
from flexmb.scene.schema import Scene
from flexmb.typing import Real


class Target(Protocol):
    """A reference made by `engine` and described by `title`, with `times` (T,) s at which it is usually compared."""

    @property
    def engine(self) -> str: ...
    @property
    def title(self) -> str: ...
    @property
    def times(self) -> Real: ...
    @property
    def known(self) -> Sequence[str]:
        """The channels that it stores; empty if that shows only when it runs."""

    @property
    def mass(self) -> float | None:
        """The mass (kg) of its scene; None if a body has it in a file."""

    def signals(self, times: Real) -> dict[str, Signal]:
        """Its channels at `times` (T,) s, rising, from 0 to the last of its own. ValueError if it cannot have them."""


@dataclass(frozen=True)
class StoredTarget:
    """The stored reference: nothing runs for times that it holds, an engine of its recipe for others."""

    case: Case
    stored: StoredReference
    provider: str
    scheduler: Scheduler
    engine: str = REFERENCE

    @property
    def title(self) -> str:
        return f"the stored reference of variant {self.stored.knowledge.variant}, to {self.times[-1]:g} s"

    @property
    def times(self) -> Real:
        return self.stored.times

    @property
    def known(self) -> Sequence[str]:
        return tuple(self.stored.channels)

    @property
    def mass(self) -> float | None:
        return _mass(self.case.scene(self.case.run.variant(self.stored.knowledge.variant)))

    def signals(self, times: Real) -> dict[str, Signal]:
        places = shared_times(times, self.times)
        if places is None:
            return reference_at(self.case, self.stored, times, self.provider, self.scheduler)
        held = of_stored(self.stored)
        return {name: _at(held.signal(name), places) for name in held.channels}


@dataclass(frozen=True)
class EngineTarget:
    """An engine that runs on a variant of a case, with samples at the times asked for."""

    case: Case
    variant: Variant
    engine: str
    provider: str
    scheduler: Scheduler
    known: Sequence[str] = ()

    @property
    def title(self) -> str:
        return f"{self.engine}, run now on variant {self.variant.name}"

    @property
    def times(self) -> Real:
        return sample_times(self.case.run, self.variant)

    @property
    def mass(self) -> float | None:
        return _mass(self.case.scene(self.variant))

    def signals(self, times: Real) -> dict[str, Signal]:
        begun = times if times[0] <= CLOCK * times[-1] else np.concatenate([[0.0], times])
        result = self._run(begun)
        places = np.arange(len(begun))[len(begun) - len(times) :]
        return {name: _at(result.signal(name, across=False), places) for name in result.determined_channels}

    def _run(self, times: Real) -> Result:
        """The engine's result on the variant at the times, run now."""
        run = self.case.run.alone(msgspec.structs.replace(self.variant, engines=(self.engine,), also=(), refined=None))
        with TemporaryDirectory() as folder:
            records = Path(folder) / "records.jsonl"
            record, jobs = plan(replace(self.case, run=run), (), self.provider)
            planned = record, jobs_at(jobs, times)
            run_planned([planned], (), records, limits=Limits(workers=1), scheduler=self.scheduler)
            (results,) = collect(read(records)).cases
        result = results.get(self.variant.name, self.engine, MAIN)
        if result.status != "finished":
            said = f"{self.engine} on {self.variant.name}, is not there: {result.status}: {result.message}"
            raise VerifyError(f"the reference, {said}")
        return result


def target_of(case: Case, variant: Variant, engine: str | None, provider: str, scheduler: Scheduler) -> Target:
    """The stored reference, unless an engine is asked for or it is of another variant."""
    if engine is None and has_stored(case, variant):
        return StoredTarget(case, current_reference(case), provider, scheduler)
    return EngineTarget(case, variant, engine or "native", provider, scheduler)


def chosen_variant(case: Case, name: str | None, stored: bool) -> Variant:
    """The variant called `name`; without a name that of the `stored` reference if it counts, else the first."""
    if name is not None:
        return case.run.variant(name)
    recipe = case.run.reference
    if stored and recipe is not None and has_reference(case.folder):
        return case.run.variant(recipe.variant)
    return case.run.variants[0]


def has_stored(case: Case, variant: Variant) -> bool:
    """Whether the stored reference of the case is of this variant."""
    recipe = case.run.reference
    return recipe is not None and recipe.variant == variant.name and has_reference(case.folder)


def goal_of(run: RunFile, variant: Variant, channel: str) -> float | None:
    """The goal of the stored reference, or else of the first comparison of the variant that judges the channel."""
    recipe = run.reference
    asked = [recipe.goals] if recipe is not None and recipe.variant == variant.name else []
    for item in run.comparisons:
        sides = [side.variant for side in (item.a, item.b) if side is not None]
        if variant.name in (item.variant, *sides):
            asked.append(item.goals)
    for goals in asked:
        pattern = most_specific(goals, channel)
        if pattern is not None:
            return goals[pattern]
    return None


def _at(signal: Signal, places: np.ndarray) -> Signal:
    """Some samples of a signal, with the U and the sizes of the whole."""
    doubt = signal.uncertainty
    kept = Uncertainty(np.full(len(places), doubt.value), doubt.value, doubt.how, doubt.order)
    return Signal(signal.values[places], kept, signal.sizes)


def _mass(scene: Scene) -> float | None:
    """In kg; None if a body has its mass in a SID file."""
    try:
        return total_mass(scene)
    except ValueError:
        return None
