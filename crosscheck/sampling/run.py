"""Running a sweep: samples are jobs of a scheduler, and each outcome is recorded as it comes."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

from crosscheck.engines.answers import clean
from crosscheck.engines.contract import Effort
from crosscheck.engines.registry import PROVIDER, home
from crosscheck.library.case import CaseError, Variant
from crosscheck.library.find import resolve
from crosscheck.records.archive import Archive, decoded_lines
from crosscheck.records.kinds import Confirmed
from crosscheck.records.machine import environment
from crosscheck.records.made_by import made_by
from crosscheck.running.job import MAIN, Done, Job
from crosscheck.running.plan import sample_times, scene_identity
from crosscheck.running.pool import run_jobs
from crosscheck.running.scheduler import BY_DEFAULT, TIME_LIMIT_S, Event, Limits, Scheduler, Work
from crosscheck.running.sweep import library
from crosscheck.sampling.file import SweepFile, load_sweep
from crosscheck.sampling.outputs import samples_table
from crosscheck.sampling.refusals import require_sense
from crosscheck.sampling.sample import Sampled, SampleJob, SampleRecord, Written, run_sample
from crosscheck.sampling.values import sample_values
from flexmb.output.files import in_words, take_away
from flexmb.scene.files import load_scene
from flexmb.scene.problems import SceneError, closest
from flexmb.scene.schema import Scene
from flexmb.typing import Real

RECORDS, TABLE, SUMMARY = "samples.jsonl", "samples.csv", "summary.json"
REDUCING = ("crosscheck.sampling.sample",)
Listener = Callable[[int, int, int], None]  # numbers of samples: done, all, without result


@dataclass(frozen=True)
class Subject:
    """The scene that is varied, before its variant's transformation, and the sample times (s)."""

    base: Scene
    variant: Variant
    times: Real


def run_sweep(
    file: Path,
    out: Path,
    *,
    fresh: bool = False,
    provider: str = PROVIDER,
    limits: Limits = BY_DEFAULT,
    scheduler: Scheduler = run_jobs,
    listener: Listener = lambda done, known, lost: None,
) -> Sampled:
    """Run the sweep of a file; records go to `samples.jsonl` in the folder `out`, and a table to `samples.csv`.

    Samples that are recorded with the same values, quantities, sources and machine are not run again unless `fresh`.
    Raises CaseError if the file, or a path, channel, engine or method in it, is invalid, before anything
    runs.
    """
    sweep = load_sweep(file)
    try:
        subject = _subject(sweep, file.parent)
    except (CaseError, SceneError) as error:
        raise CaseError(f"{file}: {error}") from None
    except OSError as error:
        raise CaseError(f"{file}: {in_words(error)}: name a scene or a case that is there") from None
    values = sample_values(sweep)
    require_sense(file, sweep, subject.base, subject.times, values, provider)
    records = out / RECORDS
    for name in (TABLE, SUMMARY):  # files of an earlier sweep must not remain if this one is killed
        take_away(out / name)
    if fresh:
        records.unlink(missing_ok=True)
    known = _known(records)
    jobs = _jobs(sweep, subject, values, known, provider, limits.time_s or TIME_LIMIT_S)
    work = Work(
        run_sample, jobs, str(out / "samples.log"), limits.workers, lambda sample: library(sample.job),
        lambda sample: sample.job.time_limit_s, limits.memory_bytes,
    )  # fmt: skip
    used: dict[int, SampleRecord] = {}
    with (
        closing(Archive(records, Written)) as archive,
        samples_table(out / TABLE, sweep) as add,
        closing(scheduler(work)) as events,
    ):
        archive.write(environment())
        for event in events:
            record = _outcome(jobs[event.job], event, known)
            if record is None:
                continue
            if not isinstance(event.content, Confirmed):
                archive.write(record)
            add(record)
            used[event.job] = record
            listener(len(used), len(jobs), sum(result.status != "finished" for result in used.values()))
    return Sampled(sweep, tuple(used.get(number, job.blank) for number, job in enumerate(jobs)))


