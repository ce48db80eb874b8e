"""One run at one effort, as a record. It is repeated where that is cheap: to time it, and to show that it repeats."""

from __future__ import annotations

import time
from collections.abc import Mapping
from math import ceil
from typing import NamedTuple

import msgspec
import numpy as np

from crosscheck.engines.answers import BrokenContract, describe
from crosscheck.engines.contract import Effort, Model, Run, Trajectory
from crosscheck.engines.openness import Openness
from crosscheck.engines.trajectories import signals_of
from crosscheck.records.kinds import CHART, ENVELOPE, RunRecord
from crosscheck.running.job import MAIN, Job
from flexmb.typing import Real

REPEATS = ((0.03, 3), (0.1, 2))
"""A solve shorter than so many seconds is made so many times, and the shortest time counts: other processes and the
caches disturb the clock."""
COARSEST = 0  # the rung that is always checked for reproducibility, since its run is the cheapest
FIRST_PART = 0.1  # of the samples: how much of a coarsest run is repeated if the whole of it takes too long


class Solved(NamedTuple):
    """An outcome: its record without arrays, and where there was a run the times (T,), channels (T, k) and envelope to
    store."""

    record: RunRecord
    times: Real | None = None
    channels: Mapping[str, Real] = {}
    envelope: Mapping[str, Real] = {}


def solve_rung(model: Model, job: Job, effort: Effort, blank: RunRecord, stores_all: bool) -> Solved:
    """The outcome of one effort, with all channels or only those that the job keeps; an error is a failed run."""
    record = msgspec.structs.replace(
        blank, effort=effort.label, effort_kind=effort.kind, effort_method=effort.method, effort_value=effort.value
    )
    try:
        run, wall_s, cpu_s = _timed(model, job, effort, record.rung == COARSEST)
        channels = determined(run) if len(run.times) else {}
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # as in `solve_job`, but the other efforts may still work
        return Solved(msgspec.structs.replace(record, status="failed", message=describe(error)))
    record = msgspec.structs.replace(
        record, status=run.status, message=run.message, wall_s=wall_s, cpu_s=cpu_s,
        evaluations=run.evaluations, steps=run.steps, operations=run.operations,
        undetermined=run.undetermined, events=run.events,
    )  # fmt: skip
    stored = {name: values for name, values in channels.items() if stores_all or name in job.kept}
    return Solved(record, run.times if len(run.times) else None, stored, run.envelope)


def _timed(model: Model, job: Job, effort: Effort, coarsest: bool) -> tuple[Trajectory, float, float]:
    """The run, its time (s), the shortest if it was repeated, and the processor time (s) of its first call.

    BrokenContract if a repetition differs.
    """
    first_part = Run(job.times[: max(2, ceil(FIRST_PART * len(job.times)))], job.linear)
    begun = model.simulate(first_part, effort) if coarsest and not job.lean else None
    start, start_cpu = time.perf_counter(), time.process_time()
    run = model.simulate(Run(job.times, job.linear, job.role == ENVELOPE), effort)
    took_s = time.perf_counter() - start  # by this process' clock: the engine's `wall_s` may claim anything
    cpu_s = time.process_time() - start_cpu
    if run.status != "finished" or job.lean:
        return run, run.wall_s, cpu_s
    wall_s = run.wall_s
    shown = job.role in (MAIN, CHART)  # no chart shows the times of other roles
    repeats = repeats_of(min(took_s, wall_s)) if shown else 1
    for _ in range(repeats - 1):
        again = model.simulate(Run(job.times, job.linear), effort)
        _require_the_same(run, again)
        wall_s = min(wall_s, again.wall_s)
    if begun is not None and repeats == 1:
        _require_the_same(begun, model.simulate(first_part, effort))
    return run, wall_s, cpu_s


def repeats_of(seconds: float) -> int:
    """How many times a run is made that takes so long."""
    return next((repeats for below, repeats in REPEATS if seconds < below), 1)


def _require_the_same(first: Trajectory, again: Trajectory) -> None:
    """The same effort must give the same run: otherwise the estimated uncertainty means nothing."""
    if again.status != first.status:
        raise BrokenContract(f"not reproducible: the same effort finished once and {again.status} the next time")
    others = determined(again)
    for name, values in determined(first).items():
        if name not in others or not np.array_equal(values, others[name], equal_nan=True):
            raise BrokenContract(f"not reproducible: {name} differs when the same effort is run again")


def determined(run: Trajectory) -> dict[str, Real]:
    """All channels (T, k) of a run, NaN in the components that the engine calls undetermined; channels of which nothing
    is left are not there."""
    is_open = Openness.of(run.undetermined)
    channels = ((name, is_open.filled(name, values, np.nan)) for name, values in signals_of(run).items())
    return {name: values for name, values in channels if not is_open.is_whole(name, values.shape[1])}
