"""The feedback of a scene in a run: the closed loop for the integrators, and its signals afterwards."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np

from flexmb.control import leaping, loop
from flexmb.control import tables as a
from flexmb.control.memory import LoopMemory
from flexmb.control.power import powers
from flexmb.control.schedule import instants, slack, with_instants
from flexmb.control.tangent import jacobian
from flexmb.control.user import Called
from flexmb.control.wiring import numbers_of, widest, wired
from flexmb.entry.observation import sense_markers
from flexmb.integrate.problem import Accuracy, Clock, Linear, Problem, StiffProblem, problem, stiff_problem
from flexmb.integrate.watch import Watch
from flexmb.jit.direct import address, addresses
from flexmb.jit.pointer import MATRIX, REAL, STATUS, VECTOR, VOID, pointer
from flexmb.system.algorithm import DynamicsAlgorithm, Route
from flexmb.system.tree_system import System
from flexmb.tables.state import DynamicsError, State
from flexmb.typing import Index, Real, Record

DISPLACEMENT = 1e-6  # m, rad: displacement of the finite difference for signal rates before integration starts
SLOWEST = 1e-100  # m/s, rad/s: slower motion counts as rest, since DISPLACEMENT over the speed would overflow
NOISE = 1e-8  # relative to DISPLACEMENT: a smaller change of a signal counts as zero


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


class Feedback:
    """The controllers of a system. The system must not be shared, since its functions of time are written to.

    `tables`: constants and workspace of the route. Raises SceneError for a user function that cannot be loaded.
    """

    def __init__(self, plant: System, algorithm: DynamicsAlgorithm, route: Route, tables: tuple[Any, Any]) -> None:
        self._plant, self._algorithm, self._tables = plant, algorithm, tables
        self._wiring = wired(plant)
        constants, workspace = tables
        self._outputs = plant.observation.outputs()
        self._tree, self._tree_workspace = plant.constants, plant.workspace()
        where = np.zeros(a.ADDRESSES, np.int64)
        where[a.MOTION], where[a.CONSTANTS], where[a.WORKSPACE] = addresses(
            route.rhs, STATUS, REAL, VECTOR, VECTOR, constants, workspace
        )
        where[a.MANIFOLD], _ = addresses(route.project, VOID, REAL, VECTOR, constants)
        where[a.OUTPUTS] = address(self._outputs)
        if self._has_markers:
            where[a.MARKERS], where[a.TREE], where[a.TREE_WORKSPACE], _ = addresses(
                sense_markers, VOID, REAL, VECTOR, self._tree, self._tree_workspace, self._outputs
            )
        if algorithm.observing is not None and not plant.scene.constraints:
            where[a.OBSERVING], *_ = addresses(algorithm.observing, VOID, constants, workspace, self._outputs)
        self._leaping = route.leaping
        if route.leaping is not None:
            where[a.BACK], _ = addresses(route.leaping.back, REAL, VECTOR, constants)
            where[a.LEAP], _ = addresses(route.leaping.leap, REAL, REAL, *[VECTOR] * 4, constants)
            where[a.BESIDE], _ = addresses(route.leaping.beside, STATUS, REAL, VECTOR, VECTOR, constants)
        self._where, self._held = where, self._buffers()
        self._called = self._callbacks()
        self._loads, self._drives = self._outputs.loads, self._outputs.drives
        if np.any(self._wiring.sensor["kind"] >= a.LOAD) and not where[a.OBSERVING]:
            self._loads = np.zeros((len(plant.observation.names.hinges) + len(plant.scene.constraints), 6))
            self._called.append(Called(self._find_loads, ()))
            where[a.ASKING] = self._called[-1].address
        self._doubt = getattr(workspace, "doubt", np.zeros(1, np.int64))  # else set by Python
        self._run: a.Loop | None = None
        self._instants, self._end = instants((), 0.0, 0.0, ()), 0.0
        """Instants of the last run up to its end."""

    def with_retraction(self, move: Any) -> None:
        """Add the retraction for Lie-group methods, see `flexmb.integrate.problem.StiffProblem`."""
        self._where[a.RETRACTION], _ = addresses(move, VOID, VECTOR, VECTOR, VECTOR, self._tables[0])

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
            posed: Any = stiff_problem(*kernels, linear._replace(move=loop.move), leaps)
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

    def _rows_for(self, table: Any) -> Real:
        """The array in which sampled outputs are held until they are applied."""
        return np.zeros((max(int(np.sum(table["kind"] == a.SAMPLE)), 1), widest(self._wiring.controller)))

    @property
    def names(self) -> dict[str, slice]:
        """Places of the signals of sensors and controllers, by name."""
        return self._wiring.names

    @property
    def schedule(self) -> Record:
        """INSTANT records of the last run, those at its end included."""
        return self._instants

    @property
    def samples(self) -> int:
        """Number of rows of held outputs that the schedule needs."""
        return int(np.sum(self._instants["kind"] == a.SAMPLE))

    def is_sampled(self, signal: str) -> bool:
        """Whether a signal is an output of a sampled controller."""
        place = self.place_of(signal)
        return any(row["sampled"] and 0 <= place - row["signal"] < row["outputs"] for row in self._wiring.controller)

    def look(self, begin: Starting, acts: bool, anew: bool = False) -> LoopMemory:
        """Evaluate the loop at one state, as at the only output time of a finished run.

        acts: after the controllers that are due there have acted, see `conclude`.
        """
        y = self._only_at(begin)
        if acts:
            self.running.replaying[0] = 0
            self.conclude(begin.state.t, y, anew)
        known = self.remember()
        self.replay()
        return known

    def signals(self, begin: Starting) -> Real:
        """(S,) signals at one state, before the sampled controllers that are due there act."""
        y = self._only_at(begin)
        found = np.zeros(len(self.running.signal))
        loop.project(begin.state.t, y.copy(), self.running)
        loop.look(begin.state.t, y, found, self.running)
        self.raise_trouble()
        return found

    def signal_rates(self, begin: Starting) -> Real:
        """(S,) rates (1/s) of the signals that are not sampled, by a finite difference; 0 at rest."""
        t, y = begin.state.t, self._only_at(begin)
        slope, there, ahead = np.zeros(len(y)), np.zeros(len(self.running.signal)), np.zeros(len(self.running.signal))
        loop.project(t, y.copy(), self.running)
        loop.rhs(t, y, slope, self.running, self.running)
        fastest = float(np.max(np.abs(slope[: self._plant.nq]), initial=0.0))
        if not SLOWEST < fastest < np.inf:
            return there
        loop.look(t, y, there, self.running)
        loop.look(t + DISPLACEMENT / fastest, y + DISPLACEMENT / fastest * slope, ahead, self.running)
        self.raise_trouble()
        change = ahead - there
        change[np.abs(change) <= NOISE * DISPLACEMENT + 64.0 * np.spacing(np.abs(ahead) + np.abs(there))] = 0.0
        rates: Real = change * (fastest / DISPLACEMENT)
        return rates

    def accelerations(self, begin: Starting) -> Real:
        """(nu,) accelerations at one state under the controllers; DynamicsError where they do not exist."""
        y, nq, nu = self._only_at(begin), self._plant.nq, self._plant.nu
        slope = np.empty(len(y))
        loop.project(begin.state.t, y, self.running)  # also sets the state of the closures
        status = loop.rhs(begin.state.t, y, slope, self.running, self.running)
        self.raise_trouble()
        self._plant.check_status(status, int(self._tables[1].fault[0]))
        return slope[nq : nq + nu]

    def _only_at(self, begin: Starting) -> Real:
        t = begin.state.t
        clock = Clock(np.array([t]), np.array([t]))
        y = self.begin(begin, clock, Accuracy(0.0, 0.0, 0, 0), None).y
        self.replay()
        return y

    def place_of(self, signal: str) -> int:
        """The index of a signal, for example "gyro[2]", among all signals."""
        return numbers_of(self._wiring.names, signal)[0]

    def watching(self, watch: Watch) -> Watch:
        """The same watch with access to the signals of this run, which must have begun."""
        look = pointer(loop.look, STATUS, REAL, VECTOR, VECTOR, self.running)
        return watch._replace(signal=np.zeros(len(self.running.signal)), look=look)

    def remember(self) -> LoopMemory:
        """The memory of the controllers at the end of a run, before it is replayed."""
        s = self.running
        return LoopMemory(s.signal.copy(), s.state.copy(), s.held.copy(), s.following.astype(float))

    def heed(self, stop: Index) -> None:
        """Let an exception in a Python law end the run, by stop[0] = 1."""
        for each in self._called:
            each.stop = stop

    def raise_trouble(self) -> None:
        """Raise the original exception of a Python law again."""
        for each in self._called:
            if each.trouble is not None:
                trouble, each.trouble = each.trouble, None
                raise trouble

    @property
    def continuous_states(self) -> list[int]:
        """Indices in `Loop.state` of the continuous controllers' states x, in their order."""
        rows = [row for row in self._wiring.controller if not row["sampled"]]
        return [int(row["state"]) + j for row in rows for j in range(int(row["states"]))]

    @property
    def driven(self) -> list[int]:
        """Indices of the functions of time that controllers drive."""
        found: list[int] = self._wiring.drive["function"].tolist()
        return found

    @property
    def state_names(self) -> list[str]:
        """Names of the continuous controllers' states x, in their order."""
        named = zip(self._wiring.controller, self._plant.scene.controllers, strict=True)
        return [
            f"{controller.name}.state[{i}]"
            for row, controller in named
            if not row["sampled"]
            for i in range(int(row["states"]))
        ]

    @property
    def running(self) -> a.Loop:
        """The loop of the last run."""
        assert self._run is not None  # callers have begun a run
        return self._run

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

    @property
    def _has_markers(self) -> bool:
        kinds = self._wiring.sensor["kind"]
        seen = (kinds >= a.POSITION) & (kinds <= a.DISTANCE)
        return bool(np.any(seen | ((kinds >= a.ACCELERATION) & (kinds < a.LOAD))))

    def _find_loads(self, t: float) -> None:
        """Loads at s.y as in the outputs; NaN where they do not exist, which ends a run that uses them."""
        observation = self._plant.observation
        row = np.zeros((1, observation.width))
        try:
            self._plant.observe_row(t, self.running.y.copy(), self._algorithm.name, row[0])
        except DynamicsError:
            row[:] = np.nan
        found = observation.columns_of(row)
        self._loads[:] = np.concatenate([found["loads"][0], found["closures"][0]])
        self._drives[:] = found["drives"][0]

    def _buffers(self) -> dict[str, Real]:
        """The arrays that laws read and write; their addresses do not change during a run."""
        w = self._wiring
        signals = max((place.stop for place in w.names.values()), default=0)
        return {
            "signal": np.zeros(signals), "input": np.zeros(len(w.wire)), "state": np.zeros(len(w.initial)),
            "output": np.zeros(int(np.sum(w.controller["outputs"]))), "change": np.zeros(len(w.initial)),
        }  # fmt: skip

    def _callbacks(self) -> list[Called]:
        """Wrap the plain Python laws, and write their addresses to the controllers' table."""
        found, held = list[Called](), self._held
        for i, law in self._wiring.laws.items():
            row = self._wiring.controller[i]
            inputs = slice(row["input"], row["input"] + row["inputs"])
            states = slice(row["state"], row["state"] + row["states"])
            outputs = slice(row["output"], row["output"] + row["outputs"])
            numbers = slice(row["number"], row["number"] + row["numbers"])
            arrays = (
                held["input"][inputs], held["state"][states], self._wiring.number[numbers], held["output"][outputs],
                held["change"][states],
            )  # fmt: skip
            found.append(Called(law, arrays))
            row["function"] = found[-1].address
        return found

    def _tangent(self, linear: Linear, n: int) -> a.LoopTangent:
        """The tables for the Jacobian of y (n,) = [q, u, x, work], from those of the motion."""
        motion, drives = self._plant.nq + self._plant.nu, len(self._wiring.drive)
        read = np.zeros(n - 1, bool)
        read[motion:] = True
        read[:motion] = self._has_markers or self._wiring.reads_at_once
        for sensor in self._wiring.sensor[self._wiring.sensor["kind"] <= a.RATE]:
            read[sensor["place"] : sensor["place"] + sensor["width"]] = True
        of_motion = linear.jacobian, STATUS, REAL, VECTOR, MATRIX, linear.exact, linear.tangent
        return a.LoopTangent(
            address=np.array(addresses(*of_motion)),
            column=np.flatnonzero(read), y=np.zeros(n), of_motion=np.zeros((motion + 1, motion + 1)),
            slope=np.zeros(motion + 1), effect=np.zeros((drives, motion + 1)),
            ahead=np.zeros(drives + n - 1 - motion), behind=np.zeros(drives + n - 1 - motion),
        )  # fmt: skip

    def _loop(self, table: Any, held: Real, apart: float) -> a.Loop:
        w, plant, out = self._wiring, self._plant, self._outputs
        n = plant.nq + plant.nu + 1
        at_once = bool(np.any(w.sensor["kind"] >= a.AT_ONCE))
        return a.Loop(
            address=self._where, sensor=w.sensor, controller=w.controller, wire=w.wire, number=w.number, drive=w.drive,
            course=w.course, piece=w.piece, function=plant.constants.function, instant=table,
            continuous=np.array([not np.all(w.controller["sampled"])], np.int64),
            has_markers=np.array([self._has_markers], np.int64), has_at_once=np.array([at_once], np.int64),
            follows=np.array([w.reads_at_once], np.int64), gravity=plant.constants.gravity,
            slack=np.array([apart]), held=held, following=np.zeros(1, np.int64),
            replaying=np.zeros(1, np.int64), now=np.zeros(1), y=np.zeros(n), dy=np.zeros(n),
            stuck=np.zeros(1, np.int64), good=np.zeros(len(w.initial)), before=np.zeros(n),
            slope_before=np.zeros(n), after=np.zeros(n), slope_after=np.zeros(n), driven=np.zeros((4, len(w.drive))),
            rates=out.rates, markers=out.markers, loads=self._loads, drives=self._drives, doubt=self._doubt,
            **self._held,
        )  # fmt: skip
