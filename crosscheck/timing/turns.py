"""Timing in turns: each rival has its own process, and in every round each is timed once, one after the other.

So other load of the machine slows all of them alike. The order changes from round to round, so that no rival always
follows the same one. A rival that crashes, hangs or fails is left out, and the others continue.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from math import inf, isfinite
from multiprocessing.connection import wait
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, process_time
from typing import Any

from msgspec.structs import replace

from crosscheck.engines.answers import BrokenContract, checked_model, checked_run, describe
from crosscheck.engines.contract import Effort, Model, Run
from crosscheck.engines.registry import find_engine
from crosscheck.running.job import Job
from crosscheck.running.worker import TICK_S, Worker
from flexmb.run.channels import channels_of
from flexmb.typing import Real

TURN_S = 0.02  # least duration of a turn: short solves are repeated in it, so that they run from warm caches
MOST_SOLVES = 50


@dataclass(frozen=True)
class Sample:
    """Seconds of one solve: `solve_s` by the engine's own clock, which excludes the computation of outputs, `call_s`
    of the whole call by our clock, `cpu_s` of the process in that call."""

    solve_s: float
    call_s: float
    cpu_s: float


@dataclass(frozen=True)
class CompileTimes:
    """Seconds of compiling a scene for the first and for the second time in a process."""

    first_s: float
    again_s: float


@dataclass(frozen=True)
class FirstSolve:
    """The solve before the timed ones: times (T,), channels (T, k), and the number of solves of a turn."""

    times: Real
    channels: Mapping[str, Real]
    solves: int


@dataclass(frozen=True)
class TurnFailure:
    """Why a rival is left out."""

    message: str


@dataclass(frozen=True)
class Turn:
    """A request to a worker: to compile (`effort` None), to try an effort (`solves` 0), or to time so many solves."""

    job: Job
    effort: Effort | None = None
    solves: int = 0


@dataclass
class Timed:
    """The samples of one rival at one effort, or why there are none."""

    job: Job
    effort: Effort
    prepared: CompileTimes | None = None
    first: FirstSolve | None = None
    samples: list[Sample] = field(default_factory=list)
    failure: str = ""


_compiled: dict[tuple[str, str], Model] = {}  # of this worker, which serves one rival


def take_turn(turn: Turn, emit: Callable[[Any], None]) -> None:
    """The function of a worker; every error is emitted as a `TurnFailure`."""
    try:
        emit(_done(turn))
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # a fault in one adapter must not end the others' turns
        emit(TurnFailure(describe(error)))


def _done(turn: Turn) -> CompileTimes | FirstSolve | list[Sample]:
    job = turn.job
    key = (job.variant, job.engine)
    if turn.effort is None:
        first_s, _ = _compile(job)
        again_s, _compiled[key] = _compile(job)
        return CompileTimes(first_s, again_s)
    model = _compiled[key]
    if not turn.solves:
        return _first_solve(model, job, turn.effort)
    with _uncollected():
        return [_sample(model, job, turn.effort) for _ in range(turn.solves)]


def _sample(model: Model, job: Job, effort: Effort) -> Sample:
    """One solve, timed alone: a mean of several would contain every disturbance."""
    start, cpu = perf_counter(), process_time()
    run = model.simulate(Run(times=job.times.copy()), effort)
    call_s, cpu_s = perf_counter() - start, process_time() - cpu
    if run.status != "finished":
        raise BrokenContract(f"not reproducible: it finished before, and {run.status} now: {run.message}")
    if not (isfinite(run.wall_s) and run.wall_s > 0.0):
        raise BrokenContract(f"wall_s is {run.wall_s:g} s for a solve: no time that can be compared")
    return Sample(run.wall_s, call_s, cpu_s)


def _compile(job: Job) -> tuple[float, Model]:
    engine = find_engine(job.provider, job.engine)
    engine.version()  # imports its library, which is not compiling
    start = perf_counter()
    model = checked_model(engine.compile(_scene(job)))
    model.warm_up()
    return perf_counter() - start, model


def _first_solve(model: Model, job: Job, effort: Effort) -> FirstSolve:
    """Two solves: the first may still load something, the second determines the number of solves of a turn."""
    for _ in range(2):
        start = perf_counter()
        run = checked_run(model.simulate(Run(times=job.times.copy()), effort), job.times, _scene(job))
        took = perf_counter() - start
    if run.status != "finished":
        raise BrokenContract(f"it finished when it was judged, and {run.status} now: {run.message}")
    return FirstSolve(run.times, channels_of(run), min(MOST_SOLVES, max(1, round(TURN_S / max(took, 1e-7)))))


def _scene(job: Job) -> Any:
    if job.scene is None:
        raise ValueError(f"the scene cannot be made: {job.error}")
    return replace(job.scene, total_loads=())  # sums are outputs, which are not timed


@contextmanager
def _uncollected() -> Iterator[None]:
    """Suspend Python's garbage collection, which runs at random times."""
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def in_turns(entries: Sequence[tuple[Job, Effort]], rounds: int) -> list[Timed]:
    """Time every entry, a rival at an effort, in `rounds` rounds. Efforts of one rival share its process.

    An engine's errors are part of the result.
    """
    timed = [Timed(job, effort) for job, effort in entries]
    crew: dict[tuple[str, str], Worker] = {}
    with TemporaryDirectory() as folder:
        ask = _Asker(crew, str(Path(folder) / "log"))
        try:
            for candidate in timed:
                _prepare(candidate, timed, ask)
            for number in range(rounds):
                for place in range(len(timed)):
                    candidate = timed[(place + number) % len(timed)]
                    if not candidate.failure and candidate.first is not None:
                        answer = ask(candidate, Turn(candidate.job, candidate.effort, candidate.first.solves))
                        candidate.samples += answer if isinstance(answer, list) else []
        finally:
            for worker in crew.values():
                worker.dismiss()
    return timed


def _prepare(candidate: Timed, timed: Sequence[Timed], ask: _Asker) -> None:
    """Compile, unless another effort of the same rival has done so, and solve once."""
    same = [other for other in timed if other.job is candidate.job and (other.prepared or other.failure)]
    ready = next((other.prepared for other in same if other.prepared is not None), None)
    if ready is None and same:
        candidate.failure = same[0].failure
        return
    answer = ready or ask(candidate, Turn(candidate.job))
    if isinstance(answer, CompileTimes):
        candidate.prepared = answer
        first = ask(candidate, Turn(candidate.job, candidate.effort))
        candidate.first = first if isinstance(first, FirstSolve) else None


class _Asker:
    """Asks a rival's worker and waits for the answer; a failed rival is left out of the rounds."""

    def __init__(self, crew: dict[tuple[str, str], Worker], log: str) -> None:
        self._crew = crew
        self._log = log

    def __call__(self, candidate: Timed, turn: Turn) -> Any:
        key = (turn.job.variant, turn.job.engine)
        worker = self._crew.setdefault(key, Worker())
        if turn.effort is not None and not worker.pid:
            candidate.failure = "its process ended at another of its efforts"
            return None
        worker.hand_out(0, turn, " ".join(key), take_turn, self._log, turn.job.time_limit_s)
        answer: Any = TurnFailure("it gave no answer")
        while True:
            ready = worker.pipe is not None and bool(wait([worker.pipe], TICK_S))
            event = worker.news(ready, {}, inf)
            if event is None:
                continue
            if event.kind == "emitted":
                answer = event.content
                continue
            if event.kind != "ended":
                answer = TurnFailure(str(event.content))
            if isinstance(answer, TurnFailure):
                candidate.failure = answer.message
            return answer
