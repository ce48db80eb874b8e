"""Compiled runs: the integrators applied to the equations of motion."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from copy import copy
from time import perf_counter
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from flexmb.entry import articulated
from flexmb.integrate.control import ACCEPTED, COUNTS, REJECTED, SAMPLES, STOP
from flexmb.integrate.integrator import Integrator
from flexmb.integrate.memory import Memory, memory
from flexmb.integrate.problem import Accuracy, Clock, Linear, Problem, problem, stiff_problem
from flexmb.integrate.recorded import FastestStates, RecordedSteps, fastest_states, recorded, watching
from flexmb.integrate.settings import Settings
from flexmb.integrate.watch import CROSSED, Watch, nothing_watched
from flexmb.motion import coordinates
from flexmb.run.interruption import interruptible, is_handed_over
from flexmb.run.observing import Sampler, batch
from flexmb.run.origin import Beginning
from flexmb.run.restart import refuse_other_division
from flexmb.run.times import clock_of
from flexmb.scene.tree import watches_signals
from flexmb.system import algorithms
from flexmb.system.algorithm import Algorithm, DynamicsAlgorithm, Route
from flexmb.system.system import System
from flexmb.tables.arrays import Constants
from flexmb.tables.status import OK, Status
from flexmb.typing import Index, Real

if TYPE_CHECKING:
    from flexmb.control.feedback import Feedback
    from flexmb.control.schedule import LoopMemory
    from flexmb.system.watches import StatesToKeep


NO_STATES: Real = np.zeros((0, 0))


class Tempo(NamedTuple):
    """What the last run by an integration took for each second of its motion: seconds, and steps."""

    seconds: float
    steps: float


Integrated = tuple[Real, Clock, Accuracy, Real, Index, Memory, Watch]
"""What an integrator takes after its problem."""
TINY = float(np.finfo(float).tiny)
PARTS = 32
"""Of a run's time, in each of which watches of accuracy look at the states that turn and that bend most."""
SHORT = 0.005
"""s that a run may take, by the last one of its kind, and still be integrated in the caller's thread: to hand it over
to another one takes 0.15 ms, and a person cannot tell whether Ctrl-C waited for so short a time."""
FEW_MORE = 20
"""Steps that such a run may take beyond twice those of the last one."""


class Raw(NamedTuple):
    """The result of an integrator: states (T, nq+nu+1) at the samples reached, why and when it stopped, its cost.

    y (n,): the last good state; memory, controllers: what is needed to resume there, None if a leap passed the end;
    paused: whether it stopped at the level of an event; fastest (K,1+nq+nu): t (s), q and u of states in which bodies
    may have turned or bent more than their models describe.
    """

    states: Real
    status: Status
    fault: int
    t: float
    counts: list[int]
    compile_s: float
    run_s: float
    interrupted: bool
    y: Real
    memory: Memory | None
    paused: bool = False
    controllers: LoopMemory | None = None
    fastest: Real = NO_STATES


def recursion(constants: Constants, workspace: Any) -> Problem:
    """The equations of motion by the O(N) recursion."""
    return problem(articulated.rhs, coordinates.project, constants, workspace)


def kept_for_watches(system: System) -> StatesToKeep | None:
    """By which states at ends of steps the watches of accuracy look at a run; None if at none."""
    if system.is_rigid:
        return None
    from flexmb.system.watches import states_to_keep  # imported here as many scenes have no flexible bodies

    return states_to_keep(system)


def room_for(kept: StatesToKeep) -> FastestStates:
    """Of one run."""
    return fastest_states(kept.weights, kept.slow[None].copy(), PARTS)


