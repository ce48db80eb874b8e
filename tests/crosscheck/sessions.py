"""Running the small case with the fake engines, whole or with its run file changed."""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from pathlib import Path

from crosscheck.judging.outcome import SessionOutcome, conclude
from crosscheck.judging.results import collect
from crosscheck.judging.verdict import Verdict
from crosscheck.library.find import Case, load_case
from crosscheck.records.archive import Archive, read
from crosscheck.records.kinds import CaseRecord, RunRecord
from crosscheck.records.machine import environment
from crosscheck.records.session import last_session
from crosscheck.running.execute import execute
from crosscheck.running.job import Job
from crosscheck.running.plan import plan
from crosscheck.running.scheduler import Limits
from crosscheck.running.sweep import sweep

CASE = Path(__file__).parent / "data" / "pendulum" / "single"
PROVIDER = "tests.crosscheck.fake_engines:engines"
HEAD = """
title = "Single pendulum"
duration_s = 2.0
samples = 21
"""


def copy_case(folder: Path, run_file: str | None = None) -> Path:
    """The small case as folder/pendulum/single, with another run file if one is given."""
    target = folder / "pendulum" / "single"
    shutil.copytree(CASE, target)
    if run_file is not None:
        (target / "run.toml").write_text(HEAD + run_file, encoding="utf-8")
    return target


def run_case(case: Path, records: Path, asked: tuple[str, ...] = (), **options: object) -> SessionOutcome:
    """Run a case folder and judge its records."""
    sweep([load_case(case)], asked, records, provider=PROVIDER, limits=Limits(workers=2), **options)
    return conclude(collect(last_session(read(records))))


def compare_engines(
    folder: Path, engines: tuple[str, ...], goals: str = '"marker:tip.position" = 1e-6'
) -> SessionOutcome:
    """All pairs of some engines on the pendulum."""
    names = ", ".join(f'"{name}"' for name in engines)
    run_file = f"""
[[variant]]
name = "rigid"
engines = [{names}]

[[comparison]]
name = "all"
variant = "rigid"
goals = {{ {goals} }}
"""
    return run_case(copy_case(folder, run_file), folder / "records.jsonl")


def only(verdicts: list[Verdict], a: str, b: str) -> Verdict:
    """The one verdict on a pair of engines."""
    (found,) = [verdict for verdict in verdicts if (verdict.engine_a, verdict.engine_b) == (a, b)]
    return found


def sweep_here(
    cases: Iterable[Case], asked: tuple[str, ...], records: Path, *, provider: str = PROVIDER, **_: object
) -> None:
    """What `sweep` records but for films, without its worker processes, which take a second each to start."""
    run_here([plan(case, asked, provider) for case in cases], asked, records)


def run_here(
    plans: Iterable[tuple[CaseRecord, list[Job]]], asked: tuple[str, ...], records: Path, **_: object
) -> None:
    """What `run_planned` records, in this process."""
    archive = Archive(records)
    for record, jobs in plans:
        archive.write(environment((record.case,), asked, confirms=True))
        archive.write(record)
        for job in jobs:
            execute(job, lambda content: archive.write(content) if isinstance(content, RunRecord) else None)
    archive.close()
