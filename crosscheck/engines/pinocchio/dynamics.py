"""Forward and hybrid dynamics of a Pinocchio tree as an ordinary differential equation.

The state is that of `FreeCoordinates`; driven coordinates are the prescribed ones, and those that stand for welds.
"""

from __future__ import annotations

from typing import NamedTuple, assert_never

import numpy as np
import pinocchio as pin

from crosscheck.engines.conventions import quaternion_rate, scalar_first, scalar_last
from crosscheck.engines.functions_of_time import Signals
from crosscheck.engines.links import Ball, Floating, Scalar
from crosscheck.engines.pinocchio.closures import PinocchioClosures, of_its_own
from crosscheck.engines.pinocchio.forces import PinocchioConnections, PlacedLoads
from crosscheck.engines.pinocchio.rows import PinocchioRows
from crosscheck.engines.pinocchio.tree import PinocchioSlot, PinocchioTree, initial_state
from crosscheck.engines.rigid_tree import FreeCoordinates, JointForces, Slot, TreeState
from flexmb.scene.functions import Constant
from flexmb.scene.schema import Scene
from flexmb.typing import Real

BALLAST = 1e20
"""kg m^2 or kg: so large that drive loads of any scene, divided by it, are below round-off of the accelerations."""


class PinocchioSolution(NamedTuple):
    """Accelerations (nv,), loads of the driven coordinates (d,), power of drives, motors, dampers and loads (W)."""

    acceleration: Real
    drive: Real
    power: float


class Acting(NamedTuple):
    """Generalised forces (nv,), wrenches on joints and power (W) at t (s) of all that acts but gravity and drives."""

    t: float
    tau: Real
    wrenches: pin.StdVec_Force | None
    power: float


