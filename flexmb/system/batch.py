"""Many copies of one system: accelerations of many states at once, in lanes and threads.

    batch = flexmb.compile_batch(scenes)     each copy with masses, lengths, stiffnesses ... of its own
    found = batch.accelerations(q, u)        (n,nq), (n,nu) -> (n,nu)

Copies of one system, which differ in their states only, are evaluated by `System.accelerations_batch`. A copy that
fails does not affect the others: where the lanes give no result, or a doubtful one, its own system evaluates it again.
"""

from __future__ import annotations

import os
import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from functools import cache
from typing import Any, NamedTuple, Protocol, cast

import numpy as np

from flexmb.entry import lanes
from flexmb.integrate.lane_problem import LaneEntries, LaneStages, lane_entries, lane_stages
from flexmb.jit.bundle import broaden
from flexmb.jit.direct import ADDRESS, address, addresses, settled
from flexmb.jit.lanes import LANES
from flexmb.jit.pointer import INDEX, MATRIX, STATUS, VECTOR, VOID, WHOLE
from flexmb.system.mechanics import Mechanics
from flexmb.tables import arguments
from flexmb.tables.arrays import Constants
from flexmb.tables.features import BATCHES
from flexmb.tables.lane_tables import LaneWorkspace, lane_constants, lane_workspace, structural_difference
from flexmb.tables.state import DynamicsError, State
from flexmb.tables.status import NONFINITE, OK, Status
from flexmb.typing import Index, Real

_WORTH_A_THREAD = 512  # copies per thread at least: fewer take no longer than a thread takes to start


class Copies(NamedTuple):
    """n states, and the accelerations and the status of each, which an evaluation writes."""

    q: Real  # (n,nq)
    u: Real  # (n,nu)
    t: Real  # (n,) s, or (1,) for all
    accelerations: Real  # (n,nu)
    status: Index  # (n,)


class LaneTables(NamedTuple):
    """The arrays that one thread writes: a workspace, stages in lanes and as floats; and the gate that uses them."""

    workspace: LaneWorkspace
    stages: LaneStages
    entries: LaneEntries
    gate: lanes.LaneGate


class BatchAccelerations(NamedTuple):
    """accelerations (n,nu), NaN where a copy has none; status (n,) gives the reason, as numbers of `flexmb.Status`."""

    accelerations: Real
    status: Index

    @property
    def statuses(self) -> tuple[Status, ...]:
        """The same by their names."""
        return tuple(map(Status, self.status.tolist()))

    @property
    def failed(self) -> Index:
        """Numbers of the copies that have no accelerations."""
        return np.flatnonzero(self.status != OK)


class OneSystem(Protocol):
    """What a copy is asked alone: `System`, which makes batches of itself."""

    def state(self, q: Real, u: Real, t: float = 0.0) -> State: ...
    def accelerations(self, state: State) -> Real: ...


