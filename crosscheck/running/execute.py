"""Doing one job in a worker: compile the scene with one engine, climb its efforts, hand out one record a run."""

from __future__ import annotations

import hashlib
import time
import traceback
from collections.abc import Callable, Mapping
from importlib import import_module
from math import ceil
from pathlib import Path

import msgspec
import numpy as np

from crosscheck.engines.answers import (
    BrokenContract,
    checked_model,
    checked_run,
    checked_version,
    clean,
    efforts_of,
    support_of,
)
from crosscheck.engines.contract import Effort, Engine, EngineMissing, Model, Run, Trajectory
from crosscheck.engines.registry import home
from crosscheck.engines.trajectories import determined_channels
from crosscheck.records.kinds import Confirmed, RunRecord
from crosscheck.records.made_by import made_by
from crosscheck.records.packing import pack
from crosscheck.running.job import MAIN, Done, Job
from flexmb.scene.schema import Scene
from flexmb.typing import Real

Emit = Callable[[RunRecord | Confirmed | str], None]
FULLY_STORED = 4  # the finest efforts, which the uncertainty needs in every channel
SOLVES = ((0.03, 3), (0.1, 2))  # a shorter solve (s) is made so many times, as the clock and the caches disturb it
COARSEST = 0  # the rung whose run, the cheapest, is always held against another: a longer one may differ, too
BEGINNING = 0.1  # of the samples: what is run before and after a coarsest run that takes long, to be the same twice


def execute(job: Job, emit: Emit) -> None:
    """Run a job. Every outcome is emitted as a record, and what is being done as a string.

    Only the end of the process leaves no record.
    """
    blank = RunRecord(
        case=job.case,
        variant=job.variant,
        role=job.role,
        engine=job.engine,
        version="",
        scene=job.scene_id,
        status="did not run",
    )
    if job.scene is None:
        emit(msgspec.structs.replace(blank, status="failed", message=f"the scene cannot be made: {job.error}"))
        return
    try:
        engine = find_engine(job.provider, job.engine)
        if isinstance(engine, str):
            emit(msgspec.structs.replace(blank, message=engine))
            return
        _with_engine(engine, job, job.scene, blank, emit)
    except EngineMissing as error:
        emit(msgspec.structs.replace(blank, message=clean(str(error))))
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # a fault in one adapter, a call of sys.exit too, must not end the session
        emit(msgspec.structs.replace(blank, status="failed", message=describe(error)))


def find_engine(provider: str, name: str) -> Engine | str:
    """The engine called `name` from "module:function", or why there is none. No other engine is loaded for it."""
    module, _, function = provider.partition(":")
    engines: Mapping[str, Engine] = getattr(import_module(module), function)()
    if name in engines:
        return engines[name]
    return f'there is no engine "{name}"; the engines are {", ".join(engines)}'


def describe(error: BaseException) -> str:
    """The error and where it was raised."""
    frames = traceback.extract_tb(error.__traceback__)
    place = f" ({frames[-1].name}, {Path(frames[-1].filename).name} line {frames[-1].lineno})" if frames else ""
    try:
        text = str(error)
    except Exception:
        text = "its text cannot be had"
    if isinstance(error, BrokenContract):
        return clean(f"broke the contract: {text}")
    return clean(f"{type(error).__name__}: {text}{place}")