class Integration:
    """An integrator with its own problem and workspace, ready to be called."""

    def __init__(self, system: System, algorithm: DynamicsAlgorithm, route: Route, integrator: Integrator) -> None:
        tables = route.tables if integrator.linearises else route.explicit or route.tables
        constants, self._workspace = tables()
        self.system, self._integrator = system, integrator
        self.feedback: Feedback | None = None
        """The closed loop of a scene with controllers, or with events that watch signals."""
        if system.scene.controllers or watches_signals(system.scene):
            from flexmb.control.feedback import Feedback  # imported here because few scenes need it

            self.feedback = Feedback(system, algorithm, route, (constants, self._workspace))
        self._linear: Linear | None = None
        motion = route.rhs, route.project, constants, self._workspace
        if integrator.linearises:
            assert route.linear is not None  # `refuse_without_jacobian` has checked this
            self._linear = route.linear(constants, self._workspace)
            self._problem: Any = stiff_problem(*motion, self._linear, route.leaping)
            if self.feedback is not None:
                self.feedback.with_retraction(self._linear)
        else:
            self._problem = problem(*motion, route.leaping)
        self._leaping, self._constants = route.leaping, constants
        if integrator.fixed and route.leaping is not None:
            route.leaping.watch_steps(constants, not integrator.linearises)
        self.batch: Sampler | None = None
        """Evaluates the outputs of many samples at once, in compiled code."""
        self._batched = algorithm.observing is not None and not system.scene.constraints
        if self._batched and self.feedback is None:
            moving = route.rhs, constants, self._workspace
            self.batch = batch(system, moving, algorithm.observing, system.nq + system.nu + 1)
        self._enter: Any = None  # the compiled integrator
        self._kept = kept_for_watches(system)
        self._posed, self._record = self._recording()
        self._remembered = list(route.remembered(constants))
        self._at_first = [array.copy() for array in self._remembered]
        self._tempo = Tempo(np.inf, np.inf)

    @property
    def size(self) -> int:
        """Size of the state that is integrated, [q, u, work] or, with the states of controllers, [q, u, x, work]."""
        controlled = 0 if self.feedback is None else len(self.feedback.state_names)
        return self.system.nq + self.system.nu + controlled + 1

    def __call__(self, *given: Any) -> tuple[int, float]:
        """Integrate: (y, clock, accuracy, out, counts, memory, watch) of `Integrator`, all arrays in C order."""
        self.compile(*given)
        if self._record is not None:
            self._record.fastest.begin(given[1].times)
        return self._enter(self._posed, *given)

    def run(self, given: Integrated, once: bool) -> tuple[tuple[int, float], bool]:
        """The status and time of an integration, compiled before, and whether Ctrl-C ended it; once: whether it cannot
        begin anew, as its watch or the memory of an earlier run changes on the way, like that of controllers.

        A run that is expected to be short, by the one before, is not handed over to another thread, but has a bound of
        its steps. If it reaches that bound, or Ctrl-C is pressed meanwhile, it begins anew in the other thread.
        """
        y, clock, accuracy, out, counts, memory, watch = given
        span, is_stopped = max(float(clock.times[-1] - clock.times[0]), TINY), False
        if self._tempo.seconds * span <= SHORT and not once and self.feedback is None and is_handed_over():
            few = accuracy._replace(max_steps=min(accuracy.max_steps, FEW_MORE + int(2.0 * self._tempo.steps * span)))
            changing = y, *self._remembered
            before, begun = [array.copy() for array in changing], perf_counter()
            try:
                found = self(y, clock, few, out, counts, memory, watch)
            except KeyboardInterrupt:
                is_stopped = True
            else:
                if found[0] != Status.MAX_STEPS or few.max_steps == accuracy.max_steps:
                    self._keep_tempo(perf_counter() - begun, counts, span)
                    return found, False
            for array, was in zip((*changing, counts, *memory), (*before, *[0] * (1 + len(memory))), strict=True):
                array[...] = was
            counts[STOP] = is_stopped
        begun = perf_counter()
        found, interrupted = interruptible(self, given, counts[STOP : STOP + 1])
        self._keep_tempo(perf_counter() - begun, counts, span)
        return found, interrupted or is_stopped

    def _keep_tempo(self, seconds: float, counts: Index, span: float) -> None:
        self._tempo = Tempo(seconds / span, float(counts[ACCEPTED] + counts[REJECTED]) / span)

    def watching(self, watch: Watch) -> Watch:
        """The same watch with access to the signals of a run that has begun."""
        assert self.feedback is not None  # events watch signals
        seen = self.feedback.watching(watch)
        return seen if self._record is None else watching(self._record, seen)

    def _recording(self) -> tuple[Any, RecordedSteps | None]:
        """The problem; if watches of accuracy look at ends of steps it keeps those that turn or bend most."""
        if self._kept is None:
            return self._problem, None
        return recorded(self._problem, 0, room_for(self._kept))

    @property
    def fastest(self) -> Real:
        """Of what was integrated last: see `Raw`."""
        if self._record is None:
            return NO_STATES
        return self._record.fastest.of_run(0)

    def forget(self) -> None:
        """Restore the initial state: closed chains store the branch that they are on."""
        for array, at_first in zip(self._remembered, self._at_first, strict=True):
            array[...] = at_first

    def compile(self, *given: Any) -> None:
        """Compile for a call with these arguments, unless that has been done."""
        if self._enter is None:
            self._enter = self._integrator.entered(self._posed, *given)

    def begin(self, begin: Beginning, clock: Clock, accuracy: Accuracy, counts: Index) -> tuple[Real, Clock, Accuracy]:
        """State, clock and accuracy of a run; for a scene with controllers, those of the closed loop."""
        if self.feedback is None:
            return begin.y, clock, accuracy
        self._problem, y, clock, accuracy = self.feedback.begin(begin, clock, accuracy, self._linear)
        self._posed, self._record = self._recording()
        if self._batched:
            self._batch_outputs(len(y))
        self.feedback.heed(counts[STOP : STOP + 1])
        return y, clock, accuracy

    def ended(self, acting: tuple[float, Real] | None) -> LoopMemory | None:
        """The memory of controllers at the end of an integration, whose outputs can be evaluated from now on. Raises
        exceptions of controllers.

        acting: time (s) and state at the end of the run, where sampled controllers may be due; None if the run goes on.
        """
        if self.feedback is None:
            return None
        self.feedback.raise_trouble()
        if acting is not None and self.feedback.conclude(*acting) and self._batched:
            self._batch_outputs(len(acting[1]))
        known = self.feedback.remember()
        self.feedback.replay()
        return known

    def recorded(self, room: int) -> tuple[Any, RecordedSteps]:
        """The problem that `begin` has posed, with a record of so many steps."""
        return recorded(self._problem, room)

    def _batch_outputs(self, n: int) -> None:
        assert self.feedback is not None
        self.batch = batch(self.feedback, self.feedback.motion, self.feedback.observing, n)

    @property
    def noticed(self) -> tuple[float, int] | None:
        """Where steps were too long for a singular position, if the run did not fail there: see `Leaping.noticed`."""
        return None if self._leaping is None else self._leaping.noticed(self._constants)

    @property
    def fault(self) -> int:
        """Index of the item at which an evaluation failed."""
        return int(self._workspace.fault[0])


