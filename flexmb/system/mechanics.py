"""The equations of motion M udot + c = tau of a tree at one state: inverse dynamics, mass matrix and its factors."""

from __future__ import annotations

import warnings
from collections.abc import Set
from functools import partial
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from flexmb.entry import articulated, composite, unsplit
from flexmb.entry.consistent import consistent_accelerations, held_hinges
from flexmb.entry.derivatives import DerivativeWorkspace, derivative_workspace
from flexmb.entry.observation import observe, observe_motion, transmitted
from flexmb.entry.tangent import TangentWorkspace, tangent_workspace
from flexmb.jain.elimination import Elimination
from flexmb.jain.places import Matrices, matrices
from flexmb.jain.unsplit import Joint
from flexmb.jit.direct import Direct, direct
from flexmb.jit.pointer import MATRIX, REAL, STATUS, VECTOR, VOID
from flexmb.kept import kept
from flexmb.scene import schema as s
from flexmb.scene.sizes import refuse_large_matrix
from flexmb.system.factors import MassMatrixFactors
from flexmb.system.load_axes import Axes, referred
from flexmb.system.observables import Observation
from flexmb.system.scene_arrays import SceneArrays
from flexmb.tables import arguments
from flexmb.tables.arrays import Constants, Workspace
from flexmb.tables.per_thread import Own, per_thread
from flexmb.tables.state import DynamicsError, PrecisionWarning, State, finite_result
from flexmb.tables.status import OK, Status
from flexmb.tables.workspaces import workspace
from flexmb.typing import Index, Real

if TYPE_CHECKING:
    from flexmb.frisch.errata import Erratum
    from flexmb.frisch.nested_system import NestedSystem

FEW_DIGITS = 4.0  # with fewer digits left there is a `PrecisionWarning`


class _Doubting(Protocol):
    """A workspace whose evaluations note small pivots."""

    @property
    def doubt(self) -> Index: ...


class Precision(NamedTuple):
    """The number of significant decimal digits, 0 to 16, that rounding leaves of the accelerations.

    status: OK, or NOT_POSITIVE_DEFINITE; fault, body: number and name of the body whose inertia is not positive
    definite, or else of the body at which most digits are lost.
    """

    status: Status
    fault: int
    body: str
    digits: float

    @property
    def is_low(self) -> bool:
        """Whether the accelerations exist, with few digits."""
        return self.status == OK and self.digits < FEW_DIGITS

    @property
    def warning(self) -> str:
        """The text of a `PrecisionWarning`."""
        return (
            f"about {self.digits:.0f} of 16 digits of the accelerations are left: the inertia that body "
            f'"{self.body}" moves is a small difference of large terms; bring masses, inertias and lengths closer '
            "together, or leave out the freedom"
        )


class ConsistentMotion(NamedTuple):
    """accelerations (nu,) for which all modal forces vanish, and the tau (nu,) of hinges and wheels for them."""

    accelerations: Real
    tau: Real


