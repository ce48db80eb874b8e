"""Doing a job in a worker: a ladder that is judged, or further efforts that a chart needs, tuned to its targets."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable
from functools import partial
from math import inf
from typing import Any, Literal

import msgspec
import numpy as np

from crosscheck.engines.answers import clean, describe
from crosscheck.engines.contract import Effort, Model
from crosscheck.engines.registry import find_engine
from crosscheck.library.channels import relative_error
from crosscheck.library.efforts import TARGETS, WITHIN
from crosscheck.records.kinds import CHART, ChartRecord, Confirmed, RunRecord
from crosscheck.records.made_by import made_by
from crosscheck.running.execute import checked, execute, packed
from crosscheck.running.job import Job
from crosscheck.running.rung import Solved, repeats_of, solve_rung
from crosscheck.running.tuned import BUDGET_S, LOOSEST, Asked, Charted, ProcessorBudget, TriedEffort, tune

HERE = ("crosscheck.running.charting", "crosscheck.running.tuned")  # what determines the runs, besides the engine


def work(job: Job, emit: Callable[[Any], None]) -> None:
    """Do a job and emit its outcomes: of a ladder as it is, of charts a record of all their runs at the end."""
    if job.charted is None:
        execute(job, emit)
        return
    try:
        emit(_charted(job, job.charted, emit))
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # as in `solve_job`: no fault in one adapter may end the session
        emit(msgspec.structs.replace(blank(job), message=clean(describe(error))))


def blank(job: Job) -> ChartRecord:
    """The record of a job without runs."""
    return ChartRecord(case=job.case, variant=job.variant, engine=job.engine, scene=job.scene_id)


def _charted(job: Job, charted: Charted, emit: Callable[[Any], None]) -> ChartRecord | Confirmed:
    assert job.scene is not None  # it was run
    found = find_engine(job.provider, job.engine)
    engine = checked(found, job)
    version = engine.version()
    key = _key(made_by({type(found).__module__, job.maker, *HERE} - {""}), version, charted)
    if key == charted.done:
        return Confirmed(
            case=job.case, variant=job.variant, role=CHART, engine=job.engine, scene=job.scene_id, made_by=key
        )
    record = msgspec.structs.replace(blank(job), made_by=key)
    if not any(_open(asked) for asked in charted.asked):
        return record
    emit("compiling")
    model = engine.compile(job.scene)
    model.warm_up()
    climb = _Climb(job, charted, model, version, emit)
    return msgspec.structs.replace(record, message=climb.all(), runs=tuple(climb.runs))


def _open(asked: Asked) -> list[float]:
    """The targets that the reference can tell."""
    return [target for target in TARGETS if asked.doubt <= target / WITHIN]


def _key(code: str, version: str, charted: Charted) -> str:
    digest = hashlib.sha256(f"{code} {version} {TARGETS} {BUDGET_S}".encode())
    for asked in charted.asked:
        digest.update(f"{asked.observable} {asked.scale!r} {asked.doubt!r}".encode())
        digest.update(asked.places.tobytes() + asked.values.tobytes())
    return digest.hexdigest()[:16]


class _Climb:
    """One engine's runs for all charts of a variant: a run counts in each of them."""

    def __init__(
        self, job: Job, charted: Charted, model: Model, version: str, emit: Callable[[Any], None]
    ) -> None:
        self._job, self._charted, self._model, self._emit = job, charted, model, emit
        self._blank = msgspec.structs.replace(job.blank, version=version)
        self._tried = {
            (number, kind, method): list(tried)
            for number, asked in enumerate(charted.asked)
            for kind, method, tried in asked.known
        }
        self.runs: list[RunRecord] = []

    def all(self) -> str:
        """Tune every method for every observable; returns what was not reached, and why."""
        times, reasons, budget = self._job.times, [], ProcessorBudget()
        coarsest = {"tolerance": LOOSEST, "step": float(np.min(np.diff(times)))}  # all of them stop at every sample
        for number, asked in enumerate(self._charted.asked):
            for kind, method, _ in asked.known:
                tried = self._tried[number, kind, method]
                solve = partial(self._run_at, kind, method)
                why = tune(solve, tried, kind, coarsest[kind], _open(asked), budget, repeats_of)
                reasons += [f"{asked.observable} by {method} to {why}"] if why else []
        return "; ".join(reasons)

    def _run_at(self, kind: Literal["tolerance", "step"], method: str, value: float) -> float:
        """Run an effort, and note its errors in all charts; returns the processor time (s) that it took."""
        effort = Effort(kind, value, method)
        self._emit(effort.label)
        begin = time.process_time()
        number = len(self.runs) + 1
        place = msgspec.structs.replace(self._blank, rung=number, rungs=number + 1)  # none is a ladder's coarsest
        solved = solve_rung(self._model, self._job, effort, place, stores_all=False)
        took_s = time.process_time() - begin
        self.runs.append(packed(solved))
        for number, asked in enumerate(self._charted.asked):
            tried = self._tried.get((number, effort.kind, effort.method))
            if tried is not None:
                tried.append(TriedEffort(effort.value, _error(solved, asked), max(solved.record.cpu_s, 1e-9)))
        return took_s


def _error(solved: Solved, asked: Asked) -> float:
    """The largest distance from the reference, of its size; infinite where there is none."""
    if solved.record.status != "finished" or asked.observable not in solved.channels:
        return inf
    return relative_error(
        asked.observable, solved.channels[asked.observable][asked.places], asked.values, asked.scale
    )
