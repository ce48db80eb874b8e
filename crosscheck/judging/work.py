"""Work beside accuracy: what the runs behind verdicts took, and whether they take as much as those of the reference.

Counts do not depend on the machine, times do. So counts alone are compared, where engine, variant, effort and sample
times are those of a run that made the stored reference. More than `crosscheck.library.work.ALIKE` more is *more work
than recorded*. As with figures that are worse than recorded, it is a warning, and with `--strict` an error: the answer
is right, and dearer than it was. Less work is told and is never an error. Of another version of an outside engine the
change is told alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from crosscheck.engines.registry import OWN_CODE
from crosscheck.judging.results import CaseResults
from crosscheck.judging.verdict import Verdict
from crosscheck.library.work import Counted, Counts, RunWork, changes, key
from crosscheck.records.kinds import RunRecord
from crosscheck.records.packing import unpack

MAIN = "main"
RunKey = tuple[str, str, str, str]  # case, variant, engine, role


@dataclass(frozen=True)
class WorkChange:
    """A count of a run that is not that of the reference; `version`: of the engine then, if it is another now."""

    case: str
    variant: str
    engine: str
    effort: str
    count: Counted
    then: int
    now: int
    version: str = ""

    @property
    def dearer(self) -> bool:
        """Whether it is more work than recorded by the same version."""
        return self.now > self.then and not self.version

    def __str__(self) -> str:
        where = f"{self.case}, {self.variant}, {self.engine}, {self.effort}"
        more = "more" if self.now > self.then else "less"
        stale = f"; that was by {self.version}" if self.version else ""
        return f"{where}: {more} work than recorded: {self.now} {self.count}, {self.then} for the reference{stale}"


def work_of(run: RunRecord) -> RunWork:
    """What one recorded run took."""
    return RunWork(
        effort=run.effort, wall_s=run.wall_s, cpu_s=run.cpu_s, evaluations=run.evaluations, steps=run.steps,
        operations=run.operations,
    )  # fmt: skip


def work_by_run(case: CaseResults) -> Iterator[tuple[RunKey, RunWork]]:
    """What the finest run of each result took, by case, variant, engine and role."""
    for (variant, engine, role), result in case.results.items():
        if result.runs:
            yield (case.case.case, variant, engine, role), work_of(result.finest)


def keys_of(verdict: Verdict) -> tuple[RunKey, RunKey]:
    """The runs that a verdict judges; the second side of a conserved quantity and of a reference has none."""
    role = f"control:{verdict.comparison}" if verdict.kind == "control" else MAIN
    a, b = verdict.sides
    return (verdict.case, *a, role), (verdict.case, *b, MAIN)


def work_changes(case: CaseResults) -> Iterator[WorkChange]:
    """The counts of a case's runs that are not those of the runs that made its reference."""
    reference = case.case.reference
    if reference is None or not reference.work or reference.times is None:
        return
    times = unpack(reference.times)
    versions = dict(made.rpartition(" ")[::2] for made in reference.made_with)
    for (variant, engine, role), result in case.results.items():
        for run in result.runs if role == MAIN else ():
            then = reference.work.get(key(engine, variant, run.effort))
            if then is None or run.status != "finished" or run.times is None:
                continue
            own = unpack(run.times)
            if own.shape != times.shape or not np.allclose(own, times, rtol=1e-9, atol=0.0):
                continue  # samples and spans cost steps
            version = versions.get(engine, run.version)
            other = f"{engine} {version}" if version != run.version and engine not in OWN_CODE else ""
            now = Counts(run.evaluations, run.steps, run.operations)
            for count, before, after in changes(then, now):
                yield WorkChange(case.case.case, variant, engine, run.effort, count, before, after, other)


def seconds(value: float) -> str:
    """A time with three digits, in s, ms or us."""
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if value >= size:
            return f"{value / size:.3g} {unit}"
    return f"{value / 1e-6:.3g} us"
