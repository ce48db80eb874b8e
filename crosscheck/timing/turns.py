"""Taking turns: each rival has a process of its own, and in every round each is timed once, one after the other.

What else the machine does then slows all alike, and the order changes from round to round, so that none always runs
behind the same neighbour. A rival that crashes, hangs or fails loses its place, and the others go on.
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

from crosscheck.engines.answers import BrokenContract, checked_model, checked_run, describe
from crosscheck.engines.contract import Effort, Model, Run
from crosscheck.running.execute import find_engine
from crosscheck.running.job import Job
from crosscheck.running.worker import TICK_S, Worker
from flexmb.run.channels import channels_of
from flexmb.typing import Real

TURN_S = 0.02  # a turn has as many solves as last this long together, so that short ones settle in the caches
MOST_SOLVES = 50


@dataclass(frozen=True)
class Sample:
    """Seconds of one solve: `solve_s` by the engine's own clock, which leaves out what is observed afterwards, `call_s`
    of the whole call by ours, `cpu_s` of the process in that call."""

    solve_s: float
    call_s: float
    cpu_s: float


@dataclass(frozen=True)
class CompileTimes:
    """A scene that was compiled twice: seconds of the first time in its process, and of the second."""

    first_s: float
    again_s: float


@dataclass(frozen=True)
class FirstSolve:
    """The solve before the timed ones: times (T,) and channels (T, k), and how many solves a turn has."""

    times: Real
    channels: Mapping[str, Real]
    solves: int


@dataclass(frozen=True)
class TurnFailure:
    """Why a rival is out."""

    message: str


@dataclass(frozen=True)
class Turn:
    """What a worker is asked: to compile (`effort` None), to try an effort (`solves` 0), or to time so many solves."""

    job: Job
    effort: Effort | None = None
    solves: int = 0


@dataclass
class Timed:
    """What came of one rival at one effort: its samples, or why there are none."""

    job: Job
    effort: Effort
    prepared: CompileTimes | None = None
    first: FirstSolve | None = None
    samples: list[Sample] = field(default_factory=list)
    failure: str = ""


_compiled: dict[tuple[str, str], Model] = {}  # of this worker, which serves one rival


def take_turn(turn: Turn, emit: Callable[[Any], None]) -> None:
    """What a worker does; whatever goes wrong is emitted as a `TurnFailure`."""
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
    """One solve, timed by itself: a mean of several would contain whatever disturbed one of them."""
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
    """Two solves: the first may still load something, the second says how many a turn needs."""
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
    return job.scene


@contextmanager
def _uncollected() -> Iterator[None]:
    """Without Python's garbage collection, whose moment is chance."""
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def in_turns(entries: Sequence[tuple[Job, Effort]], rounds: int) -> list[Timed]:
    """Time every entry, a rival at an effort, in `rounds` rounds. Efforts of one rival share its process.

    Never raises for what an engine does.
    """
    timed = [Timed(job, effort) for job, effort in entries]
    crew: dict[tuple[str, str], Worker] = {}
    with TemporaryDirectory() as folder:
        ask = _Asker(crew, str(Path(folder) / "log"))
        try:
            for each in timed:
                _prepare(each, timed, ask)
            for number in range(rounds):
                for place in range(len(timed)):
                    each = timed[(place + number) % len(timed)]
                    if not each.failure and each.first is not None:
                        answer = ask(each, Turn(each.job, each.effort, each.first.solves))
                        each.samples += answer if isinstance(answer, list) else []
        finally:
            for worker in crew.values():
                worker.dismiss()
    return timed


def _prepare(each: Timed, timed: Sequence[Timed], ask: _Asker) -> None:
    """Compile, unless another effort of the same rival has done so, and solve once."""
    same = [other for other in timed if other.job is each.job and (other.prepared or other.failure)]
    ready = next((other.prepared for other in same if other.prepared is not None), None)
    if ready is None and same:
        each.failure = same[0].failure
        return
    answer = ready or ask(each, Turn(each.job))
    if isinstance(answer, CompileTimes):
        each.prepared = answer
        first = ask(each, Turn(each.job, each.effort))
        each.first = first if isinstance(first, FirstSolve) else None


class _Asker:
    """Asks a rival's worker and waits for the answer; a failure takes the rival out of the rounds."""

    def __init__(self, crew: dict[tuple[str, str], Worker], log: str) -> None:
        self._crew = crew
        self._log = log

    def __call__(self, each: Timed, turn: Turn) -> Any:
        key = (turn.job.variant, turn.job.engine)
        worker = self._crew.setdefault(key, Worker())
        if turn.effort is not None and not worker.pid:
            each.failure = "its process ended at another of its efforts"
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
                each.failure = answer.message
            return answer
