"""The tables of a closed loop: from the wiring of a scene's controllers and the kernels of its motion."""

from __future__ import annotations

from typing import Any

import numpy as np

from flexmb.control import tables as a
from flexmb.control.schedule import instants
from flexmb.control.user import Called
from flexmb.control.wiring import numbers_of, widest, wired
from flexmb.entry.observation import sense_markers
from flexmb.integrate.problem import Linear
from flexmb.jit.direct import address, addresses
from flexmb.jit.pointer import MATRIX, REAL, STATUS, VECTOR, VOID, WHOLE
from flexmb.scene.control import Controller
from flexmb.system.algorithm import DynamicsAlgorithm, Route
from flexmb.system.system import System
from flexmb.tables.state import DynamicsError
from flexmb.typing import Index, Real


class LoopTables:
    """The tables that the runs of a closed loop share, and what they are called.

    The system must not be shared, since its functions of time are written to. `tables`: constants and workspace of the
    route. Raises SceneError for a user function that cannot be loaded.
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

    def with_retraction(self, linear: Linear) -> None:
        """Add the retraction for Lie-group methods, see `flexmb.integrate.problem.StiffProblem`."""
        constants = self._tables[0]
        self._where[a.RETRACTION], _ = addresses(linear.move, VOID, VECTOR, VECTOR, VECTOR, constants)
        self._where[a.AXES], _ = addresses(linear.resolve, VOID, VECTOR, VECTOR, VECTOR, WHOLE, constants)

    def heed(self, stop: Index) -> None:
        """Let an exception in a Python law end the run, by stop[0] = 1."""
        for function in self._called:
            function.stop = stop

    def raise_trouble(self) -> None:
        """Raise the original exception of a Python law again."""
        for function in self._called:
            if function.trouble is not None:
                trouble, function.trouble = function.trouble, None
                raise trouble

    @property
    def names(self) -> dict[str, slice]:
        """Places of the signals of sensors and controllers, by name."""
        return self._wiring.names

    @property
    def controllers(self) -> tuple[Controller, ...]:
        """The controllers of the scene."""
        return self._plant.scene.controllers

    def is_sampled(self, signal: str) -> bool:
        """Whether a signal is an output of a sampled controller."""
        place = self.place_of(signal)
        return any(row["sampled"] and 0 <= place - row["signal"] < row["outputs"] for row in self._wiring.controller)

    def place_of(self, signal: str) -> int:
        """The index of a signal, for example "gyro[2]", among all signals."""
        return numbers_of(self._wiring.names, signal)[0]

    @property
    def continuous_states(self) -> list[int]:
        """Indices in `Loop.state` of the continuous controllers' states x, in their order."""
        rows = [row for row in self._wiring.controller if not row["sampled"]]
        return [int(row["state"]) + j for row in rows for j in range(int(row["states"]))]

    @property
    def driven(self) -> list[int]:
        """Indices of the functions of time that controllers drive."""
        functions: list[int] = self._wiring.drive["function"].tolist()
        return functions

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
    def sampled_widths(self) -> dict[str, int]:
        """Numbers of outputs of the sampled controllers, by name."""
        rows = zip(self.controllers, self._wiring.controller, strict=True)
        return {controller.name: int(row["outputs"]) for controller, row in rows if row["sampled"]}

    @property
    def running(self) -> a.Loop:
        """The loop of the last run."""
        assert self._run is not None  # callers have begun a run
        return self._run

    def _rows_for(self, table: Any) -> Real:
        """The array in which sampled outputs are held until they are applied."""
        return np.zeros((max(int(np.sum(table["kind"] == a.SAMPLE)), 1), widest(self._wiring.controller)))

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
        columns = observation.columns_of(row)
        self._loads[:] = np.concatenate([columns["loads"][0], columns["closures"][0]])
        self._drives[:] = columns["drives"][0]

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
