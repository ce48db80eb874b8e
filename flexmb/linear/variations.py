"""The equations of motion of a tree and their exact first variations, in minimal coordinates.

xi (n,) are displacements along the free speeds: the motion that constant speeds would make in a unit of time. For
scalar hinges, modes and wheels that is the change of the coordinate; for a quaternion a rotation vector in outboard
axes; for the origin of a free hinge a displacement in outboard axes. Held and driven coordinates have none. With u the
speeds and w, v those of a free or spherical hinge,

    dq = N(q) xi,    N = d(qdot)/du
    xi' = du - [w~ xi_w; v~ xi_w + w~ xi_v]
    du' = d(udot)/dq N xi + d(udot)/du du
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flexmb.entry import articulated
from flexmb.entry.tangent import jacobian, tangent_workspace, time_derivative
from flexmb.scene.functions import Constant, Function, Ramp
from flexmb.scene.open_loop import refuse_feedback
from flexmb.scene.schema import Scene
from flexmb.system.closed import ClosedSystem
from flexmb.system.compile import compile
from flexmb.system.tree_system import System
from flexmb.tables.arrays import Constants
from flexmb.tables.functions import pack as pack_functions
from flexmb.tables.state import DynamicsError, State, pack
from flexmb.tables.status import OK, Status
from flexmb.tables.workspaces import workspace
from flexmb.typing import Index, Real, Record


@dataclass(frozen=True, eq=False)
class Variations:
    """Derivatives at one state, over the n free speeds.

    rates (n,): udot; by_displacement, by_speed (n,n): its derivatives; drift (n,): its explicit derivative by time;
    transport (n,n): xi' = du + transport xi; motion (nq,n): N.
    """

    state: State
    rates: Real
    by_displacement: Real
    by_speed: Real
    drift: Real
    transport: Real
    motion: Real

    @property
    def A(self) -> Real:
        """(2n,2n) of d[xi; du]/dt."""
        return np.block([[self.transport, np.eye(len(self.rates))], [self.by_displacement, self.by_speed]])


class Equations:
    """A system with its functions of time as they are, held, or replaced (`held`, `spinning`); one per thread."""

    def __init__(self, system: System, constants: Constants | None = None) -> None:
        if isinstance(system, ClosedSystem):
            raise NotImplementedError(
                f'scene "{system.scene.name}" has closures: linear models are made of trees; open the loop, or put a '
                "stiff spring hinge in its place"
            )
        self.system = system
        self.constants = system.constants if constants is None else constants
        self.free: Index = np.flatnonzero(self.constants.speed["prescribed"] < 0)
        # places among them of those on whose displacement anything depends: all but wheels without springs
        wheels = self.constants.wheel["u_index"]
        indifferent = wheels[self.constants.speed["stiffness"][wheels] == 0.0]
        self.movable: Index = np.flatnonzero(~np.isin(self.free, indifferent))
        self._w = tangent_workspace(self.constants, system.nq, system.nu)
        self._real_w = workspace(self.constants, system.nq, system.nu)  # with a row for each of their functions

    def held(self, t: float) -> Equations:
        """The same equations with every function of time held at its value at time t (s)."""
        return self.with_functions(self.constant_functions(t))

    def spinning(self, speed: int, rate: float, state: State) -> Equations:
        """The same with all functions held, and the scalar coordinate whose speed has that number driven at `rate`."""
        functions = self.constant_functions(state.t)
        angle = float(state.q[self.constants.speed["coordinate"][speed]])
        speeds = self.constants.speed.copy()
        speeds["prescribed"][speed] = len(functions)
        return self.with_functions([*functions, Ramp(value=angle, rate=rate, start_s=state.t)], speeds)

    def with_functions(self, functions: Sequence[Function], speeds: Record | None = None) -> Equations:
        """The same with other functions of time, as many."""
        rows, table = pack_functions(functions)
        speed = self.constants.speed if speeds is None else speeds
        return Equations(self.system, replace(self.constants, function=rows, table=table, speed=speed))

    def constant_functions(self, t: float) -> list[Constant]:
        """All functions of time, held at their values at time t (s)."""
        w = self._real_w
        articulated.accelerations(t, pack(self.system.initial_state), self.constants, w)  # fills in the functions
        return [Constant(value=float(value)) for value in w.function[:, 0]]

    def rates(self, state: State) -> Real:
        """udot (n,) of the free speeds; DynamicsError where it does not exist."""
        status = articulated.accelerations(state.t, pack(state), self.constants, self._real_w)
        self._check(status, self._real_w.fault[0])
        return self._real_w.speed["acceleration"][self.free]

    def mass(self, state: State) -> Real:
        """Mass matrix (n,n) of the free speeds."""
        return self.system.mass_matrix(state)[np.ix_(self.free, self.free)]

    def variations(self, state: State) -> Variations:
        """Exact derivatives at a state; DynamicsError where the accelerations do not exist."""
        nq, y = self.system.nq, pack(state)
        J, drift = np.empty((len(y), len(y))), np.empty(len(y))
        self._check(jacobian(state.t, y, J, self.constants, self._w), self._w.fault[0])
        if self._w.doubt[0]:
            self.system.digits_left(state)  # raises if pivots are only rounding
        rates = self._w.slope[nq + self.free, 0]  # the numbers themselves, before their derivatives
        self._check(time_derivative(state.t, y, drift, self.constants, self._w), self._w.fault[0])
        rows, motion = J[nq + self.free], J[:nq, nq + self.free]
        return Variations(
            state, rates, rows[:, :nq] @ motion, rows[:, nq + self.free], drift[nq + self.free],
            self._transport(state.u)[np.ix_(self.free, self.free)], motion,
        )  # fmt: skip

    def moved(self, at: Variations, xi: Real) -> State:
        """The state displaced by xi (n,) to first order, quaternions normalised again; raises DynamicsError."""
        y = pack(at.state)
        y[: self.system.nq] += at.motion @ xi
        self.system.project(at.state.t, y, self.constants)
        if not np.isfinite(y).all():
            raise DynamicsError("a displacement led beyond all numbers")
        return State(y[: self.system.nq], y[self.system.nq : -1], at.state.t, self.system.layout)

    def on_functions(self, state: State) -> State:
        """The state with prescribed coordinates and speeds at the values of their functions at its time."""
        y = pack(state)
        self.system.project(state.t, y, self.constants)
        return State(y[: self.system.nq], y[self.system.nq : -1], state.t, self.system.layout)

    def _transport(self, u: Real) -> Real:
        """(nu,nu) of xi' = du + transport xi: carried axes turn with their own angular velocity."""
        out = np.zeros((len(u), len(u)))
        for body in self.constants.body:
            if body["quaternion"] >= 0:
                j = int(body["u_index"])
                turning = slice(j, j + 3)
                out[turning, turning] = -_cross(u[turning])
                if body["quaternion"] > body["q_index"]:
                    moving = slice(j + 3, j + 6)
                    out[moving, turning], out[moving, moving] = -_cross(u[moving]), -_cross(u[turning])
        return out

    def _check(self, status: int, fault: int) -> None:
        if status != OK:
            place = self.system.fault_name(status, int(fault))
            raise DynamicsError(Status(status).advice.format(body=f'"{place}"'))


def entering(system: System | Scene, state: State | None) -> tuple[Equations, State]:
    """The two parts of a linear model: the equations of a tree or its scene, and a state of it (default: initial).

    NotImplementedError for closed chains and scenes with controllers, ValueError or TypeError for a state that is not
    one of this system.
    """
    if not isinstance(system, System | Scene):
        raise TypeError(f"a System or a Scene is needed, not {type(system).__name__}")
    refuse_feedback(system if isinstance(system, Scene) else system.scene, "a linear model of the motion alone")
    equations = Equations(system if isinstance(system, System) else compile(system))
    if state is None:
        return equations, equations.system.initial_state
    equations.system.layout.entering(state)
    return equations, state


def _cross(v: Real) -> Real:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
