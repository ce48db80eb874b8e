"""One smooth part of a run: its steps recorded forwards, then passed backwards by transposed stages."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import NamedTuple, Protocol

import numpy as np

from flexmb.integrate import recorded
from flexmb.integrate.control import COUNTS, EVALUATIONS, STOP
from flexmb.integrate.dop853_tableau import STAGES, A, C
from flexmb.integrate.problem import Clock, problem
from flexmb.integrate.settings import Settings
from flexmb.integrate.watch import nothing_watched
from flexmb.jit.direct import addresses
from flexmb.jit.pointer import REAL, STATUS, VECTOR, VOID
from flexmb.run.interruption import interruptible
from flexmb.run.outputs import ending
from flexmb.sensitivity.adjoint import stages
from flexmb.sensitivity.adjoint.transposes import Transposes
from flexmb.system.system import System
from flexmb.tables.state import DynamicsError
from flexmb.tables.status import OK, Status
from flexmb.typing import Index, Real

MEMORY = 2**27  # bytes of stages that are kept at once; and of states
AT_END = 3  # steps that are expected for each time at which one must end, beside ROOM
ROOM = 1000
ROWS_HOLD = 8
"""Steps for which the transposes keep the independent rows of closures; the run itself chooses them at each step."""


class Scheme(NamedTuple):
    """Tableau of an explicit Runge-Kutta method: a (S+1,S), whose last row are the weights, and nodes (S+1,)."""

    a: Real
    node: Real


SCHEMES = {
    "dop853": Scheme(np.ascontiguousarray(A[: STAGES + 1, :STAGES]), np.array(C[: STAGES + 1])),
    "rk4": Scheme(
        np.array([
            [0.0, 0.0, 0.0, 0.0],
            [0.5, 0.0, 0.0, 0.0],
            [0.0, 0.5, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0],
            [1 / 6, 1 / 3, 1 / 3, 1 / 6],
        ]),
        np.array([0.0, 0.5, 0.5, 1.0, 1.0]),
    ),
}  # fmt: skip


class StepCost(NamedTuple):
    """Evaluations of the right-hand side to record the steps, steps, states that are kept, and transposed stages."""

    evaluations: int
    steps: int
    checkpoints: int
    transposed: int

    def plus(self, other: StepCost) -> StepCost:
        """Of two parts of a run."""
        return StepCost(*(a + b for a, b in zip(self, other, strict=True)))


class IntegratedMotion(NamedTuple):
    """What is integrated. begin: prepares its tables for a run from their start, and returns the addresses of kernels
    and tables as in `RecordedSteps`. is_plain: whether it is the motion of the mechanics alone."""

    begin: Callable[[], Index]
    is_plain: bool


class Stops(Protocol):
    """Where a gradient that is carried backwards changes beside the steps."""

    times: Collection[float]
    """Where `visit` is called, s."""
    switches: Collection[float]
    """Those of them at which what controllers drive changes, s."""

    def visit(self, t: float, gradient: Real) -> None:
        """Change the gradient (n,) by the state after the time t (s) to that before it. Not at the start."""

    def held(self, t: float) -> Real | None:
        """What controllers drive from t (s) on; None where nothing is driven."""


class Plain:
    """The motion of the mechanics alone, with its own constants: a system as `Blocks` has it."""

    def __init__(self, system: System) -> None:
        self.system, self._route = system, system.route("articulated", 0.0)
        self.constants, self._workspace = self._route.tables()

    def addresses(self) -> Index:
        """Of kernels and tables, as in `RecordedSteps`."""
        given = self.constants, self._workspace
        moving = addresses(self._route.rhs, STATUS, REAL, VECTOR, VECTOR, *given)
        putting = addresses(self._route.project, VOID, REAL, VECTOR, self.constants)
        return np.array([moving[0], putting[0], *moving[1:]])

    def begin(self, t: float, y: Real) -> None:
        """A closed chain takes the rows of its closures that are independent at a state y (n,); a controlled run has
        integrated with another chain."""
        if self.system.closures is not None:
            self.system.closures.begin_in(self.constants, t, y)

    @property
    def fault(self) -> int:
        """Index of the item at which the last evaluation failed."""
        return int(self._workspace.fault[0])


class Arc:
    """The recorded steps of one part of a run.

    t (N+1,) s: the times of its steps; `ends` (s) are among them. y (n,): the state at its end.
    """

    def __init__(
        self, plain: Plain, motion: IntegratedMotion, start: tuple[Real, Clock], ends: Sequence[float],
        settings: Settings, steps: int,
    ) -> None:  # fmt: skip
        """Integrate from a state y (n,) by a clock. A step ends at each of `ends`, which increase from the start to the
        end. plain: the mechanics alone; motion: what is integrated; steps: how many are expected. DynamicsError where
        the run fails."""
        (y, clock), self._plain, self._settings = start, plain, settings
        method, fixed = settings.integrator, settings.integrator.fixed
        limits = clock.segment_ends if fixed else np.unique([*clock.segment_ends, *ends[1:]])
        clock = clock._replace(
            times=np.array(ends if fixed else [ends[0], ends[-1]]),
            segment_ends=limits if fixed else np.r_[limits, limits[-1]],
        )
        accuracy = settings.accuracy(plain.system.nq, plain.system.nu)
        room = steps + len(ends) * AT_END + ROOM
        while True:
            every = max(1, -(-room * len(y) * 8 // MEMORY)) if motion.is_plain else 1
            record = recorded.RecordedSteps(
                address=motion.begin(), every=np.array([every]), count=np.zeros(1, np.int64), time=np.zeros(room),
                state=np.zeros((-(-room // every), len(y))), fastest=recorded.nothing_fast(),
            )  # fmt: skip
            posed = problem(recorded.rhs, recorded.project, record, record)
            counts, out = np.zeros(COUNTS, np.int64), np.empty((len(clock.times), len(y)))
            given = y.copy(), clock, accuracy, out, counts, method.memory(len(y)), nothing_watched()
            run = method.entered(posed, *given)
            (status, t), interrupted = interruptible(
                lambda *given, run=run, posed=posed: run(posed, *given), given, counts[STOP : STOP + 1]
            )
            if interrupted:
                raise KeyboardInterrupt
            self._check(status, t)
            count = int(record.count[0])
            if count <= room:
                break
            room = count + 1
        self.t, self.y, self._record = record.time[:count].copy(), out[-1], record
        self._limit = np.isin(self.t, limits).astype(np.int64)
        per_step = SCHEMES[settings.method].a.shape[1]
        self.cost = StepCost(int(counts[EVALUATIONS]), count - 1, -(-count // every), (count - 1) * per_step)

    def _check(self, status: int, t: float) -> None:
        if status != OK:
            error = DynamicsError(
                f"the gradient's run {ending(self._plain.system, Status(status), self._plain.fault, t)}"
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
            self._plain.begin(float(self.t[first]), s.y)
            self._check(stages.forwards(first, i, s), float(self.t[first]))
            found.append(s.y.copy())
        return found

    def _stages(self, transposes: Transposes | None, room: int) -> stages.Stages:
        a, node = SCHEMES[self._settings.method]
        n, S = self._record.state.shape[1], a.shape[1]
        where = np.zeros(stages.ADDRESSES, np.int64)
        where[: recorded.ADDRESSES] = self._plain.addresses()
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

    def backwards(self, gradient: Real, transposes: Transposes, stops: Stops) -> Real:
        """The gradient (n,) by the state at its start, from that by the state at its end; stages leave that by
        parameters in the transposes."""
        every = int(self._record.every[0])
        n, S, last = self._record.state.shape[1], SCHEMES[self._settings.method].a.shape[1], len(self.t) - 1
        room = max(every, min(last, MEMORY // (8 * n * (S + 1))))
        room -= room % every
        s = self._stages(transposes, room)
        s.gradient[:] = gradient
        places = {int(np.searchsorted(self.t, t)) for t in stops.times}
        switches = {int(np.searchsorted(self.t, t)) for t in stops.switches}
        bounds = sorted({*range(0, last, room), *switches - {last}, last})
        held = transposes.held._replace(constants=[*transposes.held.constants, self._plain.constants])
        if last in places:
            stops.visit(float(self.t[last]), s.gradient)
        for first, stop in reversed(list(zip(bounds[:-1], bounds[1:], strict=True))):
            values = stops.held(float(self.t[first]))
            if values is not None:
                held.hold(values)
            s.y[:] = self._record.state[first // every]
            self._plain.begin(float(self.t[first]), s.y)
            self._check(stages.forwards(first, stop, s), float(self.t[first]))
            upper = stop
            for i in [*(i for i in range(stop - 1, first, -1) if i in places or i % ROWS_HOLD == 0), first]:
                transposes.choose(float(self.t[upper]), s.stage[upper - 1 - first, S])
                self._check(stages.backwards(first, i, upper, s), float(self.t[i]))
                upper = i
                if i in places and i > 0:
                    stops.visit(float(self.t[i]), s.gradient)
        return s.gradient.copy()
