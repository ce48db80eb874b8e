"""The entry point that runs many copies of a scene with different initial states, masses, lengths or stiffnesses."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from time import perf_counter
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from flexmb.integrate.control import ACCEPTED, EVALUATIONS, REJECTED, SAMPLES
from flexmb.integrate.integrator import Method
from flexmb.integrate.settings import Settings
from flexmb.jit.lanes import LANES
from flexmb.run.batch_trajectory import BatchTrajectory
from flexmb.run.beside import computed
from flexmb.run.interruption import interruptible
from flexmb.run.lane_runs import BatchRun, Runs, WholeRun, runs
from flexmb.run.propagate import NO_STATES
from flexmb.run.simulate import RunSettings, refuse_unknown, refuse_without_jacobian
from flexmb.run.times import refuse_times, sample_times
from flexmb.scene.problems import SceneWarning
from flexmb.scene.schema import Scene
from flexmb.scene.sizes import refuse_bytes
from flexmb.scene.sticking import any_sticks
from flexmb.system.batch import Batch, number_of_threads
from flexmb.system.compile import compile_batch
from flexmb.system.system import System
from flexmb.system.watches import Said, WatchedStates, said
from flexmb.tables import arguments
from flexmb.tables.features import BATCHES
from flexmb.tables.status import OK
from flexmb.typing import Real

if TYPE_CHECKING:
    from flexmb.system.level_range import TooFast

NAMED = 8
"""Ranges of copies that a warning names."""


def simulate_batch(
    copies: Batch | System | Sequence[Scene],
    t_end: float,
    method: Method = "dop853",
    *,
    q: Any = None,
    u: Any = None,
    samples: int | Sequence[float] | Real = 201,
    threads: int | None = None,
    **settings: Unpack[RunSettings],
) -> BatchTrajectory:
    """Simulate many copies of a scene from t = 0 to `t_end` (s): each as `simulate` would, but many times faster.

    copies: scenes of one structure with different numbers, or the `Batch` that `compile_batch` makes of them; or one
    compiled system, whose copies differ in their initial states. q (n,nq), u (n,nu): initial coordinates and speeds of
    all copies, by default those of the scenes. method, samples and settings: see `simulate`. "rk4" and "dop853" run
    eight copies at once in SIMD lanes of the processor; with "dop853" each copy has its own steps. The other methods,
    and scenes with closures, run one copy after the other. Those with events or controllers run copy by copy in threads
    (one thread for laws in Python), each bit-identical to `simulate` from the same state; events and signals are in the
    result. In lanes all modes are eliminated explicitly. threads: number of threads, by default one per processor.

    A run that fails raises nothing and does not affect the others: `status` and `message` of the result say why it
    stopped. Raises SceneError, ValueError, TypeError or NotImplementedError as `simulate` does, ValueError for states
    that do not fit the copies, and KeyboardInterrupt for Ctrl-C. Warns (`SceneWarning`) of what `simulate` warns of
    in any copy, once for all copies, with their numbers.
    """
    refuse_unknown("simulate_batch", settings)
    batch = copies.batch if isinstance(copies, System) else copies
    batch = batch if isinstance(batch, Batch) else compile_batch(batch)
    t_end = arguments.number("t_end", t_end)
    chosen = Settings(method, **settings).checked(t_end)
    if chosen.integrator.linearises:
        refuse_without_jacobian(batch.systems[0], "articulated", method)
    for system in batch.systems:
        refuse_times(system, 0.0, t_end)
    times = sample_times(samples, t_end)
    rows = batch.states(*_given(batch, q, u))
    number = number_of_threads(threads, -(-len(rows[0]) // LANES))
    _refuse_too_many(len(rows[0]), len(times), batch)
    found = runs(*rows, len(times))
    turned: dict[int, list[TooFast]] = {}
    bent: dict[int, Real] = {}
    whole: dict[int, WholeRun] = {}
    if len(rows[0]):
        start, runner = perf_counter(), BatchRun(batch, times, chosen, found)
        _, interrupted = interruptible(runner, (len(rows[0]), number), runner.stop)
        if interrupted:
            raise KeyboardInterrupt
        turned, bent, whole = runner.turned, runner.bent, runner.whole
        scene = batch.system(0).scene
        if batch.in_lanes and not chosen.integrator.linearises and not _by_themselves(scene):
            computed(batch.system(0), perf_counter() - start, BATCHES)
    made = _gathered(batch, times, found, len(rows[0]), whole)
    for warning in (*_doubted(batch, whole), *_watched(made, turned, bent)):
        warnings.warn(warning, SceneWarning, stacklevel=2)
    return made


def _by_themselves(scene: Scene) -> bool:
    """Whether copies are not run in lanes, as something happens to each at its own instants."""
    return bool(scene.controllers or scene.events) or any_sticks(scene)


def _watched(runs: BatchTrajectory, turned: Mapping[int, Sequence[TooFast]], bent: Mapping[int, Real]) -> Iterator[str]:
    """What watches of accuracy say: of each body and each watch once, of the worst copy, with the numbers of all.

    turned, bent: see `BatchRun`.
    """
    batch, found = runs.batch, dict[tuple[str, str], dict[int, Said]]()
    strained = len(batch.systems[0].constants.section) > 0 or _leaves_out(batch.systems[0])
    failed = set(runs.failed.tolist())
    for copy in range(len(runs.status)) if strained else sorted(turned.keys() | failed):
        if strained or copy in failed:
            own = said(_seen(runs, copy, turned.get(copy, ()), bent.get(copy, NO_STATES)))
        else:
            own = [Said(each, "level_range") for each in turned[copy]]
        for each in own:
            found.setdefault((each.waiver, each.finding.body), {})[copy] = each
    for alike in found.values():
        worst = max(alike, key=lambda copy: alike[copy].finding.size)
        yield f'scene "{batch.systems[0].scene.name}": {alike[worst]}{_called(sorted(alike), worst)}'


def _doubted(batch: Batch, whole: Mapping[int, WholeRun]) -> Iterator[str]:
    """What events have made doubtful: each once, with the numbers of all copies that say it."""
    found = dict[str, list[int]]()
    for copy in sorted(whole):
        for doubt in whole[copy].doubts:
            found.setdefault(doubt, []).append(copy)
    for doubt, copies in found.items():
        yield f'scene "{batch.systems[0].scene.name}": {doubt}{_called(copies)}'


def _leaves_out(system: System) -> bool:
    """Whether the watch of few modes has to look, which the first copy tells for all."""
    if system.is_rigid:
        return False
    from flexmb.system.few_modes import suspects  # imported here because many scenes have no flexible bodies

    return bool(suspects(system))


def _seen(runs: BatchTrajectory, copy: int, turned: Sequence[TooFast], bent: Real) -> WatchedStates:
    """A copy as watches of accuracy see it; one that has failed by its output times."""
    system, failed = runs.batch.system(copy), bool(runs.status[copy] != OK)
    reached = np.isfinite(runs.q[copy]).all(axis=1)
    t, q, u = runs.t[reached], runs.q[copy, reached], runs.u[copy, reached]

    def turns(n: int) -> Real:
        return system.turns(float(t[n]), q[n], u[n])

    return WatchedStates(system, t, q, u, turns, failed, fastest=bent, turned=None if failed else turned)


def _called(copies: list[int], worst: int | None = None) -> str:
    """The numbers of copies, which ascend, as words: not more than NAMED ranges of them."""
    if len(copies) == 1:
        return f" (copy {copies[0]})"
    steps = np.flatnonzero(np.diff(copies) > 1)
    ranges = [(int(each[0]), int(each[-1])) for each in np.split(copies, steps + 1)]
    words = [str(i) if i == j else f"{i} to {j}" for i, j in ranges[:NAMED]]
    left = sum(j - i + 1 for i, j in ranges[NAMED:])
    more = f" and {left} more" if left else ""
    most = "" if worst is None else f"; copy {worst} is the worst"
    return f" (copies {', '.join(words)}{more}{most})"


def _given(batch: Batch, q: Any, u: Any) -> tuple[Any, Any]:
    """Initial coordinates and speeds with equally many rows; those of the scenes are used where none are given."""
    if q is not None and u is not None:
        return q, u
    own_q, own_u = batch.initial_states()
    if q is None and u is None:
        return own_q, own_u
    given = batch.rows("q", q) if u is None else batch.rows("u", u)
    if batch.shares_constants:
        own_q, own_u = (np.repeat(own, len(given), axis=0) for own in (own_q, own_u))
    return (given, own_u) if u is None else (own_q, given)


def _refuse_too_many(n: int, samples: int, batch: Batch) -> None:
    size = 8.0 * n * samples * (batch.nq + batch.nu + 1)
    remedy = "ask for fewer samples, or run fewer copies at once"
    refuse_bytes(size, f"{n} copies at {samples} output times take", remedy)


def _signals(whole: Mapping[int, WholeRun], n: int, samples: int) -> dict[str, Real]:
    """Signals (n,T,k) by name; NaN at times that a run did not reach."""
    found = dict[str, Real]()
    for copy, run in whole.items():
        for name, values in run.signals.items():
            every = found.setdefault(name, np.full((n, samples, values.shape[1]), np.nan))
            every[copy, : len(values)] = values
    return found


def _gathered(batch: Batch, times: Real, found: Runs, n: int, whole: Mapping[int, WholeRun]) -> BatchTrajectory:
    """The result for n copies; values at times that a run did not reach are NaN."""
    states, counts = found.out[:n], found.counts[:n]
    states[np.arange(len(times)) >= counts[:, SAMPLES, None]] = np.nan
    return BatchTrajectory(
        batch=batch,
        t=times,
        q=states[:, :, : batch.nq],
        u=states[:, :, batch.nq : -1],
        work=states[:, :, -1],
        status=found.status[:n],
        fault=found.fault[:n],
        stopped_at=found.stopped_at[:n],
        evaluations=counts[:, EVALUATIONS],
        accepted_steps=counts[:, ACCEPTED],
        rejected_steps=counts[:, REJECTED],
        events=tuple(whole[copy].events for copy in range(n)) if whole else (),
        signals=_signals(whole, n, len(times)),
        messages=tuple(whole[copy].message for copy in range(n)) if whole else (),
    )
