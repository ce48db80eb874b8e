"""Doing one job in a worker: compile the scene with one engine, climb its efforts, hand out one record a run."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable, Iterable
from importlib import import_module
from pathlib import Path

import msgspec

from crosscheck.engines.contract import Effort, Engine, EngineMissing, Model, Run, Trajectory
from crosscheck.plan import Job
from crosscheck.records import RunRecord, RunStatus, pack
from flexmb.channels import channels_of

Emit = Callable[[RunRecord | str], None]
FULLY_STORED = 3  # the finest efforts, which the uncertainty needs in every channel
SHORT_S = 0.1  # a shorter solve is repeated, as the clock and the caches disturb it
REPEATS = 3


def execute(job: Job, emit: Emit) -> None:
    """Run a job; every outcome but a crash of the process is a record, and a string says what is being done."""
    blank = RunRecord(
        case=job.case,
        variant=job.variant,
        role=job.role,
        engine=job.engine,
        version="",
        scene=job.scene_id,
        status="did not run",
    )
    if job.error:
        emit(msgspec.structs.replace(blank, status="failed", message=f"the scene cannot be made: {job.error}"))
        return
    engine = find_engine(job.provider, job.engine)
    if isinstance(engine, str):
        emit(msgspec.structs.replace(blank, message=engine))
        return
    try:
        _with_engine(engine, job, blank, emit)
    except EngineMissing as error:
        emit(msgspec.structs.replace(blank, message=str(error)))
    except Exception as error:  # a fault in one adapter is a finding about it and must not end the session
        emit(msgspec.structs.replace(blank, status="failed", message=_describe(error)))


def find_engine(provider: str, name: str) -> Engine | str:
    """The engine called `name` from "module:function", or why there is none."""
    module, _, function = provider.partition(":")
    engines: dict[str, Engine] = getattr(import_module(module), function)()
    if name in engines:
        return engines[name]
    return f'there is no engine "{name}"; the engines are {", ".join(engines)}'


def _with_engine(engine: Engine, job: Job, blank: RunRecord, emit: Emit) -> None:
    version = engine.version()
    support = engine.supports(job.scene)
    blank = msgspec.structs.replace(blank, version=version, support=support.reason)
    if support.kind == "no":
        emit(msgspec.structs.replace(blank, status="refused", message=support.reason))
        return
    ladder = job.efforts or engine.efforts(job.scene)
    rungs = len(ladder)
    chosen = [(rung, effort) for rung, effort in enumerate(ladder) if not job.finest_only or rung == rungs - 1]
    waiting = [(rung, effort) for rung, effort in chosen if (effort.label, version, rung, rungs) not in job.done]
    if not waiting:
        return
    emit("compiling")
    start = time.perf_counter()
    model = engine.compile(job.scene)
    model.warm_up()
    compile_s = time.perf_counter() - start
    for rung, effort in waiting:
        emit(effort.label)
        full = rung >= rungs - FULLY_STORED
        record = msgspec.structs.replace(
            blank,
            effort=effort.label,
            effort_kind=effort.kind,
            effort_method=effort.method,
            effort_value=effort.value,
            rung=rung,
            rungs=rungs,
            compile_s=compile_s,
        )
        emit(_run(model, Run(times=job.times), effort, record, None if full else job.kept))


def _run(model: Model, run: Run, effort: Effort, record: RunRecord, kept: tuple[str, ...] | None) -> RunRecord:
    """One effort; `kept` names the channels to store, None for all."""
    try:
        trajectory = model.simulate(run, effort)
        wall = min(_walls(model, run, effort, trajectory))
    except Exception as error:  # the same as above, for one effort: the others may still work
        return msgspec.structs.replace(record, status="failed", message=_describe(error))
    status: RunStatus = trajectory.status
    message = trajectory.message
    if status == "finished" and len(trajectory.times) < len(run.times):
        status, message = "failed", f"ended at t = {trajectory.times[-1]:g} s of {run.times[-1]:g} s and called it done"
    channels = channels_of(trajectory)
    return msgspec.structs.replace(
        record,
        status=status,
        message=message,
        wall_s=wall,
        evaluations=trajectory.evaluations,
        times=pack(trajectory.times),
        channels={name: pack(values) for name, values in channels.items() if kept is None or name in kept},
    )


def _walls(model: Model, run: Run, effort: Effort, first: Trajectory) -> Iterable[float]:
    """Solve times: one for a long run, several for a short one."""
    yield first.wall_s
    if first.status == "finished" and first.wall_s < SHORT_S:
        for _ in range(REPEATS - 1):
            yield model.simulate(run, effort).wall_s


def _describe(error: Exception) -> str:
    """The error and where it was raised."""
    place = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {error} ({place.name}, {Path(place.filename).name} line {place.lineno})"