@contextmanager
def integration(
    system: System, algorithm: Algorithm, stabilise: float, integrator: Integrator
) -> Iterator[Integration]:
    """An integration for exclusive use within the context; it is kept for the next run.

    Raises what `System.route` raises for an invalid combination of arguments.
    """
    route = system.route(algorithm, stabilise)
    spare: list[Integration] = system.kept.setdefault((Integration, algorithm, integrator.name, route.beginning), [])
    try:
        record = spare.pop()
        record.forget()
    except IndexError:
        if system.scene.controllers:  # they write into functions of time, so the system must not be shared
            system = copy(system)
            route = system.route(algorithm, stabilise)
        record = Integration(system, algorithms.chosen(algorithm), route, integrator)
    yield record
    spare.append(record)


def unmoved(begin: Beginning, status: Status = Status.OK, fault: int = 0) -> Raw:
    """The result of an integration that ends where it begins."""
    nothing = np.empty((0, len(begin.y)))
    return Raw(
        nothing, status, fault, begin.state.t, [0] * COUNTS, 0.0, 0.0, interrupted=False, y=begin.y,
        memory=memory(len(begin.y), 0),
    )  # fmt: skip


def integrate(
    solve: Integration, begin: Beginning, times: Real, settings: Settings, watch: Watch | None = None,
    breaks: bool = False, goes_on: bool = False,
) -> Raw:  # fmt: skip
    """Integrate over times (T,) s, compiling first if necessary.

    breaks: an event is due at the end, so that methods of equal steps must end a step there, and no leap may pass it.
    goes_on: the run continues after this segment, so that sampled controllers do not act at its end yet.
    """
    system, method = solve.system, settings.integrator
    accuracy = settings.accuracy(system.nq, system.nu)
    counts = np.zeros(COUNTS, np.int64)
    clock = clock_of(system, begin.state.t, times, method.fixed, breaks)
    y, clock, accuracy = solve.begin(begin, clock, accuracy, counts)
    memory: Memory | None = method.memory(len(y)) if begin.memory is None else begin.memory
    if begin.memory is not None and method.fixed:
        refuse_other_division(begin.memory, clock.times, float(clock.segment_ends[0]), accuracy.step)
    out = np.empty((len(times), len(y)))
    if watch is not None and np.any(watch.entry < 0):
        watch = solve.watching(watch)
    given = y, clock, accuracy, out, counts, memory, nothing_watched() if watch is None else watch
    start = perf_counter()
    solve.compile(*given)
    begun = perf_counter()
    (status, t), interrupted = solve.run(given, once=watch is not None or begin.memory is not None)
    end = perf_counter()
    paused = status == CROSSED
    if t > times[-1] and (paused or status == OK):
        t, y, memory, paused, status = times[-1], out[-1].copy(), None, False, OK
    is_over = status == OK and t == times[-1] and not interrupted and not goes_on
    controllers = solve.ended((t, y) if is_over else None)
    return Raw(
        out[: counts[SAMPLES]], Status.OK if paused else Status(status), solve.fault, t, counts.tolist(),
        begun - start, end - begun, interrupted, y, memory, paused, controllers, solve.fastest,
    )  # fmt: skip
