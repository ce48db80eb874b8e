"""The equations of motion and their exact first variations in minimal coordinates (for trees, all free coordinates).

Closed chains: `flexmb.linear.closed_variations`.

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
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from flexmb.entry import articulated
from flexmb.entry.derivatives import DerivativeWorkspace, derivative_workspace
from flexmb.entry.tangent import TangentWorkspace, tangent_workspace
from flexmb.entry.variation import FreeVariation, TreeVariation
from flexmb.kept import kept
from flexmb.linear.labels import ModelLabels, Name, model_labels
from flexmb.scene.functions import Constant, Function, Ramp
from flexmb.system.pushforward import GivenMotion, Pushforward, pushforward
from flexmb.system.system import System
from flexmb.tables.arrays import Constants, Workspace
from flexmb.tables.functions import pack as pack_functions
from flexmb.tables.per_thread import per_thread
from flexmb.tables.state import DynamicsError, State, pack
from flexmb.tables.workspaces import workspace
from flexmb.typing import Flags, Index, Real, Record

if TYPE_CHECKING:
    from flexmb.closure.tables import ClosureConstants
    from flexmb.closure.variation import ChainVariation


class Variations(NamedTuple):
    """Derivatives at one state by the f independent ones of n free speeds; in a tree f = n.

    free: of all speeds, of which the others follow. rates (f,): udot; by_displacement, by_speed (f,f): its derivatives;
    drift (f,): its explicit derivative by time; transport (f,f): xi' = du + transport xi; motion (nq,f): N; mass (f,f):
    mass matrix. chosen (f,): indices of the independent speeds among the free ones; movable: indices among these of
    coordinates that are not cyclic. by_chosen (2n,2f): displacements and changes of all free speeds by those of the
    independent ones.
    """

    state: State
    free: FreeVariation
    rates: Real
    by_displacement: Real
    by_speed: Real
    drift: Real
    transport: Real
    motion: Real
    mass: Real
    chosen: Index
    movable: Index
    by_chosen: Real

    @property
    def basis(self) -> Real:
        """(n,f) displacements of all free speeds by those of the independent ones; velocities likewise."""
        return self.by_chosen[: len(self.by_chosen) // 2, : len(self.chosen)]

    @property
    def A(self) -> Real:
        """(2n,2n) matrix of d[xi; du]/dt."""
        n = len(self.rates)
        found = np.zeros((2 * n, 2 * n))
        found[:n, :n] = self.transport
        found.ravel()[n : 2 * n * n : 2 * n + 1] = 1.0  # xi' = du
        found[n:, :n], found[n:, n:] = self.by_displacement, self.by_speed
        return found


class ModelStates(NamedTuple):
    """Names and units of the states of a linear model, and of the dependent displacements and speeds, which are at
    these places among all."""

    states: tuple[Name, ...]
    dependent: tuple[Name, ...]
    places: Index


class RestForces(NamedTuple):
    """At one state: generalised loads (f,), N (N m), on the independent coordinates, and the stiffness (f,f) by which
    they fall with displacements while the loads of closures stay. They are inverse dynamics at rest with the opposite
    sign: no derivative of the inertia enters, whatever the accelerations are.

    rates, motion, mass, chosen, movable: as of `Variations`; basis (n,f): displacements of all free speeds.
    """

    state: State
    load: Real
    stiffness: Real
    rates: Real
    motion: Real
    mass: Real
    chosen: Index
    movable: Index
    basis: Real


class Equations:
    """A system with its functions of time, which can be held or replaced (`held`, `spinning`).

    Threads may share it, as they may share a `SteadySpin`, which holds one: each has workspaces of its own.
    """

    def __init__(self, system: System, constants: Constants | None = None, like: Equations | None = None) -> None:
        """like: equations with other numbers, whose workspaces serve these too where the tables have one structure."""
        self.system = system
        self.constants = system.constants if constants is None else constants
        self.free: Index = np.flatnonzero(self.constants.speed["prescribed"] < 0)
        self._among_free = np.ix_(self.free, self.free)
        """Rows and columns (n,n) of the free speeds in those of all."""
        wheels = self.constants.wheel["u_index"]
        self._movable = np.ones(system.nu, bool)
        self._movable[wheels] = self.constants.speed["stiffness"][wheels] != 0.0
        quaternion, q, u = (self.constants.body[key] for key in ("quaternion", "q_index", "u_index"))
        self._turning = [(int(u[k]), bool(quaternion[k] > q[k])) for k in np.flatnonzero(quaternion >= 0)]
        """Where the speeds of spherical and free hinges begin, and whether they are free."""
        # Workspaces have a row for each function, and tables of which coordinates are driven.
        self._as_system = same_structure(self.constants, system.constants)
        shared = like is not None and same_structure(self.constants, like.constants)
        self._root: Equations = like._root if like is not None and shared else self
        self._named: tuple[bytes, ModelStates] | None = None

    @kept
    def labels(self) -> ModelLabels:
        """Names and units in the linear models of all equations of this structure."""
        return self._root.labels if self._root is not self else model_labels(self.system, self.constants, self.free)

    def state_names(self, chosen: Index) -> ModelStates:
        """By the numbers (f,) of the independent speeds among the free ones; those of the last choice are kept."""
        root, key = self._root, chosen.tobytes()
        known = root._named  # read once: another thread may put that of another choice in its place
        if known is None or known[0] != key:
            n, names = len(root.free), (*root.labels.displacements, *root.labels.speeds)
            states = [*chosen.tolist(), *(n + chosen).tolist()]
            places = np.array(sorted(set(range(2 * n)) - set(states)), np.int64)
            named = ModelStates(tuple(names[i] for i in states), tuple(names[i] for i in places.tolist()), places)
            root._named = known = key, named
        return known[1]

    @property
    def freedom(self) -> int:
        """Number of independent speeds."""
        return len(self.free)

    @per_thread
    def _w(self) -> TangentWorkspace:
        if self._root is not self:
            return self._root._w
        system = self.system
        return system.own_tangent if self._as_system else tangent_workspace(self.constants, system.nq, system.nu)

    @per_thread
    def _derivatives(self) -> DerivativeWorkspace:
        if self._root is not self:
            return self._root._derivatives
        system = self.system
        return system.own_derivatives if self._as_system else derivative_workspace(self.constants, system.nq, system.nu)

    @per_thread
    def _real_w(self) -> Workspace:
        if self._root is not self:
            return self._root._real_w
        system = self.system
        return system.own_workspace if self._as_system else workspace(self.constants, system.nq, system.nu)

    @per_thread
    def _free(self) -> TreeVariation | ChainVariation:
        return TreeVariation(self.constants, self._derivatives, self._w, self.system.check_status)

    @per_thread
    def pushforward(self) -> Pushforward:
        """Derivatives of everything observable along directions."""
        tables = self.constants, self._w, self.system.observation.out
        return pushforward(*tables, self.system.check_status, self.closures)

    @property
    def closures(self) -> ClosureConstants | None:
        """The tables of closures, None of a tree."""
        return None

    def free_variation(self, state: State) -> FreeVariation:
        """How all accelerations change; DynamicsError where these do not exist."""
        variation = self._free.at(state.t, pack(state))
        self._examine(state)
        return variation

    def _examine(self, state: State) -> None:
        """DynamicsError if pivots of the last motion, which was at this state, are at rounding level."""
        if self._free.doubt[0]:
            self.system.digits_left(state)

    def motion(self, state: State) -> GivenMotion:
        """The motion with its accelerations, and the loads of rows; DynamicsError where these do not exist."""
        y = pack(state)
        status = articulated.accelerations(state.t, y, self.constants, self._real_w)
        self.system.check_status(status, int(self._real_w.fault[0]))
        return GivenMotion(state.t, y, self._real_w.speed["acceleration"].copy(), np.zeros(0))

    def undetermined(self, state: State) -> Flags:
        """Which entries of a row (E,) of everything observable the motion does not determine."""
        return np.zeros(self.system.observation.width, bool)

    def held(self, t: float) -> Equations:
        """The same equations with every function of time held at its value at time t (s)."""
        if not len(self.constants.function):
            return self
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
        return type(self)(self.system, replace(self.constants, function=rows, table=table, speed=speed), self)

    def constant_functions(self, t: float) -> list[Constant]:
        """All functions of time, held at their values at time t (s)."""
        w = self._real_w
        articulated.accelerations(t, pack(self.system.scene_state(t)), self.constants, w)  # fills in the functions
        return [Constant(value=float(value)) for value in w.function[:, 0]]

    def rates(self, state: State) -> Real:
        """udot (n,) of the free speeds; DynamicsError where they do not exist."""
        return self.motion(state).accelerations[self.free]

    def turns(self, state: State) -> Real:
        """Angular velocities (N,3) rad/s of the bodies' frames, in their own axes."""
        self.rates(state)
        return np.array(self._real_w.body["velocity"][:, :3])

    def mass(self, state: State) -> Real:
        """Mass matrix (n,n) of the free speeds, without closures."""
        return self.system.mass_matrix(state)[self._among_free]

    def loads(self, state: State, at: RestForces) -> Real:
        """Generalised loads, N (N m), on the coordinates (f,) that are independent at another state."""
        return self.mass(state) @ self.rates(state)

    def forces(self, state: State) -> RestForces:
        """Loads and tangent stiffness at a state; DynamicsError where the accelerations do not exist."""
        found, free = self._free.stiffness(state.t, pack(state)), self.free
        self._examine(state)
        both, rates = self._among_free, found.accelerations[free]
        mass = found.mass[both]
        chosen, N = self._independent(mass, found.J[:, free])
        return RestForces(
            state, N.T @ mass @ rates, N.T @ found.stiffness[both] @ N, rates[chosen], found.motion[:, free] @ N,
            N.T @ mass @ N, chosen, self.movable(chosen), N,
        )  # fmt: skip

    def _independent(self, mass: Real, J: Real) -> tuple[Index, Real]:
        """Indices (f,) of the independent coordinates and N (n,f); mass (n,n) and J (G,n) of the free speeds."""
        return np.arange(len(mass)), np.eye(len(mass))

    def movable(self, chosen: Index) -> Index:
        """Indices among these free speeds of those whose coordinate is not cyclic: all but wheels without springs."""
        return np.flatnonzero(self._movable[self.free[chosen]])

    def variations(self, state: State) -> Variations:
        """Exact derivatives at a state; DynamicsError where the accelerations do not exist."""
        found, free, n = self.free_variation(state), self.free, len(self.free)
        of_rates, everything, both = found.of_accelerations, np.arange(n), self._among_free
        return Variations(
            state, found, found.accelerations[free], of_rates.by_displacement[both], of_rates.by_speed[both],
            of_rates.by_time[free], self._transport(state.u), found.motion[:, free], self.mass(state), everything,
            self.movable(everything), np.eye(2 * n),
        )  # fmt: skip

    def moved(self, at: Variations | RestForces, xi: Real) -> State:
        """The state displaced by xi (n,) to first order, quaternions normalised again; raises DynamicsError."""
        q = at.state.q + at.motion @ xi
        if not np.isfinite(q).all():
            raise DynamicsError("a displacement led beyond all numbers")
        return self.on_functions(replace(at.state, q=q))

    def on_functions(self, state: State) -> State:
        """The state with prescribed coordinates and speeds at the values of their functions at its time."""
        y = pack(state)
        self.system.project(state.t, y, self.constants)
        return self.system.layout.known(state.t, y)

    def _transport(self, u: Real) -> Real:
        """(n,n) of xi' = du + transport xi: carried axes turn with their own angular velocity."""
        out = np.zeros((len(u), len(u)))
        for j, also_moves in self._turning:
            turning = slice(j, j + 3)
            out[turning, turning] = -_cross(u[turning])
            if also_moves:
                moving = slice(j + 3, j + 6)
                out[moving, turning], out[moving, moving] = -_cross(u[moving]), -_cross(u[turning])
        return out[self._among_free]


def same_structure(a: Any, b: Any) -> bool:
    """Whether one workspace serves two bundles of tables: shapes and integers agree, of functions of time only how many
    there are."""
    for field in fields(a):
        one, other = getattr(a, field.name), getattr(b, field.name)
        if one is other or field.name == "table":
            continue
        if one.shape != other.shape:
            return False
        for name in () if field.name == "function" else one.dtype.names or ():
            if one[name].dtype == np.int64 and not np.array_equal(one[name], other[name]):
                return False
    return True


def _cross(v: Real) -> Real:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
