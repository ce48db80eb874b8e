"""Running a map: coarse cells first, then those that refinement asks for; each is recorded, so a run can be resumed."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import closing
from functools import cache
from importlib import import_module
from pathlib import Path
from time import process_time
from typing import Any, NamedTuple

from crosscheck.engines.answers import clean
from crosscheck.engines.contract import EngineMissing
from crosscheck.library.case_error import CaseError
from crosscheck.library.code import executed
from crosscheck.records.archive import Archive
from crosscheck.records.machine import environment
from crosscheck.running.pool import run_jobs
from crosscheck.running.scheduler import BY_DEFAULT, TIME_LIMIT_S, Event, Limits, Scheduler, Work
from crosscheck.stability.boundary import MapVerdict, judge, label
from crosscheck.stability.map import Measurement, StabilityMap
from crosscheck.stability.map_records import CellRecord, MapRecord, Written, cells_of, identity, read
from crosscheck.stability.refine import Cell, CellMesh

# The maps of a user's Python file.


def maps_in(file: Path) -> dict[str, StabilityMap]:
    """The maps of a Python file, by name: those in its tuple `MAPS`. The file is executed.

    CaseError names the file: if it is not there or cannot be loaded, if user code was forbidden, if `MAPS` is no tuple
    of maps, and for names that are used twice or are no identifiers, as pictures and records are named by them.
    """
    found = getattr(executed(file, "its maps are asked for"), "MAPS", None)
    if not isinstance(found, tuple | list) or not found or not all(isinstance(what, StabilityMap) for what in found):
        raise CaseError(f"{file}: it has no maps: add MAPS, a tuple of crosscheck.stability.map.StabilityMap")
    known = {what.name: what for what in found}
    wrong = [name for name in known if not name.isidentifier()]
    if wrong or len(known) < len(found):
        why = f'"{wrong[0]}" is no identifier' if wrong else "a name is used twice"
        raise CaseError(f"{file}: {why}: name each of its maps by letters, digits and underscores, and differently")
    return known


PROVIDER = "crosscheck.stability.catalogue:stability_maps"
Listener = Callable[[StabilityMap, int, int], None]


class CellJob(NamedTuple):
    """One cell of a map, as it is sent to a worker."""

    provider: str
    map: str
    identity: str
    cell: Cell
    x: float
    y: float


class Finished(NamedTuple):
    """A map that was run: its mesh, what its cells gave, and the judgement."""

    map: StabilityMap
    mesh: CellMesh
    records: dict[Cell, CellRecord]
    verdict: MapVerdict


def run_map(
    name: str,
    records: Path,
    *,
    depth: int | None = None,
    fresh: bool = False,
    provider: str = PROVIDER,
    limits: Limits = BY_DEFAULT,
    scheduler: Scheduler = run_jobs,
    listener: Listener = lambda what, done, known: None,
) -> Finished:
    """Run one map of the provider (`maps_of`) to `depth` halvings (default: its own) and append to the file `records`.

    Cells already recorded by the same sources are kept unless `fresh`. A cell that takes longer than the `limits` allow
    is stopped; for the map it did not run, and the next run asks for it again. `listener` is told how many of the cells
    known so far are done. Raises KeyError where there is no such map.
    """
    what = maps_of(provider)[name]
    mesh = CellMesh(what.x, what.y, what.depth if depth is None else depth)
    if fresh:
        records.unlink(missing_ok=True)
    mark = identity(what, _own_file(provider))
    known = cells_of(read(records), mark) if records.exists() else {}
    used: dict[Cell, CellRecord] = {}
    archive = Archive(records, Written)
    try:
        archive.write(environment())
        archive.write(MapRecord(map=name, identity=mark, quantity=what.quantity, x=what.x, y=what.y))
        jobs = list[CellJob]()

        def ask(cells: Sequence[Cell]) -> None:
            """Take recorded cells and submit the others; refine further once none is left."""
            while cells:
                here = [known[cell] for cell in cells if cell in known]
                new = [cell for cell in cells if cell not in known]
                jobs.extend(CellJob(provider, name, mark, cell, *mesh.centre(cell)) for cell in new)
                cells = take(here) if here else []

        def take(found: list[CellRecord]) -> list[Cell]:
            used.update((record.cell, record) for record in found)
            listener(what, len(used), len(used) + len(mesh.waiting) - len(found))
            return mesh.settle((record.cell, label(what, record)) for record in found)

        ask(sorted(mesh.waiting))
        time_s = TIME_LIMIT_S if limits.time_s is None else limits.time_s
        log = str(records.with_suffix(".log"))
        work = Work(
            run_cell, jobs, log, limits.workers, time_limit_s=lambda job: time_s, memory_limit_bytes=limits.memory_bytes
        )
        with closing(scheduler(work)) as events:
            for event in events:
                if event.kind in ("emitted", "crashed", "stopped"):
                    record = event.content if event.kind == "emitted" else _cut_short(jobs[event.job], event)
                    archive.write(record)
                    ask(take([record]))
    finally:
        archive.close()
    return Finished(what, mesh, used, judge(what, mesh, used))


@cache
def maps_of(provider: str) -> dict[str, StabilityMap]:
    """Maps by name, from "module:function", or from a file of one's own, whose path ends in ".py" (`maps_in`)."""
    file = _own_file(provider)
    if file is not None:
        return maps_in(file)
    module, _, function = provider.partition(":")
    known: dict[str, StabilityMap] = getattr(import_module(module), function)()
    return known


def is_own_file(provider: str) -> bool:
    """Whether maps come from a file of one's own."""
    return provider.endswith(".py")


def _own_file(provider: str) -> Path | None:
    return Path(provider) if is_own_file(provider) else None


def run_cell(job: CellJob, emit: Callable[[Any], None]) -> None:
    """The work of a worker on a cell: whatever a map raises is recorded."""
    begin = process_time()
    try:
        outcome = maps_of(job.provider)[job.map].outcome(job.x, job.y)
    except EngineMissing as error:
        outcome = Measurement(status="did not run", message=str(error))
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        outcome = Measurement(status="failed", message=clean(f"{type(error).__name__}: {error}"))
    if outcome.status == "measured" and not math.isfinite(outcome.value):
        outcome = Measurement(status="failed", message=f"the quantity is {outcome.value}")
    emit(
        CellRecord(
            identity=job.identity, level=job.cell.level, i=job.cell.i, j=job.cell.j, x=job.x, y=job.y,
            status=outcome.status, value=float(outcome.value) if outcome.status == "measured" else None,
            message=outcome.message, cpu_s=process_time() - begin,
        )
    )  # fmt: skip


def _cut_short(job: CellJob, event: Event) -> CellRecord:
    """A cell whose process died or was stopped at a limit is no evidence about a method: it did not run."""
    return CellRecord(
        identity=job.identity, level=job.cell.level, i=job.cell.i, j=job.cell.j, x=job.x, y=job.y,
        status="did not run", message=event.content,
    )  # fmt: skip
