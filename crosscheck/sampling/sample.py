"""The job of one sample: its scene is made, run by one engine, and reduced over time to the quantities."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import msgspec
import numpy as np

from crosscheck.library.case import Variant
from crosscheck.records.kinds import Confirmed, Environment, RunStatus
from crosscheck.running.execute import solve_job
from crosscheck.running.job import Job
from crosscheck.running.plan import altered_scene
from crosscheck.running.rung import Solved
from crosscheck.sampling.file import Reduction, SweepFile, SweptQuantity
from crosscheck.sampling.values import with_values
from flexmb.scene.check import check_scene
from flexmb.scene.schema import Scene
from flexmb.typing import Real


class SampleRecord(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="record", tag="sample"
):
    """The outcome of one sample in one engine; `quantities` are there when it is "finished".

    `scene` identifies the scene with its values and the sample times, `asked` the quantities with their reductions,
    `made_by` everything else that the result depends on, as of a RunRecord.
    """

    sample: int
    engine: str
    scene: str
    asked: str
    status: RunStatus
    version: str = ""
    made_by: str = ""
    effort: str = ""
    rungs: int = 0
    message: str = ""
    parameters: dict[str, float]
    quantities: dict[str, float] = {}
    compile_s: float = 0.0
    wall_s: float = 0.0


Written = Environment | SampleRecord


@dataclass(frozen=True)
class SampleJob:
    """A sample as sent to a worker, which makes the scene of the `job` from `base`."""

    job: Job
    sample: int
    values: tuple[float, ...]
    sweep: SweepFile
    base: Scene
    variant: Variant
    asked: str

    @property
    def blank(self) -> SampleRecord:
        """The record of a sample without a result."""
        names = [parameter.title for parameter in self.sweep.parameters]
        return SampleRecord(
            sample=self.sample, engine=self.job.engine, scene=self.job.scene_id, asked=self.asked,
            status="did not run", parameters=dict(zip(names, self.values, strict=True)),
        )  # fmt: skip


@dataclass(frozen=True)
class Sampled:
    """A sweep that was run: the outcome of every sample in every engine, in order."""

    sweep: SweepFile
    records: tuple[SampleRecord, ...]


def run_sample(sample: SampleJob, emit: Callable[[Any], None]) -> None:
    """The function of a worker: emits a SampleRecord, or a Confirmed if the recorded one is valid."""

    def reduced(content: Solved | Confirmed | str) -> None:
        if isinstance(content, Solved):
            emit(_reduced(sample, content))
        elif isinstance(content, Confirmed):
            emit(content)

    solve_job(_with_scene(sample), reduced)


def _with_scene(sample: SampleJob) -> Job:
    """The job with its scene, or with the error if the values make the scene invalid."""
    try:
        scene = altered_scene(with_values(sample.base, sample.sweep, sample.values), sample.variant)
        check_scene(scene, t_end=float(sample.job.times[-1]))
    except (ValueError, NotImplementedError, OSError) as error:
        return replace(sample.job, error=str(error))
    return replace(sample.job, scene=scene)


def _reduced(sample: SampleJob, solved: Solved) -> SampleRecord:
    run = solved.record
    record = msgspec.structs.replace(
        sample.blank, status=run.status, message=run.message, version=run.version, made_by=run.made_by,
        effort=run.effort, rungs=run.rungs, compile_s=run.compile_s, wall_s=run.wall_s,
    )  # fmt: skip
    if run.status != "finished":
        return record
    try:
        quantities = {quantity.name: reduce(quantity, solved.channels) for quantity in sample.sweep.quantities}
    except ValueError as error:
        return msgspec.structs.replace(record, status="failed", message=str(error))
    return msgspec.structs.replace(record, quantities=quantities)


LETTERS = {3: "xyz", 4: "wxyz"}  # of the components of a vector and of a quaternion
REDUCTIONS: dict[Reduction, Callable[[Real], float]] = {
    "final": lambda signal: signal[-1],
    "initial": lambda signal: signal[0],
    "minimum": np.min,
    "maximum": np.max,
    "range": np.ptp,
    "mean": np.mean,  # of the samples, which are equally spaced
    "largest": lambda signal: np.max(np.abs(signal)),
}


def reduce(quantity: SweptQuantity, channels: Mapping[str, Real]) -> float:
    """The quantity of a run with these channels (T, k); ValueError says what is missing, or is not finite."""
    if quantity.channel not in channels:
        raise ValueError(f'{quantity.name}: the engine gives no channel "{quantity.channel}"')
    number = float(REDUCTIONS[quantity.value](_signal(quantity, channels[quantity.channel])))
    if not np.isfinite(number):
        raise ValueError(f"{quantity.name} is {number}")
    return number


def _signal(quantity: SweptQuantity, values: Real) -> Real:
    """One component (T,), the only one, or the norm of all."""
    width, component = values.shape[1], quantity.component
    if component is None:
        return values[:, 0] if width == 1 else np.linalg.norm(values, axis=1)
    place = place_of(component, width)
    if place is None:
        raise ValueError(f"{quantity.name}: {quantity.channel} has {width} components, none is {component!r}")
    return values[:, place]


def place_of(component: int | str, width: int) -> int | None:
    """The column of a component in a channel of some width, None if it has no such component."""
    if isinstance(component, int):
        return component if 0 <= component < width else None
    letters = LETTERS.get(width, "")
    return letters.index(component) if len(component) == 1 and component in letters else None
