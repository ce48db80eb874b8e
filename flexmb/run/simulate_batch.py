"""The entry point that runs many copies of a scene with different initial states, masses, lengths or stiffnesses."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from functools import partial
from time import perf_counter
from typing import Any, Unpack

import numpy as np

from flexmb.integrate.control import ACCEPTED, EVALUATIONS, REJECTED, SAMPLES, STOP
from flexmb.integrate.integrator import Method
from flexmb.integrate.settings import Settings
from flexmb.jit.lanes import LANES
from flexmb.run.batch_trajectory import BatchTrajectory
from flexmb.run.beside import computed
from flexmb.run.interruption import interruptible
from flexmb.run.lane_runs import BatchRun, Runs, runs
from flexmb.run.samples import sample_times
from flexmb.run.simulate import RunSettings, refuse_unknown, refuse_without_jacobian
from flexmb.run.switching import refuse_times
from flexmb.scene.problems import SceneWarning
from flexmb.scene.schema import Scene
from flexmb.scene.sizes import refuse_bytes
from flexmb.system.batch import Batch, number_of_threads
from flexmb.system.compile import compile_batch
from flexmb.system.system import System
from flexmb.system.watches import Said, WatchedStates, said
from flexmb.tables import arguments
from flexmb.tables.features import BATCHES
from flexmb.tables.status import OK
from flexmb.typing import Real


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
    and scenes with closures or controllers, run one copy after the other. In lanes all modes are eliminated explicitly.
    threads: number of threads, by default one per processor.

    A run that fails raises nothing and does not affect the others: `status` and `message` of the result say why it
    stopped. Raises SceneError, ValueError, TypeError or NotImplementedError as `simulate` does, ValueError for states
    that do not fit the copies, and KeyboardInterrupt for Ctrl-C. Warns (`SceneWarning`) as `simulate` does, of many
    copies once.
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
        if system.scene.events:
            raise NotImplementedError(f'scene "{system.scene.name}" has events: run its copies one by one by simulate')
    times = sample_times(samples, t_end)
    rows = batch.states(*_given(batch, q, u))
    number = number_of_threads(threads, -(-len(rows[0]) // LANES))
    _refuse_too_many(len(rows[0]), len(times), batch)
    found = runs(*rows, len(times))
    if len(rows[0]):
        start, stop = perf_counter(), found.counts.T[STOP : STOP + 1]  # stops all runs at once
        _, interrupted = interruptible(BatchRun(batch, times, chosen, found), (len(rows[0]), number), stop)
        if interrupted:
            raise KeyboardInterrupt
        if batch.in_lanes and not chosen.integrator.linearises and not batch.system(0).scene.controllers:
            computed(batch.system(0), perf_counter() - start, BATCHES)
    made = _gathered(batch, times, found, len(rows[0]))
    for warning in _watched(made):
        warnings.warn(warning, SceneWarning, stacklevel=2)
    return made


def _watched(runs: BatchTrajectory) -> Iterator[str]:
    """What watches of accuracy say of the finished copies: of each body and each watch once, of the worst copy."""
    batch, done = runs.batch, np.flatnonzero(runs.status == OK)
    if not len(done) or all(link.is_rigid for link in batch.systems[0].links):
        return
    together = [done] if batch.shares_constants else [done[i : i + 1] for i in range(len(done))]
    found: dict[tuple[str, str], list[tuple[Said, int]]] = {}
    for copies in together:
        system = batch.system(int(copies[0]))
        t = np.tile(runs.t, len(copies))
        q, u = (each[copies].reshape(len(t), -1) for each in (runs.q, runs.u))
        turns = partial(_turns, system, t, q, u)
        for each in said(WatchedStates(system, t, q, u, turns)):
            found.setdefault((each.waiver, each.finding.body), []).append((each, int(copies[0])))
    for alike in found.values():
        worst, copy = max(alike, key=lambda each: each[0].finding.size)
        more = f" (copy {copy}, the worst of {len(alike)} copies like it)" if len(alike) > 1 else ""
        yield f'scene "{batch.systems[0].scene.name}": {worst}{more}'


def _turns(system: System, t: Real, q: Real, u: Real, n: int) -> Real:
    return system.turns(float(t[n]), q[n], u[n])


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


def _gathered(batch: Batch, times: Real, found: Runs, n: int) -> BatchTrajectory:
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
    )