def _with_engine(engine: Engine, job: Job, scene: Scene, blank: RunRecord, emit: Emit) -> None:
    version = checked_version(engine.version())
    support = support_of(engine, scene, float(job.times[0]))
    blank = msgspec.structs.replace(blank, version=version, support=support.reason)
    if support.kind == "no":
        emit(msgspec.structs.replace(blank, status="refused", message=support.reason))
        return
    ladder = job.efforts or efforts_of(engine, scene, float(np.ptp(job.times)))
    rungs = len(ladder)
    key = _key(engine, version, job, rungs)
    chosen = [(rung, effort) for rung, effort in enumerate(ladder) if not job.finest_only or rung == rungs - 1]
    waiting = [(rung, effort) for rung, effort in chosen if Done(effort.label, key, rung, rungs) not in job.done]
    if len(waiting) < len(chosen):
        emit(
            Confirmed(
                case=job.case, variant=job.variant, role=job.role, engine=job.engine, scene=job.scene_id, made_by=key
            )
        )
    if not waiting:
        return
    emit("compiling")
    start = time.perf_counter()
    model = checked_model(engine.compile(scene))
    model.warm_up()
    compile_s = time.perf_counter() - start
    for rung, effort in waiting:
        emit(effort.label)
        full = rung >= rungs - FULLY_STORED and not job.lean
        record = msgspec.structs.replace(
            blank,
            made_by=key,
            effort=effort.label,
            effort_kind=effort.kind,
            effort_method=effort.method,
            effort_value=effort.value,
            rung=rung,
            rungs=rungs,
            compile_s=compile_s,
        )
        emit(_run(model, job, scene, effort, record, None if full else job.kept))


def _key(engine: Engine, version: str, job: Job, rungs: int) -> str:
    """The key of everything that the results depend on, but for scene and effort; see `made_by`."""
    code = made_by({type(engine).__module__, home(job.engine)} - {""})
    kept = job.kept if rungs > FULLY_STORED or job.lean else ()
    return hashlib.sha256(f"{code} {version} {kept}".encode()).hexdigest()[:16]


def _run(
    model: Model, job: Job, scene: Scene, effort: Effort, record: RunRecord, kept: tuple[str, ...] | None
) -> RunRecord:
    """One effort; `kept` names the channels to store, None for all."""
    try:
        proves = record.rung == COARSEST and not job.lean
        begun = _solved(model, _beginning(job.times), scene, effort) if proves else None
        before = time.perf_counter()
        run = _solved(model, job.times, scene, effort)
        took_s = time.perf_counter() - before  # by this process' clock: an engine may say of itself what it likes
        wall = run.wall_s
        if run.status == "finished" and not job.lean:
            times = solves(min(took_s, wall)) if job.role == MAIN else 1  # no chart shows the time of another
            for _ in range(times - 1):
                again = _solved(model, job.times, scene, effort)
                _require_the_same(run, again)
                wall = min(wall, again.wall_s)
            if begun is not None and times == 1:
                _require_the_same(begun, _solved(model, _beginning(job.times), scene, effort))
        channels = determined_channels(run) if len(run.times) else {}
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # as in `execute`, but the other efforts may still work
        return msgspec.structs.replace(record, status="failed", message=describe(error))
    return msgspec.structs.replace(
        record,
        status=run.status,
        message=run.message,
        wall_s=wall,
        evaluations=run.evaluations,
        times=pack(run.times) if len(run.times) else None,
        channels={name: pack(values) for name, values in channels.items() if kept is None or name in kept},
        undetermined=run.undetermined,
    )


def solves(seconds: float) -> int:
    """How many times a run is made that takes so long."""
    return next((times for below, times in SOLVES if seconds < below), 1)


def _beginning(times: Real) -> Real:
    """The first of the sample times, two at least."""
    return times[: max(2, ceil(BEGINNING * len(times)))]


def _solved(model: Model, times: Real, scene: Scene, effort: Effort) -> Trajectory:
    """One solve; the engine gets sample times of its own, which it may do with as it likes."""
    return checked_run(model.simulate(Run(times=times.copy()), effort), times, scene)


def _require_the_same(first: Trajectory, again: Trajectory) -> None:
    """A run that is repeated with the same effort must give the same, or its uncertainty means nothing."""
    if again.status != first.status:
        raise BrokenContract(f"not reproducible: the same effort finished once and {again.status} the next time")
    others = determined_channels(again)
    for name, values in determined_channels(first).items():
        if name not in others or not np.array_equal(values, others[name]):
            raise BrokenContract(f"not reproducible: {name} is another when the same effort is run again")
