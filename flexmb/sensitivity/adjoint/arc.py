"""One smooth part of a run: its steps recorded forwards, then passed backwards by transposed stages."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from flexmb.integrate.control import COUNTS, EVALUATIONS, STOP
from flexmb.integrate.dop853_tableau import STAGES, A, C
from flexmb.integrate.problem import Clock, problem
from flexmb.integrate.settings import Settings
from flexmb.jit.direct import address, addresses, undispatched
from flexmb.jit.pointer import REAL, STATUS, VECTOR, VOID
from flexmb.run.interruption import interruptible
from flexmb.run.outputs import ending
from flexmb.sensitivity.adjoint import recorded, stages
from flexmb.sensitivity.adjoint.transposes import Transposes
from flexmb.system.tree_system import System
from flexmb.tables.state import DynamicsError
from flexmb.tables.status import OK, Status
from flexmb.typing import Index, Real

MEMORY = 2**27  # bytes of stages that are kept at once; and of states
ROOM = 1.2  # times the steps of the run are expected, and for each instant at which a step must end AT_END more
AT_END = 3


class Scheme(NamedTuple):
    """Tableau of an explicit Runge-Kutta method: a (S+1,S), whose last row are the weights, and nodes (S+1,)."""

    a: Real
    node: Real


SCHEMES = {
    "dop853": Scheme(np.ascontiguousarray(A[: STAGES + 1, :STAGES]), np.array(C[: STAGES + 1])),
    "rk4": Scheme(
        np.array([[0.0] * 4, [0.5, 0.0, 0.0, 0.0], [0.0, 0.5, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [1 / 6, 1 / 3, 1 / 3, 1 / 6]]),
        np.array([0.0, 0.5, 0.5, 1.0, 1.0]),
    ),
}  # fmt: skip


class Cost(NamedTuple):
    """Evaluations of the right-hand side to record the steps, steps, states that are kept, and transposed stages."""

    evaluations: int
    steps: int
    checkpoints: int
    transposed: int

    def plus(self, other: Cost) -> Cost:
        """Of two parts of a run."""
        return Cost(*(a + b for a, b in zip(self, other, strict=True)))


class Arc:
    """The recorded steps of one part of a run.

    t (N+1,) s: the times of its steps; `ends` (s) are among them.
    """

    def __init__(self, system: System, y: Real, clock: Clock, ends: Sequence[float], settings: Settings) -> None:
        """Integrate from y (n,) at clock.times[0] to clock.times[-1]; a step ends at each of `ends`, which are increasing
        and include both. DynamicsError where the run fails."""
        self.system, self._settings, self._route = system, settings, system.route("articulated", 0.0)
        constants, self._workspace = self._route.tables()
        self._constants, self._moves = constants, (self._route.rhs, self._route.project)
        method, fixed = settings.integrator, settings.integrator.fixed
        limits = clock.segment_ends if fixed else np.unique([*clock.segment_ends, *ends[1:]])
        clock = clock._replace(
            times=np.array(ends if fixed else [ends[0], ends[-1]]),
            segment_ends=limits if fixed else np.r_[limits, limits[-1]],
        )
        accuracy = settings.accuracy(system.nq, system.nu)
        posed, room = None, len(ends) * AT_END + 1000
        while True:
            where = self._addresses(y)
            every = max(1, -(-room * len(y) * 8 // MEMORY))
            self._record = recorded.Recorded(
                address=where, every=np.array([every]), count=np.zeros(1, np.int64), time=np.zeros(room),
                state=np.zeros((-(-room // every), len(y))),
            )  # fmt: skip
            posed = problem(recorded.rhs, recorded.project, self._record, self._record)
            counts, out = np.zeros(COUNTS, np.int64), np.empty((len(clock.times), len(y)))
            given = y.copy(), clock, accuracy, out, counts, method.memory(len(y)), None
            run = undispatched(method.run, posed, *given)
            (status, t), interrupted = interruptible(
                lambda *given, run=run, posed=posed: run(posed, *given), given, counts[STOP : STOP + 1]
            )
            if interrupted:
                raise KeyboardInterrupt
            self._check(status, t)
            count = int(self._record.count[0])
            if count <= room:
                break
            room = count + 1
        self.t = self._record.time[:count].copy()
        self._limit = np.isin(self.t, limits).astype(np.int64)
        self.y = out[-1]
        steps = count - 1
        stages_a_step = SCHEMES[settings.method].a.shape[1]
        self.cost = Cost(int(counts[EVALUATIONS]), steps, -(-count // every), steps * stages_a_step)

    def _addresses(self, y: Real) -> Index:
        rhs, project = self._moves
        moving = addresses(rhs, STATUS, REAL, VECTOR, VECTOR, self._constants, self._workspace)
        putting = addresses(project, VOID, REAL, VECTOR, self._constants)
        return np.array([moving[0], putting[0], address(self._constants), address(self._workspace)])

    def _check(self, status: int, t: float) -> None:
        if status != OK:
            error = DynamicsError(
                f"the gradient's run {ending(self.system, Status(status), int(self._workspace.fault[0]), t)}"
            )
            error.status = Status(status)
            raise error

    def states_at(self, times: Sequence[float]) -> list[Real]:
        """The states (n,) at some of the ends of its steps, increasing."""
        found, wanted = [], [int(np.searchsorted(self.t, t)) for t in times]
        every = int(self._record.every[0])
        if every == 1:
            return [self._record.state[i].copy() for i in wanted]
        s = self._stages(None, every)
        for i in wanted:
            first = i // every * every
            s.y[:] = self._record.state[i // every]
            self._check(stages.forwards(first, i, s), float(self.t[first]))
            found.append(s.y.copy())
        return found

    def _stages(self, transposes: Transposes | None, room: int) -> stages.Stages:
        a, node = SCHEMES[self._settings.method]
        n, S = self._record.state.shape[1], a.shape[1]
        where = np.zeros(stages.ADDRESSES, np.int64)
        where[: recorded.ADDRESSES] = self._record.address
        if transposes is not None:
            tables = transposes.tables
            where[stages.TRANSPOSE], where[stages.TABLES] = addresses(
                transposes.transpose, STATUS, REAL, VECTOR, VECTOR, VECTOR, tables
            )
            where[stages.UNPROJECT] = addresses(transposes.unproject, VOID, REAL, VECTOR, VECTOR, tables)[0]
        return stages.Stages(
            address=where, a=a, node=node, time=self.t, limit=self._limit, y=np.zeros(n), k=np.zeros((S, n)),
            stage=np.zeros((room, S + 1, n)), gradient=np.zeros(n), pull=np.zeros(n), moved=np.zeros((S, n)),
        )  # fmt: skip

    def backwards(
        self, gradient: Real, transposes: Transposes, at: Callable[[float], Real | None]
    ) -> tuple[Real, Real]:
        """The gradient (n,) by the state at its start, from that by the state at its end, and what `at` added (D,).

        at: the gradient (D,) that the scalar adds at the time of a step, whose last entries are those of the state; None
        for most. It is not asked at the start. What stages leave to parameters is in the tables of the transposes.
        """
        every = int(self._record.every[0])
        n, S = self._record.state.shape[1], SCHEMES[self._settings.method].a.shape[1]
        room = max(every, min(len(self.t), MEMORY // (8 * n * (S + 1))))
        room -= room % every
        s = self._stages(transposes, room)
        s.gradient[:] = gradient
        last = len(self.t) - 1
        rest: Real = np.zeros(1)
        breaks = [i for i in range(1, last + 1) if at(float(self.t[i])) is not None]
        for first in range((last - 1) // room * room, -1, -room) if last else []:
            stop = min(first + room, last)
            s.y[:] = self._record.state[first // every]
            self._check(stages.forwards(first, stop, s), float(self.t[first]))
            upper = stop
            for i in [i for i in breaks[::-1] if first < i <= stop]:
                self._passed(s, first, i, upper)
                added = at(float(self.t[i]))
                assert added is not None
                s.gradient[:] += added[-n:]
                rest = rest + added
                upper = i
            self._passed(s, first, first, upper)
        return s.gradient.copy(), rest

    def _passed(self, s: stages.Stages, base: int, lower: int, upper: int) -> None:
        """Steps `lower` .. `upper`, whose stages are known from step `base` on."""
        self._check(stages.backwards(base, lower, upper, s), float(self.t[lower]))
