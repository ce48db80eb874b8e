"""A run of a closed loop: the problem for the integrators, instants at its end, and afterwards its signals and the
power of each controller output, summed over everything that it drives.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np

from flexmb.control import leaping, loop
from flexmb.control import tables as a
from flexmb.control.loop_tables import LoopTables
from flexmb.control.schedule import LoopMemory, instants, slack, with_instants
from flexmb.control.tangent import jacobian
from flexmb.entry.observation import outputs, sense_markers, shapes
from flexmb.integrate.problem import Accuracy, Clock, Linear, Problem, StiffProblem, problem, stiff_problem
from flexmb.integrate.watch import Watch
from flexmb.system.system import System
from flexmb.tables.arrays import FORCE, NODE_AXES, ON_GROUND
from flexmb.tables.state import State
from flexmb.typing import Index, Real, Record


def powers(system: System, times: Real, states: Real, drives: Record, signals: Real) -> Real:
    """(T,S) power (W) of each of the signals (T,S) on the motion, at times (T,) and states (T,n) = [q, u, ...]."""
    c, found = system.constants, np.zeros_like(signals)
    loads = np.flatnonzero(np.isin(c.load["function"], drives["function"]))
    connectors = np.flatnonzero(np.isin(c.connector["function"], drives["function"]))
    ends = c.end[connectors]
    ports = np.concatenate([c.load["port"][loads], ends["port"].ravel()])
    rows = _motion(system, times, states, ports)
    along = _along_loads(c.load[loads], rows[:, : len(loads)])
    longer = _lengthening(ends, rows[:, len(loads) :].reshape(len(times), len(connectors), 2, 24))
    for drive in drives:
        rate = np.zeros(len(times))
        pushed = c.hinge_spring["speed"][c.hinge_spring["function"] == drive["function"]]
        for j in [*np.flatnonzero(c.speed["motor"] == drive["function"]), *pushed]:
            rate += states[:, system.nq + j]
        rate += along[:, c.load["function"][loads] == drive["function"]].sum(axis=1)
        rate += longer[:, c.connector["function"][connectors] == drive["function"]].sum(axis=1)
        found[:, drive["signal"]] += drive["gain"] * signals[:, drive["signal"]] * rate
    return found


def _motion(system: System, times: Real, states: Real, ports: Index) -> Real:
    """(T,P,24) rows of ports, laid out as those of markers; zeros for ports on the ground."""
    c, found = system.constants, np.zeros((len(times), len(ports), 24))
    moving = np.flatnonzero(ports >= 0)
    if not len(moving):
        return found
    at = ports[moving].astype(np.int64)
    bodies = np.searchsorted(c.body["port_stop"], at, side="right").astype(np.int64)
    out = outputs(shapes(system.nu, len(at), 0, 0), bodies, at)
    workspace, n = system.workspace(), system.nq + system.nu
    y = np.zeros(n + 1)
    for sample, t in enumerate(times.tolist()):
        y[:n] = states[sample, :n]
        sense_markers(t, y, c, workspace, out)
        found[sample, moving] = out.markers
    return found


def _along_loads(loads: Record, rows: Real) -> Real:
    """(T,L) speeds of the nodes of loads along their directions."""
    found = np.empty(rows.shape[:2])
    for i, load in enumerate(loads):
        direction = load["direction"]
        if load["frame"] == NODE_AXES:
            direction = rows[:, i, 3:12].reshape(-1, 3, 3) @ direction
        velocity = rows[:, i, 15:18] if load["type"] == FORCE else rows[:, i, 12:15]
        found[:, i] = np.sum(velocity * direction, axis=1)
    return found


def _lengthening(ends: Record, rows: Real) -> Real:
    """(T,C) rates of the distances of connectors' ends."""
    positions = np.where((ends["body"] == ON_GROUND)[..., None], ends["position"], rows[..., :3])
    line, apart = positions[:, :, 1] - positions[:, :, 0], rows[:, :, 1, 15:18] - rows[:, :, 0, 15:18]
    length = np.linalg.norm(line, axis=-1)
    return np.divide(np.sum(line * apart, axis=-1), length, out=np.zeros_like(length), where=length > 0.0)


class Begun(NamedTuple):
    """The initial value problem of a closed loop: y = [q, u, x, work] instead of [q, u, work]."""

    problem: Problem | StiffProblem
    y: Real
    clock: Clock
    accuracy: Accuracy


class Starting(Protocol):
    """Start of a run. state: of the motion, with its time; y: [q, u, work], or [q, u, x, work] with the memory of
    controllers."""

    @property
    def state(self) -> State: ...
    @property
    def y(self) -> Real: ...
    @property
    def controllers(self) -> LoopMemory | None: ...


class FreshStart(NamedTuple):
    """A state of the motion at which controllers start without a memory."""

    state: State
    controllers: None = None

    @property
    def y(self) -> Real:
        return np.concatenate([self.state.q, self.state.u, [0.0]])