def _subject(sweep: SweepFile, folder: Path) -> Subject:
    if sweep.scene:
        assert sweep.duration_s is not None and sweep.samples is not None  # checked with the file
        times = np.linspace(0.0, sweep.duration_s, sweep.samples)
        return Subject(load_scene(folder / sweep.scene), Variant(name="scene", engines=sweep.engines), times)
    beside = folder / sweep.case
    cases = resolve((str(beside) if (beside / "run.toml").is_file() else sweep.case,))
    if len(cases) != 1:
        raise CaseError(f'"{sweep.case}" names {len(cases)} cases: name one')
    run = cases[0].run
    names = [variant.name for variant in run.variants]
    if sweep.variant and sweep.variant not in names:
        raise CaseError(f'case {cases[0].name} has no variant "{sweep.variant}": {closest(sweep.variant, names)}')
    variant = run.variant(sweep.variant or names[0])
    timed = msgspec.structs.replace(
        variant, duration_s=sweep.duration_s or variant.duration_s, samples=sweep.samples or variant.samples
    )
    return Subject(cases[0].scene(variant), variant, sample_times(run, timed))


def _jobs(
    sweep: SweepFile, subject: Subject, values: Real, known: dict[tuple[str, ...], SampleRecord], provider: str,
    time_limit_s: float,
) -> list[SampleJob]:  # fmt: skip
    asked = _digest(msgspec.json.encode(sweep.quantities), made_by((), REDUCING))
    what = [(parameter.paths, parameter.relative) for parameter in sweep.parameters]
    base = _digest(scene_identity(subject.base, subject.times), msgspec.json.encode(subject.variant), what)
    kept = tuple(quantity.channel for quantity in sweep.quantities)
    engines = [(engine, home(engine), _effort(sweep, engine)) for engine in sweep.engines]  # plug-ins are looked for
    jobs = []
    for sample, row in enumerate(values):
        scene_id = _digest(base, row.tolist())
        for engine, maker, efforts in engines:
            done = known.get((engine, scene_id, asked))
            job = Job(
                case=sweep.title, variant=subject.variant.name, role=MAIN, engine=engine, scene=None, scene_id=scene_id,
                times=subject.times, provider=provider, maker=maker, efforts=efforts, finest_only=True, kept=kept,
                done=_done(done), time_limit_s=time_limit_s, lean=True,
            )  # fmt: skip
            jobs.append(SampleJob(job, sample, tuple(row.tolist()), sweep, subject.base, subject.variant, asked))
    return jobs


def _effort(sweep: SweepFile, engine: str) -> tuple[Effort, ...]:
    return tuple(
        Effort(effort.kind, effort.value, effort.method) for effort in sweep.efforts if effort.engine == engine
    )


def _known(records: Path) -> dict[tuple[str, ...], SampleRecord]:
    """The latest recorded outcome by engine, scene and quantities."""
    lines = decoded_lines(records, Written) if records.exists() else []
    return {(line.engine, line.scene, line.asked): line for line in lines if isinstance(line, SampleRecord)}


def _done(record: SampleRecord | None) -> frozenset[Done]:
    """The recorded run by which a job is confirmed: only one that finished or diverged."""
    if record is None or record.status not in ("finished", "diverged"):
        return frozenset()
    return frozenset((Done(record.effort, record.made_by, record.rungs - 1, record.rungs),))


def _outcome(job: SampleJob, event: Event, known: dict[tuple[str, ...], SampleRecord]) -> SampleRecord | None:
    """The record of a sample, if the event is its outcome."""
    if isinstance(event.content, SampleRecord):
        return event.content
    if isinstance(event.content, Confirmed):
        record = known[job.job.engine, job.job.scene_id, job.asked]
        return msgspec.structs.replace(record, sample=job.sample, parameters=job.blank.parameters)
    if event.kind in ("crashed", "stopped"):
        return msgspec.structs.replace(job.blank, status=event.status_of_end, message=clean(event.content))
    return None


def _digest(*parts: object) -> str:
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:16]
