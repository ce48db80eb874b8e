"""Running the small case with the fake engines, whole or with its run file changed."""

import json
import shutil
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from crosscheck.judging.outcome import SessionOutcome, conclude
from crosscheck.judging.results import collect
from crosscheck.judging.verdict import Verdict
from crosscheck.library.find import Case, load_case, shipped_cases
from crosscheck.records.archive import read
from crosscheck.records.kinds import CaseRecord
from crosscheck.records.session import last_session
from crosscheck.references.regenerate import regenerate
from crosscheck.running.installed import require_engines
from crosscheck.running.job import Job
from crosscheck.running.scheduler import Event, Events, Limits, Work
from crosscheck.running.sweep import run_planned, sweep

CASE = Path(__file__).parent / "data" / "pendulum" / "single"
PROVIDER = "tests.crosscheck.fake_engines:engines"
HEAD = """
title = "Single pendulum"
duration_s = 2.0
samples = 21
"""


@cache
def shipped() -> tuple[Case, ...]:
    """All cases of the library: to read them takes two seconds."""
    return shipped_cases()


def here(work: Work) -> Events:
    """A scheduler without processes, which take a second each to start, and without limits: one job after the other."""
    number = 0
    while number < len(work.jobs):  # jobs may grow
        found: list[Any] = []
        yield Event(number, "started")
        work.function(work.jobs[number], found.append)
        yield from (Event(number, "emitted", content) for content in found)
        yield Event(number, "ended")
        number += 1


def copy_case(folder: Path, run_file: str | None = None) -> Path:
    """The small case as folder/pendulum/single, with another run file if one is given."""
    target = folder / "pendulum" / "single"
    shutil.copytree(CASE, target)
    if run_file is not None:
        (target / "run.toml").write_text(HEAD + run_file, encoding="utf-8")
    return target


def run_case(case: Path, records: Path, asked: tuple[str, ...] = (), **options: Any) -> SessionOutcome:
    """Run a case folder and judge its records; in this process, unless `scheduler` says where."""
    sweep([load_case(case)], asked, records, **{"provider": PROVIDER, "scheduler": here, **options})
    return conclude(collect(last_session(read(records))))


def versus(*engines: str, goals: str = '"marker:tip.position" = 1e-6') -> str:
    """The part of a run file in which engines run the rigid variant, and all pairs of them are compared."""
    return f"""
[[variant]]
name = "rigid"
engines = {json.dumps(engines)}

[[comparison]]
name = "all"
variant = "rigid"
goals = {{ {goals} }}
"""


def compare_engines(
    folder: Path, engines: tuple[str, ...], goals: str = '"marker:tip.position" = 1e-6', **options: Any
) -> SessionOutcome:
    """All pairs of some engines on the pendulum."""
    return run_case(copy_case(folder, versus(*engines, goals=goals)), folder / "records.jsonl", **options)


def only(verdicts: list[Verdict], a: str, b: str) -> Verdict:
    """The one verdict on a pair of engines."""
    (found,) = [verdict for verdict in verdicts if (verdict.engine_a, verdict.engine_b) == (a, b)]
    return found


def sweep_here(cases: Iterable[Case], asked: tuple[str, ...], records: Path, **options: Any) -> None:
    """What `sweep` records, in this process."""
    sweep(cases, asked, records, **{"provider": PROVIDER, **options, "scheduler": here})


def engines_here(names: Iterable[str], broken: bool = False) -> None:
    """What `require_engines` says of fake engines, in this process."""
    require_engines(names, broken, PROVIDER, here)


def run_here(
    plans: Sequence[tuple[CaseRecord, list[Job]]], asked: tuple[str, ...], records: Path, **options: Any
) -> None:
    """What `run_planned` records, in this process."""
    run_planned(plans, asked, records, **{**options, "scheduler": here})


def referenced(folder: Path, run_file: str) -> Path:
    """The small case with this run file and its stored reference, whose routes run in this process."""
    case = copy_case(folder, run_file)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("crosscheck.references.routes.run_planned", run_here)
        regenerate(load_case(case), provider=PROVIDER, limits=Limits(workers=1))
    return case


def copy_of(case: Path, parent: Path) -> Path:
    """A case folder again below another folder, for changing."""
    return Path(shutil.copytree(case, parent / case.parent.name / case.name))


def edit(file: Path, old: str, new: str) -> None:
    """Replace a text that has to be there."""
    text = file.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new), encoding="utf-8")