class Mechanics(SceneArrays):
    """The equations of motion of a scene, and the tables and kernels for them; each thread has workspaces of its own.

    Methods that take a `State` check it. Methods that take t and y = [q, u, work] expect that these have been checked.
    """

    def __init__(self, scene: s.Scene, elimination: Elimination, like: s.Scene | None = None) -> None:
        super().__init__(scene, elimination, like)
        self.own = Own()
        self._nested: dict[Set[Erratum], NestedSystem] = {}

    @property
    def initial_state(self) -> State:
        """The scene's state at t = 0, of the tree alone; prescribed coordinates have their functions' values."""
        return self.scene_state(0.0)

    def nested_system(self, errata: Set[Erratum]) -> NestedSystem:
        """Frisch's equations of this scene with these defects of the print, built at the first call.

        ValueError where the print does not apply: a body whose modes are not clamped at its hinge point.
        """
        from flexmb.frisch.nested_system import NestedSystem  # imported here, because other algorithms do not need it

        if errata not in self._nested:
            return self._nested.setdefault(errata, NestedSystem(self.constants, self.links, self.layout, errata))
        return self._nested[errata]

    def workspace(self) -> Workspace:
        """A new workspace for `rhs`; one per thread."""
        return workspace(self.constants, self.nq, self.nu)

    def recursion_workspace(self) -> Workspace:
        """A new workspace for `rhs` with `recursion_constants`."""
        return workspace(self.recursion_constants, self.nq, self.nu)

    def composite_workspace(self) -> composite.CompositeWorkspace:
        """A new workspace for runs by composite bodies; one per thread."""
        return composite.CompositeWorkspace(self.workspace(), matrices(self.constants))

    def mass_matrix(self, state: State) -> Real:
        """M (nu,nu), by composite bodies. ValueError for a scene with so many speeds that M would be too large."""
        refuse_large_matrix(self.nu, "the mass matrix", "use `factorise`, whose products and solutions take O(N)")
        t, y = self.layout.entering(state)
        M = np.empty((self.nu, self.nu))
        self._fill_mass_matrix(t, y, M)
        return finite_result(M, t)

    def factorise(self, state: State) -> MassMatrixFactors:
        """M = F F' by recursion: `solve`, `multiply`, their halves and `log_determinant`, each in O(N).

        Of all speeds, prescribed ones too. Raises DynamicsError where M is not positive definite.
        """
        factors = MassMatrixFactors(self.constants, self.workspace, *self.layout.entering(state))
        self.check_status(factors.status, factors.fault)
        if factors.is_doubtful:
            self._judge(self._precision(factors))
        return factors

    def digits_left(self, state: State) -> float:
        """Estimate of the significant decimal digits, 0 to 16, that rounding leaves of the accelerations of the free
        speeds.

        From the condition number of M, scaled so that units do not matter (`flexmb.jain.precision`), in O(N). It holds
        for the least favourable loads; single accelerations may be more precise. For closed chains it is that of the
        tree. Raises DynamicsError where M is not positive definite, or cannot be told from a singular matrix.
        """
        precision = self.precision(state)
        self.check_status(precision.status, precision.fault)
        return precision.digits

    def precision(self, state: State) -> Precision:
        """The same without raising where M is not positive definite."""
        return self._precision_at(*self.layout.entering(state))

    def bias(self, state: State) -> Real:
        """c (nu,) in M udot + c = tau: gyroscopic, gravity, elastic forces and node loads."""
        return self.inverse_dynamics(state, np.zeros(self.nu))

    def inverse_dynamics(self, state: State, accelerations: Real) -> Real:
        """tau (nu,) = M udot + c of accelerations (nu,), in O(N): Jain & Rodriguez (45).

        Motors can act on hinges and wheels only. Where the modal rows of tau (`modal_residual`) do not vanish, the
        accelerations are not consistent with each other, and tau is not the load that motors would have to exert.
        `consistent_inverse_dynamics` finds the modal accelerations that belong to given hinge accelerations.
        """
        t, y = self.layout.entering(state)
        return finite_result(self.inverse_at(t, y, self.layout.rates("accelerations", accelerations))[0], t)

    def modal_residual(self, state: State, accelerations: Real) -> dict[str, Real]:
        """Modal rows T^f of inverse dynamics by body: the modal forces that these accelerations would need."""
        tau = self.inverse_dynamics(state, accelerations)
        places = {name: self._modes(k) for k, name in enumerate(self.body_names)}
        return {name: tau[place] for name, place in places.items() if place.stop > place.start}

    def consistent_inverse_dynamics(self, state: State, accelerations: Real) -> ConsistentMotion:
        """Inverse dynamics for given accelerations of hinges and wheels; modal accelerations follow from zero modal
        forces.

        The modal entries of `accelerations` (nu,) are not used; those of prescribed coordinates are. Costs O(N).
        """
        t, y = self.layout.entering(state)
        used = np.where(self._is_modal, 0.0, arguments.vector("accelerations", accelerations, self.nu))
        rates = self.layout.rates("accelerations", used)
        *_, held, w = self._held.held
        self.check_status(self._held(t, y, rates), int(w.fault[0]))
        self.check_precision(t, y, w, held)
        rates = w.speed["acceleration"].copy()
        return ConsistentMotion(rates, self.inverse_dynamics(state, rates))

    def applied(self, state: State) -> Real:
        """Hinge springs, dampers and motors (nu,): the tau that M udot + c of the free motion equals."""
        t, y = self.layout.entering(state)
        self.check_status(self._accelerate(t, y))
        return finite_result(self.own_workspace.speed["applied"].copy(), t)

    def precision_if_doubtful(self, state: State) -> Precision | None:
        """`precision` of a state, None if no pivot is so small that it may consist of rounding errors.

        Small pivots are found by the right-hand side, which a run has compiled anyway. Few runs need the kernels that
        estimate the precision.
        """
        w = self.own_recursion_workspace
        t, y = self.layout.entering(state)
        status = self._recur(t, y, np.empty_like(y))
        return None if status == OK and not w.doubt[0] else self.precision(state)

    def inverse_at(self, t: float, y: Real, rates: Real) -> tuple[Real, Real]:
        """tau (nu,), and the loads (N,6) that the hinges then transmit, World axes."""
        tau, loads = np.zeros(self.nu), np.zeros((len(self.constants.body), 6))
        self._invert(t, y, rates, tau, loads)
        return tau, loads

    def in_axes(
        self, state: State, loads: dict[str, Real], axes: Axes, about: tuple[str, str] | None
    ) -> dict[str, Real]:
        """These loads, World axes, in other axes about a node, whatever they are."""
        t, y = self.layout.entering(state)
        self.inverse_at(t, y, np.zeros(self.nu))  # for the poses in the workspace, those of the equations of motion
        return referred(self, self.own_workspace, loads, axes, about)

    def by_hinge(self, loads: Real) -> dict[str, Real]:
        return {link.hinge.name: loads[k] for k, link in enumerate(self.links)}

    def _follow_recursion(self, t: float, y: Real) -> None:
        """The recursion at one state, with its errors and warnings; its results stay in its workspace."""
        w = self.own_recursion_workspace
        self.check_status(self._recur(t, y, np.empty_like(y)), int(w.fault[0]))
        self.check_precision(t, y, w)

    # Methods that fill the outputs of this thread, `observation.out`

    def observe_recursion(self, t: float, y: Real) -> None:
        """Everything observable of the free motion, by the recursion."""
        self._follow_recursion(arguments.number("t", t), self._fitting(y))
        self._observe_recursion()

    def observe_rates(self, t: float, y: Real, rates: Real) -> None:
        """Everything observable for accelerations (nu,): hinge loads by inverse dynamics, drives from the workspace."""
        out, t, y = self.observation.out, arguments.number("t", t), self._fitting(y)
        out.rates[:], out.drives[:] = rates, self.own_workspace.speed["drive"]
        out.loads[:] = self.inverse_at(t, y, out.rates)[1]
        self._observe_motion(t, y)

    def observe_motion(self, t: float, y: Real, rates: Real, drives: Real, loads: Real) -> None:
        """Everything observable, from accelerations (nu,), driving loads (nu,) and hinge loads (N,6)."""
        out = self.observation.out
        out.rates[:], out.drives[:], out.loads[:] = rates, drives, loads
        self._observe_motion(arguments.number("t", t), self._fitting(y))

    def turns(self, t: float, q: Real, u: Real) -> Real:
        """Angular velocities (N,3) rad/s of the bodies' frames, in their own axes."""
        self.observation.out.rates[:] = 0.0
        self._observe_motion(arguments.number("t", t), self._fitting(np.concatenate([q, u, [0.0]])))
        return np.array(self.own_workspace.body["velocity"][:, :3])

    def _fitting(self, y: Real) -> Real:
        """y = [q, u, work] of a length that kernels can read; its numbers are not checked."""
        return arguments.vector("y", y, self.nq + self.nu + 1)

    # Workspaces of each thread

    @per_thread
    def own_workspace(self) -> Workspace:
        """For `constants`."""
        return self.workspace()

    @per_thread
    def own_recursion_workspace(self) -> Workspace:
        """For `recursion_constants`."""
        return self.recursion_workspace()

    @per_thread
    def observation(self) -> Observation:
        """The arrays for everything observable at one state, with their names."""
        return Observation(self.observed_names, self.nu)

    @per_thread
    def own_tangent(self) -> TangentWorkspace:
        """For derivatives by dual numbers."""
        return tangent_workspace(self.constants, self.nq, self.nu)

    @per_thread
    def own_derivatives(self) -> DerivativeWorkspace:
        """For derivatives by the recursion."""
        return derivative_workspace(self.constants, self.nq, self.nu)

    @per_thread
    def own_matrices(self) -> Matrices:
        """For the mass matrix; as large as that, hence made only at the first access."""
        return matrices(self.constants)

    @per_thread
    def own_joint(self) -> Joint:
        """The further arrays that the unsplit recursion writes."""
        return unsplit.joint(self.constants)

    # Kernels bound to their tables, compiled at the first access

    @per_thread
    def _recur(self) -> Direct:
        """(t, y, dy): the right-hand side by the recursion; a status code."""
        tables = self.explicit_constants, self.own_recursion_workspace
        return direct(articulated.rhs, STATUS, REAL, VECTOR, VECTOR, *tables)

    @per_thread
    def _observe_recursion(self) -> Direct:
        """(): everything observable at the state where `_recur` was last evaluated."""
        return direct(observe, VOID, self.explicit_constants, self.own_recursion_workspace, self.observation.out)

    @per_thread
    def _transmit(self) -> Direct:
        """(loads): those of all hinges at the state where `_recur` was last evaluated."""
        return direct(transmitted, VOID, self.explicit_constants, self.own_recursion_workspace, MATRIX)

    @per_thread
    def _observe_motion(self) -> Direct:
        """(t, y): markers, wheel loads, energy and momentum for the accelerations out.rates."""
        return direct(observe_motion, VOID, REAL, VECTOR, self.constants, self.own_workspace, self.observation.out)

    @per_thread
    def _accelerate(self) -> Direct:
        """(t, y): the recursion with every body eliminated explicitly; a status code."""
        return direct(articulated.accelerations, STATUS, REAL, VECTOR, self.constants, self.own_workspace)

    @per_thread
    def _invert(self) -> Direct:
        """(t, y, rates, tau, loads)."""
        tables = self.constants, self.own_workspace
        return direct(articulated.inverse_dynamics, VOID, REAL, VECTOR, VECTOR, *tables, VECTOR, MATRIX)

    @per_thread
    def _fill_mass_matrix(self) -> Direct:
        """(t, y, M)."""
        tables = self.constants, self.own_workspace, self.own_matrices
        return direct(composite.mass_matrix, VOID, REAL, VECTOR, *tables, MATRIX)

    @per_thread
    def _held(self) -> Direct:
        """(t, y, rates): accelerations with every hinge and wheel held at `rates`; a status code."""
        tables = held_hinges(self.constants, self.workspace())
        return direct(consistent_accelerations, STATUS, REAL, VECTOR, VECTOR, self.constants, *tables)

    @kept
    def _is_modal(self) -> NDArray[np.bool_]:
        """Which entries of u (nu,) are modal."""
        flags = np.zeros(self.nu, bool)
        for k in np.flatnonzero(self.constants.body["modes"]).tolist():
            flags[self._modes(k)] = True
        return flags

    def _modes(self, k: int) -> slice:
        body = self.constants.body[k]
        return slice(int(body["etad_index"]), int(body["etad_index"] + body["modes"]))

    def _precision_at(self, t: float, y: Real, held: Constants | None = None) -> Precision:
        """`held`: the constants whose prescribed speeds are held, by default the scene's."""
        held = self.constants if held is None else held
        made = partial(workspace, held, self.nq, self.nu)
        return self._precision(MassMatrixFactors(self.constants, made, t, y, held))

    def check_precision(self, t: float, y: Real, w: _Doubting, held: Constants | None = None) -> None:
        """Estimate the precision of an evaluation that met small pivots, w.doubt; see `_judge`."""
        if w.doubt[0]:
            self._judge(self._precision_at(t, y, held))

    def _judge(self, precision: Precision) -> None:
        """DynamicsError where an inertia is not positive definite to rounding, a warning where few digits are left."""
        self.check_status(precision.status, precision.fault)
        if precision.is_low:
            warnings.warn(precision.warning, PrecisionWarning, stacklevel=4)

    def _precision(self, factors: MassMatrixFactors) -> Precision:
        if factors.status != OK:
            return Precision(Status(factors.status), factors.fault, self.body_names[factors.fault], 0.0)
        condition = factors.condition
        status = Status.NOT_POSITIVE_DEFINITE if condition.is_singular else Status.OK
        owner = _owner(self.constants, condition.speed)
        return Precision(status, owner, self.body_names[owner], condition.digits)

    def check_status(self, status: int, fault: int | None = None) -> None:
        """DynamicsError unless a status code is OK; `fault`: number of the body, by default from the workspace."""
        if status != OK:
            place = self.fault_name(status, int(self.own_workspace.fault[0]) if fault is None else fault)
            error = DynamicsError(Status(status).advice.format(body=f'"{place}"'))
            error.status = Status(status)
            raise error


def _owner(c: Constants, speed: int) -> int:
    """Number of the body to whose hinge, modes or wheels a speed belongs."""
    first, modes = c.body["u_index"], c.body["etad_index"]
    of_hinge = (first <= speed) & (speed < first + c.body["nv"])
    of_modes = (modes <= speed) & (speed < modes + c.body["modes"])
    wheel = np.flatnonzero(c.wheel["u_index"] == speed)
    of_wheel = (c.body["wheel_start"] <= wheel[0]) & (wheel[0] < c.body["wheel_stop"]) if len(wheel) else False
    return int(np.argmax(of_hinge | of_modes | of_wheel)) if len(c.body) else 0