class LoopRun(LoopTables):
    """A closed loop, one run after the other."""

    def begin(self, begin: Starting, clock: Clock, accuracy: Accuracy, linear: Linear | None) -> Begun:
        """Begin a run. Controllers start from their initial states in the scene, or from those at the end of a run.

        linear: Jacobian of the motion alone, for methods that linearise. Sampling instants before the start are not
        executed again: their outputs are taken from the memory, or zero.
        """
        start, t_end, known = begin.state.t, float(clock.times[-1]), begin.controllers
        ends, apart = clock.segment_ends, slack(start, t_end)
        table = instants(self._plant.scene.controllers, start, t_end, ends[np.isfinite(ends)])
        happened = 0 if known is None else int(known.instants[0])
        self._instants, self._end = table, t_end
        due = table[: max(happened, np.searchsorted(table["time"], t_end))]  # instants at t_end act after the run
        held = self._rows_for(due)
        for values in self._held.values():
            values[:] = 0.0
        self._run = made = self._loop(due, held, apart)
        if known is None:
            made.following[0] = np.searchsorted(due["time"], start)
            self._held["state"][:] = self._wiring.initial
            y = np.concatenate([begin.y[:-1], self._wiring.continuous, begin.y[-1:]])
            loop.start(start, y, made)
            if np.any(due["time"] == start) and len(self._wiring.continuous):
                self._start_after_samples(start, y, made)
        else:
            y, made.following[0] = begin.y, happened
            self._held["state"][:], self._held["signal"][:] = known.state, known.signal
            held[: len(known.held)] = known.held[: len(held)]
        kernels = loop.rhs, loop.project, made, made
        of_motion = self._leaping
        leaps = of_motion and of_motion._replace(back=leaping.back, leap=leaping.leap)
        if linear is not None:
            if made.continuous[0]:
                tangent = self._tangent(linear, len(y))  # and no stiff part: it knows no states of controllers
                linear = linear._replace(jacobian=jacobian, exact=made, tangent=tangent, stiff=None)
            posed: Any = stiff_problem(*kernels, linear._replace(move=loop.move, resolve=loop.resolve), leaps)
        else:
            posed = problem(*kernels, leaps)
        controlled = accuracy._replace(controlled=accuracy.controlled + len(self._wiring.continuous))
        ends = with_instants(ends, table["time"][table["time"] > start], t_end)
        farthest = clock.farthest if len(table) == 0 else t_end  # a leap crosses no instant
        return Begun(posed, y, Clock(clock.times, ends, farthest), controlled)

    def _start_after_samples(self, t: float, y: Real, made: a.Loop) -> None:
        """Start continuous controllers after the first outputs of sampled controllers are known."""
        loop.project(t, y, made)
        loop.hold(t, y, made)
        loop.start(t, y, made)
        self.raise_trouble()

    def conclude(self, t: float, y: Real, anew: bool = False) -> bool:
        """Execute the sampled controllers that are due at the end of a run, at y (n,); returns whether there are any.

        Integrators do not evaluate instants at the end unless the run continues. anew: a new integration would start
        there, after an event.
        """
        before, table = self.running, self._instants
        if t != self._end or not np.any(table["time"][before.following[0] :] == t):
            return False
        held, there = self._rows_for(table), y.copy()
        held[: len(before.held)] = before.held
        self._run = made = self._loop(table, held, float(before.slack[0]))
        made.following[0] = before.following[0]
        loop.project(t, there, made)  # also sets the state of the closures
        loop.hold(t, there if anew else y, made)
        self.raise_trouble()
        return True

    @property
    def schedule(self) -> Record:
        """INSTANT records of the last run, those at its end included."""
        return self._instants

    @property
    def samples(self) -> int:
        """Number of rows of held outputs that the schedule needs."""
        return int(np.sum(self._instants["kind"] == a.SAMPLE))

    def remember(self) -> LoopMemory:
        """The memory of the controllers at the end of a run, before it is replayed."""
        s = self.running
        return LoopMemory(s.signal.copy(), s.state.copy(), s.held.copy(), s.following.astype(float))

    def watching(self, watch: Watch) -> Watch:
        """The same watch with access to the signals of this run, which must have begun."""
        return watch.seeing(len(self.running.signal), loop.look, self.running)

    @property
    def motion(self) -> tuple[Any, a.Loop, a.Loop]:
        """The closed loop's right-hand side, with its tables."""
        return loop.rhs, self.running, self.running

    observing = loop.observe
    """The kernel that observes the motion where the loop was evaluated, for algorithms that have a compiled one."""

    def replay(self) -> None:
        """Replay the finished run from now on: outputs of sampled controllers are read back, not computed."""
        self.running.replaying[0] = 1
        self.running.now[0] = np.inf

    def course(self, times: Real, states: Real) -> tuple[dict[str, Real], dict[str, Real]]:
        """Signals by sensor and controller, (T,k), and likewise the power of controllers' outputs (W).

        They are evaluated at the states (T,n) of the replayed run.
        """
        times, found = times[: len(states)], np.empty((len(states), len(self.running.signal)))
        done = loop.retrace(times, states, self.running, found)
        self.raise_trouble()
        found[done:] = np.nan
        power = powers(self._plant, times, states, self._wiring.drive, found)
        named = self._wiring.names
        controllers = [controller.name for controller in self._plant.scene.controllers]
        return (
            {name: found[:, place].copy() for name, place in named.items()},
            {name: power[:, named[name]].copy() for name in controllers},
        )

    @property
    def observation(self) -> Any:
        """The observation of the system: names are the same."""
        return self._plant.observation

    def observe_row(self, t: float, y: Real, algorithm: Any, row: Real) -> None:
        """Observe one row as the system does, with the controller outputs at t."""
        loop.hold(t, y, self.running)
        self.raise_trouble()
        self._plant.observe_row(t, self.running.y.copy(), algorithm, row)
