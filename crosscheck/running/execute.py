"""Doing one job in a worker: compile the scene with one engine and run its efforts from coarse to fine."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable

import msgspec
import numpy as np

from crosscheck.engines.answers import clean, describe
from crosscheck.engines.checked import CheckedEngine
from crosscheck.engines.contract import Effort, Engine, EngineMissing
from crosscheck.engines.registry import NoSuchEngine, find_engine
from crosscheck.records.kinds import Confirmed, RunRecord
from crosscheck.records.made_by import made_by
from crosscheck.records.packing import pack
from crosscheck.running.job import Done, Job, extended
from crosscheck.running.moved import rounding
from crosscheck.running.rung import Solved, solve_rung
from flexmb.scene.schema import Scene

FULLY_STORED = 4  # the finest efforts, which the uncertainty needs in every channel


def execute(job: Job, emit: Callable[[RunRecord | Confirmed | str], None]) -> None:
    """Run a job and emit its outcomes as records, and the name of every step before it begins."""

    def recorded(found: Solved | Confirmed | str) -> None:
        emit(packed(found) if isinstance(found, Solved) else found)

    solve_job(job, recorded)


def solve_job(job: Job, emit: Callable[[Solved | Confirmed | str], None]) -> None:
    """Run a job and emit its outcomes with arrays as they are. Only the death of the process leaves no outcome."""
    try:
        if job.scene is None:
            message = f"the scene cannot be made: {job.error}"
            emit(Solved(msgspec.structs.replace(job.blank, status="failed", message=message)))
            return
        engine = find_engine(job.provider, job.engine)
        _solve_efforts(engine, job, job.scene, emit)
    except (EngineMissing, NoSuchEngine) as error:
        emit(Solved(msgspec.structs.replace(job.blank, message=clean(str(error)))))
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # a fault in one adapter, including sys.exit, must not end the session
        emit(Solved(msgspec.structs.replace(job.blank, status="failed", message=describe(error))))


def _solve_efforts(found: Engine, job: Job, scene: Scene, emit: Callable[[Solved | Confirmed | str], None]) -> None:
    """Emit one outcome for each effort that is not yet recorded, or the engine's refusal of the scene."""
    engine = checked(found, job)
    version = engine.version()
    support = engine.supports(scene)
    blank = msgspec.structs.replace(job.blank, version=version, support=support.reason)
    if support.kind == "no":
        emit(Solved(msgspec.structs.replace(blank, status="refused", message=support.reason)))
        return
    ladder = job.efforts or extended(engine.efforts(scene), job.extra, job.finer)
    rungs = len(ladder)
    kept = job.kept if rungs > FULLY_STORED or job.lean else ()
    code = made_by({type(found).__module__, job.maker} - {""})
    longer = f" {job.extra} {job.finer}" if job.extra or job.finer else ""  # tells it from the ladder without these
    longer += " with moved inputs" if job.rounding else ""
    key = hashlib.sha256(f"{code} {version} {kept}{longer}".encode()).hexdigest()[:16]
    chosen = [(rung, effort) for rung, effort in enumerate(ladder) if not job.finest_only or rung == rungs - 1]
    waiting = [(rung, effort) for rung, effort in chosen if Done(effort.label, key, rung, rungs) not in job.done]
    if len(waiting) < len(chosen):
        case, variant, role, name = job.work
        emit(Confirmed(case=case, variant=variant, role=role, engine=name, scene=job.scene_id, made_by=key))
    if not waiting:
        return
    emit("compiling")
    start = time.perf_counter()
    model = engine.compile(scene)
    model.warm_up()
    blank = msgspec.structs.replace(blank, made_by=key, rungs=rungs, compile_s=time.perf_counter() - start)
    for rung, effort in waiting:
        emit(effort.label)
        stores_all = rung >= rungs - FULLY_STORED and not job.lean
        solved = solve_rung(model, job, effort, msgspec.structs.replace(blank, rung=rung), stores_all)
        if job.rounding and rung == rungs - 1 and solved.record.status == "finished":
            emit("moved inputs")
            solved = _with_rounding(engine, job, scene, effort, solved)
        emit(solved)


def _with_rounding(engine: Engine, job: Job, scene: Scene, effort: Effort, solved: Solved) -> Solved:
    """The finished run with what rounding does to it; if that cannot be found a failed one: U would be too small."""
    try:
        found = rounding(engine, job, scene, effort, solved.channels)
    except Exception as error:
        failed = msgspec.structs.replace(solved.record, status="failed", message=describe(error))
        return Solved(failed)
    return solved._replace(record=msgspec.structs.replace(solved.record, rounding=found))


def checked(engine: Engine, job: Job) -> Engine:
    """The engine with its answers held against the contract, and asked about the job's times."""
    return CheckedEngine(engine, t_start=float(job.times[0]), duration_s=float(np.ptp(job.times)))


def packed(solved: Solved) -> RunRecord:
    """The record of an outcome with its arrays."""
    if solved.times is None:
        return solved.record
    channels = {name: pack(values) for name, values in solved.channels.items()}
    envelope = {name: pack(rows) for name, rows in solved.envelope.items()}
    return msgspec.structs.replace(solved.record, times=pack(solved.times), channels=channels, envelope=envelope)
