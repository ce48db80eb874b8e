"""Runs of a batch, in threads: in SIMD lanes if the method and the scenes allow it, otherwise copy by copy."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np

from flexmb.control.wiring import wired
from flexmb.entry import lanes
from flexmb.integrate.control import ACCEPTED, COUNTS, EVALUATIONS, REJECTED, SAMPLES, STOP
from flexmb.integrate.dop853_lanes import dop853_lanes
from flexmb.integrate.integrator import Integrator
from flexmb.integrate.lane_control import LaneControl, lane_control
from flexmb.integrate.lane_problem import first_derivative, lane_problem
from flexmb.integrate.problem import Accuracy, Clock
from flexmb.integrate.recorded import (
    FastestStates,
    RecordedLanes,
    RecordedSteps,
    fastest_states,
    record_of_lanes,
    recorded,
    recorded_lanes,
)
from flexmb.integrate.rk4_lanes import rk4_lanes
from flexmb.integrate.settings import Settings
from flexmb.integrate.watch import nothing_watched
from flexmb.jit.lanes import LANES
from flexmb.jit.pointer import Pointer
from flexmb.run.event_record import EventRecord
from flexmb.run.interruption import Interrupted, Stop
from flexmb.run.propagate import NO_STATES, PARTS, Integration, kept_for_watches, recursion, room_for
from flexmb.run.simulate import Made, run_of_many
from flexmb.run.times import segment_ends
from flexmb.scene.sticking import any_sticks
from flexmb.system import algorithms
from flexmb.system.batch import Batch, LaneTables, in_threads
from flexmb.system.system import System
from flexmb.tables.arrays import Constants
from flexmb.tables.state import DynamicsError
from flexmb.tables.status import CLOSURE_OPEN, INTERRUPTED, MAX_STEPS, NONFINITE, NOT_POSITIVE_DEFINITE, OK
from flexmb.typing import Index, Real

if TYPE_CHECKING:
    from flexmb.system.level_range import TooFast

_IN_LANES = ("rk4", "dop853")
_DECIDED = (OK, MAX_STEPS, INTERRUPTED)  # statuses of lanes that are final; other copies are run again one by one
_NOT_YET = -1
_Each = TypeVar("_Each")


class Runs(NamedTuple):
    """Results of N runs: the n copies of a batch, the last one repeated until N is a multiple of LANES."""

    y: Real  # (N,nq+nu+1) initial states
    out: Real  # (N,T,nq+nu+1)
    counts: Index  # (N,COUNTS)
    status: Index  # (N,)
    fault: Index  # (N,)
    stopped_at: Real  # (N,)


def runs(q: Real, u: Real, samples: int) -> Runs:
    """Arrays for the runs of copies with initial states q (n,nq), u (n,nu)."""
    n = len(q) + -len(q) % LANES
    y = np.concatenate([q, u, np.zeros((len(q), 1))], axis=1)
    y = np.concatenate([y, np.repeat(y[-1:], n - len(q), axis=0)])
    zeros = np.zeros(n, np.int64)
    return Runs(
        y, np.full((n, samples, y.shape[1]), np.nan), np.zeros((n, COUNTS), np.int64), zeros + _NOT_YET, zeros.copy(),
        np.zeros(n),
    )  # fmt: skip


class BatchRun:
    """Runs of the copies of a batch by one method.

    turned: by copy that has reached its end, which bodies turned too fast for their level at any step; bent: states
    (K,1+nq+nu), see `flexmb.run.propagate.Raw`, in which its beams of level exact may have bent too far. whole: what
    else came of copies of scenes with events or controllers. stop: asks all runs to return soon.
    """

    def __init__(self, batch: Batch, times: Real, settings: Settings, found: Runs) -> None:
        self._batch, self._times, self._settings, self._found = batch, times, settings, found
        self.turned: dict[int, list[TooFast]] = {}
        self.bent: dict[int, Real] = {}
        self.whole: dict[int, WholeRun] = {}
        self.stop = Stop(found.counts[:, STOP])
        self._kept = [kept_for_watches(system) for system in batch.systems]
        self._strained = len(batch.systems[0].constants.section) > 0
        fixed = settings.integrator.fixed
        self._ends = [segment_ends(system, times[0], times[-1], fixed) for system in batch.systems]

    def __call__(self, n: int, threads: int) -> None:
        """Run the first n copies."""
        scene = self._batch.systems[0].scene
        if scene.events or scene.controllers or any_sticks(scene):
            calls_python = bool(scene.controllers) and bool(wired(self._batch.systems[0]).laws)
            in_threads(self._by_themselves, range(n), 1 if calls_python else threads)
            return
        in_lanes = self._batch.in_lanes and self._settings.method in _IN_LANES
        blocks = list(range(0, n, LANES)) if in_lanes else []
        if blocks:
            in_threads(self._in_lanes, blocks, threads)
            self.turned = {copy: found for copy, found in self.turned.items() if copy < n}  # the last one fills a block
        left = [copy for copy in range(n) if self._found.status[copy] == _NOT_YET]
        in_threads(self._alone, left, threads if self._batch.in_lanes else 1)

    @staticmethod
    def _block_of(of_systems: Sequence[_Each], first: int) -> list[_Each]:
        """What belongs to the systems of a block of copies."""
        last = len(of_systems) - 1
        return [of_systems[min(first + lane, last)] for lane in range(LANES)]

    def _copies_ends(self, copies: Sequence[int]) -> list[Real]:
        """Segment ends (s) of each of these copies."""
        last = len(self._ends) - 1
        return [self._ends[min(copy, last)] for copy in copies]

    def _in_lanes(self, firsts: Iterable[int]) -> None:
        with self._batch.tables() as tables:
            watched = [each for each in self._kept if each is not None]
            record = None
            if watched:  # a larger weight keeps more states than are needed
                heaviest = np.max([each.weights for each in watched], axis=0)
                fastest = fastest_states(heaviest, np.full((LANES, len(heaviest)), np.inf), PARTS)
                record = record_of_lanes(tables.stages, tables.entries, fastest)
            for first in firsts:
                self._block(first, tables, record)

    def _block(self, first: int, tables: LaneTables, record: tuple[RecordedLanes, Pointer] | None) -> None:
        """Run LANES copies at once; those that end with a status that is not in _DECIDED are left for single runs."""
        w, s, entries, _ = tables
        place = slice(first, first + LANES)
        runs = Runs(*(part[place] for part in self._found))
        ends = self._copies_ends(range(first, first + LANES))
        s.y[...] = runs.y.T
        constants = self._batch.constants(first // LANES, w)
        problem = lane_problem(lanes.rhs, lanes.project, s, constants, w)
        if record is not None:
            fastest = record[0].fastest
            for lane, kept in enumerate(self._block_of(self._kept, first)):
                fastest.slow[lane] = np.inf if kept is None else kept.slow
            problem = recorded_lanes(problem, record, self._times)
        if first_derivative(problem, s, entries, self._times[0], runs.counts) != OK or w.doubt[0]:
            self._examine(first, runs.status)
        accuracy = self._settings.accuracy(self._batch.nq, self._batch.nu)
        if self._settings.method == "dop853":
            ends = [np.unique(end) for end in ends]
            most = max(map(len, ends))
            padded = np.array([[*end, *[end[-1]] * (most - len(end))] for end in ends])
            lengths = np.array(list(map(len, ends)))
            control: LaneControl = lane_control(lengths)
            clock = Clock(self._times, padded)
            dop853_lanes(problem, s, entries, control, clock, accuracy, runs.out, runs.counts)
            status, stopped_at = control.status, control.t
        else:
            if any(len(end) != len(ends[0]) or np.any(end != ends[0]) for end in ends):
                return
            end, t = rk4_lanes(problem, s, entries, Clock(self._times, ends[0]), accuracy, runs.out, runs.counts)
            status = np.where(np.isfinite(s.y).all(axis=0), end, _NOT_YET)
            stopped_at = np.full(LANES, t)
        for lane in np.flatnonzero((runs.status == _NOT_YET) & np.isin(status, _DECIDED)):
            runs.status[lane], runs.stopped_at[lane] = status[lane], stopped_at[lane]
        if record is not None and not np.isnan(fastest.state[..., 0]).all():
            self._look_at(first, tables, constants, fastest)

    def _look_at(self, first: int, tables: LaneTables, constants: Constants, fastest: FastestStates) -> None:
        """Which bodies of LANES copies turned too fast, by the velocities that a right-hand side leaves."""
        from flexmb.system.level_range import of_runs, weights  # imported here as many scenes have no flexible bodies

        w, s, entries, _ = tables
        systems = self._block_of(self._batch.systems, first)
        ended = self._found.status[first : first + LANES] == OK
        if self._strained:
            self.bent.update({first + lane: fastest.of_run(lane) for lane in np.flatnonzero(ended)})
        states = fastest.state.reshape(LANES, -1, fastest.state.shape[3])
        u = np.where(ended[:, None, None], np.nan_to_num(np.abs(states[:, :, 1 + self._batch.nq :])), 0.0)
        watched = np.isfinite(fastest.slow[:, 0, None])
        size = np.einsum("rku,ru->rk", u, np.where(watched, [weights(system) for system in systems], 0.0))
        order = np.argsort(-size, axis=1, kind="stable")
        states = np.take_along_axis(states, order[:, :, None], axis=1)
        t = np.where(np.isnan(states[:, :, 0]), self._times[0], states[:, :, 0])

        def turns(n: int) -> Real:
            entries.time[0], entries.trial[:-1], s.stage[0] = t[:, n], states[:, n, 1:].T, 0
            lanes.rhs(s, constants, w)
            return np.moveaxis(w.body["velocity"][:, :3], -1, 0)

        for lane, found in enumerate(of_runs(systems, t, np.take_along_axis(size, order, axis=1), turns)):
            if found:
                self.turned[first + lane] = found

    def _examine(self, first: int, status: Index) -> None:
        """Set the status of copies that cannot run, because an inertia is not positive definite at the start."""
        for lane in range(LANES):
            copy = min(first + lane, len(self._batch.systems) - 1)
            system = self._batch.systems[copy]
            y = self._found.y[first + lane]
            if np.isfinite(y).all():
                try:
                    precision = system.precision(system.state(y[: system.nq], y[system.nq : -1]))
                except (ValueError, DynamicsError):  # a zero quaternion, or overflow
                    status[lane] = NONFINITE
                    continue
                if precision.status != OK:
                    status[lane], self._found.fault[first + lane] = NOT_POSITIVE_DEFINITE, precision.fault

    def _alone(self, copies: Iterable[int]) -> None:
        """Run copies one after the other, each with its own system."""
        found, accuracy = self._found, self._settings.accuracy(self._batch.nq, self._batch.nu)
        last, solve = None, None
        for copy in copies:
            system = self._batch.system(copy)
            if solve is None or system is not last or system.scene.constraints:  # closed chains store their branch
                last, solve = system, Alone(system, self._settings.integrator)
            [ends] = self._copies_ends([copy])
            found.counts[copy, :STOP], found.out[copy] = 0, np.nan
            clock, out, counts = Clock(self._times, ends), found.out[copy], found.counts[copy]
            status, t = solve(found.y[copy].copy(), clock, accuracy, out, counts)
            found.status[copy], found.stopped_at[copy], found.fault[copy] = status, t, solve.fault
            if status == OK and len(solve.fastest):
                self.bent[copy] = solve.fastest
                if "level_range" not in system.scene.allow and (turned := _too_fast(system, solve.fastest)):
                    self.turned[copy] = turned

    def _by_themselves(self, copies: Iterable[int]) -> None:
        """Run copies as `simulate` does: events end the segments of one copy, laws have own states."""
        found, n = self._found, self._batch.nq
        with self.stop.covering():
            for copy in copies:
                system, y = self._batch.system(copy), found.y[copy]
                try:
                    state = system.state(y[:n], y[n:-1])
                except ValueError as error:  # numbers that are not finite, or a zero quaternion
                    found.status[copy], self.whole[copy] = NONFINITE, WholeRun(str(error), (), {}, ())
                    continue
                try:
                    made = run_of_many(system, self._times, self._settings, "articulated", state)
                except Interrupted:
                    found.status[copy] = INTERRUPTED
                    return
                except DynamicsError as error:  # of this copy's start
                    found.status[copy], self.whole[copy] = int(error.status), WholeRun(str(error), (), {}, ())
                    continue
                except ValueError as error:  # its start does not close the closures
                    if not system.scene.constraints:
                        raise
                    found.status[copy], self.whole[copy] = CLOSURE_OPEN, WholeRun(str(error), (), {}, ())
                    continue
                self._take(copy, system, made)

    def _take(self, copy: int, system: System, made: Made) -> None:
        """Keep what such a run came to: at each output time the last row, which is after events at that time."""
        run, found, cost = made.trajectory, self._found, made.trajectory.statistics
        reached = (
            self._times[: np.searchsorted(self._times, run.t[-1], side="right")] if len(run.t) else self._times[:0]
        )
        rows = np.searchsorted(run.t, reached, side="right") - 1
        found.out[copy, : len(rows)] = np.column_stack([run.q, run.u, run.work])[rows]
        counts = found.counts[copy]
        counts[SAMPLES], counts[EVALUATIONS] = len(rows), cost.evaluations
        counts[ACCEPTED], counts[REJECTED] = cost.accepted_steps, cost.rejected_steps
        found.status[copy], found.stopped_at[copy] = int(run.status), run.stopped_at
        doubts = tuple(str(warning) for warning in made.warned)
        signals = {name: values[rows] for name, values in run.signals.items()}
        self.whole[copy] = WholeRun(run.message, run.events, signals, doubts)
        if made.fastest and run.finished:
            self.bent[copy] = np.vstack(made.fastest)
            if "level_range" not in system.scene.allow and (turned := _too_fast(system, self.bent[copy])):
                self.turned[copy] = turned


class WholeRun(NamedTuple):
    """How the run of a copy ended, in words; its events; signals (T,k) by name; what its events made
    doubtful."""

    message: str
    events: tuple[EventRecord, ...]
    signals: Mapping[str, Real]
    doubts: tuple[str, ...]


def _too_fast(system: System, states: Real) -> list[TooFast]:
    """By the fastest states (K,1+nq+nu) of a run."""
    from flexmb.system.level_range import too_fast  # imported here as many scenes have no flexible bodies

    t, q, u = states[:, 0], states[:, 1 : 1 + system.nq], states[:, 1 + system.nq :]
    return list(too_fast(system, t, u, lambda n: system.turns(float(t[n]), q[n], u[n])))


class Alone:
    """Single runs of copies of one system without controllers."""

    def __init__(self, system: System, method: Integrator) -> None:
        self._method = method
        self._whole: Integration | None = None
        if system.scene.constraints or method.linearises:
            self._whole = Integration(system, algorithms.chosen("articulated"), system.route(), method)
        else:  # all modes are eliminated explicitly, as in lanes, so that both give the same results
            self._workspace = system.workspace()
            self._problem = recursion(system.constants, self._workspace)
            self._record: RecordedSteps | None = None
            if (kept := kept_for_watches(system)) is not None:
                self._problem, self._record = recorded(self._problem, 0, room_for(kept))

    def __call__(self, y: Real, clock: Clock, accuracy: Accuracy, out: Real, counts: Index) -> tuple[int, float]:
        """See `Integrator`."""
        whole, memory, watch = self._whole, self._method.memory, nothing_watched()
        if whole is None:
            if self._record is not None:
                self._record.fastest.begin(clock.times)
            return self._method.run(self._problem, y, clock, accuracy, out, counts, memory(len(y)), watch)
        return whole(y, clock, accuracy, out, counts, memory(len(y)), watch)

    @property
    def fastest(self) -> Real:
        """States of the last run: see `flexmb.run.propagate.Raw`."""
        if self._whole is not None:
            return self._whole.fastest
        return NO_STATES if self._record is None else self._record.fastest.of_run(0)

    @property
    def fault(self) -> int:
        """Where an evaluation failed."""
        return int(self._workspace.fault[0]) if self._whole is None else self._whole.fault
