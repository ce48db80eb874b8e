"""The further runs of a session: for each chart of a case, efforts of all its engines that meet its target errors.

They are planned when all that is judged has run, since errors are relative to the best known reference
(`crosscheck.judging.chart_reference`), and the runs that are judged count.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import inf, isfinite
from typing import Literal

import numpy as np

from crosscheck.judging.against_reference import shared_times
from crosscheck.judging.chart_reference import ChartReference, chart_reference
from crosscheck.judging.results import CaseResults, Result, collect
from crosscheck.records.kinds import CHART, CaseRecord, Record
from crosscheck.running.job import MAIN, Job
from crosscheck.running.tuned import Asked, Charted, TriedEffort

CHART_LIMIT_S = 120.0  # of a job that is expected to spend `BUDGET_S`: what takes so long hangs


def chart_jobs(case: CaseRecord, jobs: Sequence[Job], records: Sequence[Record]) -> list[Job]:
    """The jobs for the charts of a case, from its jobs and what they have recorded."""
    (results,) = collect([case, *records]).cases
    references = [(chart, chart_reference(results, chart)) for chart in case.run.charts]
    found = []
    for job in jobs:
        if job.role != MAIN:
            continue
        result = results.get(job.variant, job.engine)
        asked = [
            _asked(result, chart.observable, reference)
            for chart, reference in references
            if reference is not None and chart.shows(job.variant, job.engine) and _offers(result, chart.observable)
        ]
        wanted = tuple(each for each in asked if each is not None)
        if wanted:
            found.append(_charted(job, wanted, results))
    return found


def _offers(result: Result, observable: str) -> bool:
    return observable in result.channels and observable not in result.open


def _charted(job: Job, asked: tuple[Asked, ...], results: CaseResults) -> Job:
    earlier = results.charted.get((job.variant, job.engine))
    done = earlier.made_by if earlier is not None and earlier.scene == job.scene_id else ""
    return replace(
        job, role=CHART, linear=(), done=frozenset(), kept=tuple(dict.fromkeys(each.observable for each in asked)),
        expected_s=None, time_limit_s=min(job.time_limit_s, CHART_LIMIT_S), charted=Charted(asked, done),
    )  # fmt: skip


def _asked(result: Result, observable: str, reference: ChartReference) -> Asked | None:
    """None where nothing moves, or the engine's samples are others than the reference's."""
    scale, places = reference.scale(observable), shared_times(reference.times, result.times)
    if not scale > 0.0 or places is None:
        return None
    known = tuple(_known(result, observable, reference))
    doubt = reference.uncertainty / scale
    return Asked(observable, np.asarray(places), reference.values, scale, doubt, known) if known else None


def _known(
    result: Result, observable: str, reference: ChartReference
) -> Iterator[tuple[Literal["tolerance", "step"], str, tuple[TriedEffort, ...]]]:
    """The runs that are judged, of each method one that finished at least."""
    methods = dict.fromkeys((run.effort_kind, run.effort_method) for run in result.runs if run.effort)
    for kind, method in methods:
        tried = []
        for run in result.runs:
            if (run.effort_kind, run.effort_method) == (kind, method) and run.status in ("finished", "diverged"):
                finished = run.status == "finished" and observable in run.channels
                error = reference.error(result, observable, run) if finished else None
                error = error if error is not None and isfinite(error) else inf
                tried.append(TriedEffort(run.effort_value, error, max(run.cpu_s or run.wall_s, 1e-9)))
        if any(each.error < inf for each in tried):
            yield ("tolerance" if kind == "tolerance" else "step"), method, tuple(tried)