class Batch:
    """Copies of equal structure (hinges, levels, modes, places of loads), whose physical parameters may differ.

    A batch starts threads of its own, and several threads may use one batch.

    `systems`: one for each copy, or a single one for any number of copies. ValueError where there is none, or where one
    has another structure than the first.
    """

    def __init__(self, systems: Sequence[Mechanics]) -> None:
        self.systems = listed("systems", systems)
        for i, system in enumerate(self.systems):
            if not isinstance(system, Mechanics):
                raise TypeError(f"systems[{i}] is a {type(system).__name__}: compile_batch makes a batch of scenes")
            _refuse_other_structure(i, system, self.systems[0])
        self.shares_constants = len(self.systems) == 1
        first = self.systems[0]
        self.layout, self.nq, self.nu = first.layout, first.nq, first.nu
        self.in_lanes = not first.scene.constraints
        self._constants: list[Constants] = [first.constants.fastest(BATCHES)]
        self._spare: list[LaneTables] = []
        if self.in_lanes and not self.shares_constants:
            blocks = blocks_of(self.systems)
            self._constants = [
                lane_constants([tables.constants.fastest(BATCHES) for tables in block]) for block in blocks
            ]
            broaden(self._constants)

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies and pickles hold the systems, which are made anew from their scenes."""
        return Batch, (self.systems,)

    def system(self, copy: int) -> Mechanics:
        """The system of a copy; ValueError or TypeError if there is no copy of this number."""
        place = arguments.index("copy", copy, sys.maxsize if self.shares_constants else len(self.systems))
        return self.systems[0 if self.shares_constants else place]

    @contextmanager
    def tables(self) -> Iterator[LaneTables]:
        """Tables for LANES copies, which no other thread has meanwhile. They are used again, because making them takes
        longer than evaluating a thousand copies."""
        tables = self._free_tables()
        yield tables
        self._spare.append(tables)

    def _free_tables(self) -> LaneTables:
        with suppress(IndexError):
            return self._spare.pop()
        w, s, c = lane_workspace(self.systems[0].workspace()), lane_stages(self.nq + self.nu + 1), self._constants[0]
        entries = lane_entries(s, w.doubt)
        rhs, stages, _, workspace = addresses(lanes.rhs, STATUS, s, c, w)
        begin = 0 if self.shares_constants else addresses(lanes.begin, VOID, c, w)[0]
        blocks = [address(constant) for constant in self._constants]
        return LaneTables(w, s, entries, lanes.lane_gate(s, entries, (rhs, begin, stages, workspace), blocks))

    def constants(self, block: int, w: LaneWorkspace) -> Constants:
        """The constants of the LANES copies of a block; prepares a workspace for them."""
        if self.shares_constants:
            return self._constants[0]
        c = self._constants[block]
        lanes.begin(c, w)
        return c

    def states(self, q: Any, u: Any) -> tuple[Real, Real]:
        """Coordinates (n,nq) and speeds (n,nu) of all copies, in C's order.

        ValueError or TypeError where they do not fit; entries that are not finite do.
        """
        q, u = self.rows("q", q), self.rows("u", u)
        if len(q) != len(u):
            raise ValueError(f"there are {len(q)} rows of q, but {len(u)} of u")
        return q, u

    def rows(self, name: str, x: Any) -> Real:
        """Coordinates (n,nq) or speeds (n,nu) alone; `name` is "q" or "u"."""
        found, size = arguments.array(name, x), self.nq if name == "q" else self.nu
        if found.ndim != 2 or found.shape[1] != size:
            raise ValueError(f"{name} has shape {found.shape}: give a row of {size} numbers for each copy")
        if not self.shares_constants and len(found) != len(self.systems):
            raise ValueError(f"the batch has {len(self.systems)} copies, but {name} has {len(found)} rows")
        return found

    def initial_states(self) -> tuple[Real, Real]:
        """Coordinates (n,nq) and speeds (n,nu) of the scenes at t = 0."""
        states = [system.initial_state for system in self.systems]
        return np.array([state.q for state in states]), np.array([state.u for state in states])

    def accelerations(self, q: Any, u: Any, t: Any = 0.0, *, threads: int | None = None) -> BatchAccelerations:
        """udot (n,nu) of all copies at coordinates q (n,nq), speeds u (n,nu) and times t (s), one or (n,).

        In lanes of eight copies each, whose modes are all eliminated explicitly, and in threads: by default as many as
        there are processors, if there is enough to do. A copy that has no accelerations, or whose state is not finite,
        gets NaN and a status; it raises nothing. Scenes with closures are evaluated one by one. Raises ValueError or
        TypeError for arrays that do not fit, and for one time for all that is not finite.
        """
        q, u = self.states(q, u)
        n = len(q)
        times = arguments.vector("t", t, n) if hasattr(t, "__len__") else np.array([arguments.number("t", t)])
        threads = number_of_threads(threads, n // _WORTH_A_THREAD)
        copies = Copies(q, u, times, np.empty((n, self.nu)), np.empty(n, np.int64))
        if self.in_lanes:
            missing = self._in_lanes(copies, threads)
        else:
            copies.status[:], missing = NONFINITE, n
        if missing:
            for copy in np.flatnonzero(copies.status != OK):
                self._alone(copies, int(copy))
        return BatchAccelerations(copies.accelerations, copies.status)

    def _in_lanes(self, copies: Copies, threads: int) -> int:
        """Returns the number of copies for which the lanes give no reliable result."""
        n = len(copies.q)
        if threads == 1:
            return self._on_one_thread(copies, 0, n)
        step, missing = LANES * -(-n // (threads * LANES)), list[int]()

        def work(starts: Iterable[int]) -> None:
            for start in starts:
                missing.append(self._on_one_thread(copies, start, min(start + step, n)))

        in_threads(work, range(0, n, max(step, LANES)), threads)
        return sum(missing)

    def _on_one_thread(self, copies: Copies, start: int, stop: int) -> int:
        tables = self._free_tables()
        missing = _entry()(address(tables.gate), start, stop, *copies)
        self._spare.append(tables)
        return int(missing)

    def _alone(self, copies: Copies, copy: int) -> None:
        """Evaluate a copy by its own system, where the lanes gave no reliable result."""
        system, found = cast(OneSystem, self.system(copy)), copies.accelerations[copy]
        try:
            t = copies.t[min(copy, len(copies.t) - 1)]
            alone = system.accelerations(system.state(copies.q[copy], copies.u[copy], t))
        except DynamicsError as error:
            copies.status[copy], found[:] = error.status, np.nan
            return
        except ValueError:  # not finite, or no orientation
            copies.status[copy], found[:] = NONFINITE, np.nan
            return
        copies.status[copy] = OK
        if not np.isfinite(found).all() or not self.in_lanes:
            found[:] = alone


@cache
def _entry() -> Any:
    """`lanes.accelerations`, compiled once for all batches."""
    return settled(lanes.accelerations, ADDRESS, WHOLE, WHOLE, MATRIX, MATRIX, VECTOR, MATRIX, INDEX)


def listed(name: str, given: Iterable[Any]) -> tuple[Any, ...]:
    """The items as a tuple; TypeError for anything that is not a collection, ValueError for an empty one."""
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise TypeError(f"{name} is a {type(given).__name__}: give a list, of one for each copy")
    values = tuple(given)
    if not values:
        raise ValueError(f"a batch needs at least one of {name}")
    return values


def _refuse_other_structure(i: int, system: Mechanics, first: Mechanics) -> None:
    if system.layout != first.layout:
        one, other = first.layout.q, system.layout.q
        strange = sorted(name for name in {**one, **other} if one.get(name) != other.get(name))
        raise ValueError(
            f"scene {i} has another structure than scene 0: they differ in the coordinates of {', '.join(strange[:3])}"
        )
    if system.scene.constraints or first.scene.constraints:
        if system.scene.constraints and first.scene.constraints:
            return
        raise ValueError(f"scene {i} has another structure than scene 0: only one of them has closures or couplings")
    difference = structural_difference(first.constants, system.constants)
    if difference is not None:
        raise ValueError(f"scene {i} has another structure than scene 0: they differ in {difference}")


def blocks_of(copies: Sequence[Any]) -> list[list[Any]]:
    """LANES copies each; the last block is filled up with the last copy."""
    padded = [*copies, *[copies[-1]] * (-len(copies) % LANES)]
    return [padded[start : start + LANES] for start in range(0, len(padded), LANES)]


def number_of_threads(asked: int | None, most: int) -> int:
    """The number asked for; by default one for each processor, but not more than `most`."""
    if asked is None:
        ours = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        return max(1, min(most, ours))
    threads = arguments.whole("threads", asked)
    if threads < 1:
        raise ValueError(f"threads is {threads}: at least one has to do the work")
    return threads


def in_threads(work: Callable[[Iterable[Any]], None], parts: Sequence[Any], threads: int) -> None:
    """Call work(iterator of parts) in each thread; each part goes to the thread that is ready first."""
    threads = min(threads, len(parts))
    if threads <= 1:
        work(parts)
        return
    waiting = deque(parts)
    with ThreadPoolExecutor(threads) as pool:
        for done in [pool.submit(work, _taken_from(waiting)) for _ in range(threads)]:
            done.result()


def _taken_from(waiting: deque[Any]) -> Iterator[Any]:
    """The items until none is left. `popleft` is atomic, so no two threads get the same item."""
    with suppress(IndexError):
        while True:
            yield waiting.popleft()