class Dynamics:
    """`signals` are those of the scene's controllers, which act in motors and loads."""

    def __init__(self, tree: PinocchioTree, scene: Scene, signals: Signals | None = None) -> None:
        self.tree = tree
        self.data = tree.model.createData()
        self.forces = JointForces(tree.slots, tree.model.nv, scalar_first, signals)
        self.loads = PlacedLoads(tree, scene, signals)
        self.connections = PinocchioConnections(tree, scene)
        self._coordinates = FreeCoordinates(tree.slots, tree.model.nq, tree.model.nv)
        self.driven: list[PinocchioSlot] = self._coordinates.driven
        closed = () if self.driven or scene.couplings or not of_its_own(scene) else scene.closures
        self.closures = PinocchioClosures(tree, scene, closed)
        rest = () if closed else scene.closures
        self.rows = PinocchioRows(tree, scene, rest, [slot.v for slot in self.driven])
        self._ballasted = tree.model.copy()
        self._ballasted.armature[self._coordinates.driven_v] = BALLAST
        self._ballasted_data = self._ballasted.createData()
        self._moved = any(not isinstance(slot.freedom.prescribed, Constant) for slot in self.driven)

    def initial(self) -> Real:
        return self._coordinates.packed(*initial_state(self.tree))

    def packed(self, q: Real, v: Real) -> Real:
        """y of a state of all coordinates, before any work was done."""
        return self._coordinates.packed(q, v)

    def state(self, t: float, y: Real) -> TreeState:
        return self._coordinates.state(t, y)

    def masses(self, q: Real) -> Real:
        """The mass matrix (nv, nv), with armatures and without ballast."""
        upper = np.triu(pin.crba(self.tree.model, self._ballasted_data, q))
        return np.asarray(upper + np.triu(upper, 1).T)

    def solve(self, t: float, state: TreeState) -> PinocchioSolution:
        """Articulated-body accelerations, or constrained ones where loops are closed, and drive loads.

        With driven coordinates, their rows of the inverse dynamics are the drives.
        """
        acting = self.acting(t, state)
        a, drive, D = self._accelerations(state, acting), np.zeros(0), self._coordinates.driven_v
        if self.driven:
            drive = self.inverse(state, a, acting.wrenches)[D] - acting.tau[D]
        return PinocchioSolution(a, drive, acting.power + float(drive @ state.v[D]))

    def acting(self, t: float, state: TreeState) -> Acting:
        """With the loads of rows, whose power is zero."""
        acting = self._applied(t, state)
        if not self.rows:
            return acting
        efforts = self.rows.efforts(state, self._accelerations(state, acting))
        return acting._replace(tau=acting.tau + efforts)

    def _applied(self, t: float, state: TreeState) -> Acting:
        tau, power = self.forces.springs(state.q), 0.0
        if self.forces.loses:
            lost = self.forces.dampers_and_motors(t, state.v)
            tau, power = tau + lost, float(lost @ state.v)
        for speed, exerted in self.connections.along(t, state.q, state.v).values():
            tau[speed] += exerted.load
            power += exerted.power
        if not (self.loads or self.connections):
            return Acting(t, tau, None, power)
        wrenches, working = self._wrenches(t, state)
        return Acting(t, tau, wrenches, power + working)

    def _accelerations(self, state: TreeState, acting: Acting) -> Real:
        if self.closures:  # nothing is driven beside them
            return self.closures.solve(state.q, state.v, acting.tau + self._generalised(state, acting.wrenches))
        return self._hybrid(state, acting.tau, acting.wrenches)

    def _hybrid(self, state: TreeState, tau: Real, wrenches: pin.StdVec_Force | None) -> Real:
        """Accelerations (nv,) of a tree with driven coordinates.

        Hybrid dynamics as a limit: a driven joint has the armature `BALLAST` and the effort BALLAST * acceleration, so
        nothing else moves it. Its acceleration is off by the drive load / BALLAST, which is below round-off.
        """
        if self.driven:
            tau = tau.copy()
            tau[self._coordinates.driven_v] = BALLAST * state.driven
        extra = () if wrenches is None else (wrenches,)
        return np.asarray(pin.aba(self._ballasted, self._ballasted_data, state.q, state.v, tau, *extra))

    def _generalised(self, state: TreeState, wrenches: pin.StdVec_Force | None) -> Real:
        """(nv,) of wrenches on joints: constrained dynamics takes none, so they become efforts."""
        if wrenches is None:
            return np.zeros(self.tree.model.nv)
        still, data = np.zeros(self.tree.model.nv), self._ballasted_data
        without = pin.rnea(self.tree.model, data, state.q, still, still).copy()
        return without - pin.rnea(self.tree.model, data, state.q, still, still, wrenches)

    def inverse(self, state: TreeState, acceleration: Real, wrenches: pin.StdVec_Force | None) -> Real:
        """Generalised forces of the whole motion; leaves the joint wrenches in `data.f`."""
        extra = () if wrenches is None else (wrenches,)
        return pin.rnea(self.tree.model, self.data, state.q, state.v, acceleration, *extra)

    def resolve_loads(self, t: float, state: TreeState, acceleration: Real) -> None:
        """Fill `data.f` with the wrench of parent on child of every joint, in joint axes about the joint origin."""
        wrenches = self._wrenches(t, state)[0] if self.loads or self.connections else None
        closing = self.closures.on_joints() if self.closures else self.rows.on_joints() if self.rows else None
        if closing is not None:
            for joint, applied in enumerate(wrenches or ()):
                closing[joint] = closing[joint] + applied
            wrenches = closing
        self.inverse(state, acceleration, wrenches)

    def rate(self, t: float, y: Real) -> Real:
        """dy/dt. The loads of drives are found only where one moves, as those of others do no work."""
        state = self.state(t, y)
        if self._moved:
            a, _, power = self.solve(t, state)
        else:
            acting = self.acting(t, state)
            a, power = self._accelerations(state, acting), acting.power
        coordinates = self._coordinates
        if coordinates.plain:
            return np.concatenate([state.v, a, [power]])
        qdot = np.empty(self.tree.model.nq)
        qdot[coordinates.scalar_q] = state.v[coordinates.scalar_v]
        for slot, place, own in coordinates.turning:
            qdot[place] = self._turning_rate(slot, place, y[own], state, qdot)
        return coordinates.rate(qdot, a, power)

    def _turning_rate(self, slot: Slot, place: slice, own: Real, state: TreeState, qdot: Real) -> Real:
        """Rate (4,) of a quaternion, which its `own` (not normalised) value enters, and of a free flyer's position."""
        match slot.freedom:
            case Ball():
                omega = state.v[slot.v : slot.v + 3]
            case Floating():
                linear, omega = state.v[slot.v : slot.v + 3], state.v[slot.v + 3 : slot.v + 6]
                qdot[slot.q : slot.q + 3] = pin.Quaternion(state.q[place]).toRotationMatrix() @ linear
            case Scalar():
                raise ValueError(f'"{slot.link.joint}" has no quaternion')
            case _:
                assert_never(slot.freedom)
        return scalar_last(quaternion_rate(scalar_first(own).tolist(), omega.tolist()))

    def _wrenches(self, t: float, state: TreeState) -> tuple[pin.StdVec_Force, float]:
        """Of loads at nodes and connectors between nodes, and their power (W)."""
        pin.forwardKinematics(self.tree.model, self.data, state.q, state.v)
        wrenches, power = self.loads.wrenches(t, self.data)
        return wrenches, power + self.connections.add(t, self.data, wrenches)
