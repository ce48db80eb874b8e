"""Forward and hybrid dynamics of a Pinocchio tree as an ordinary differential equation.

State y = [free coordinates, free speeds, work]. Quaternions are integrated as four numbers: qdot is linear in q, so the
norm is an invariant of the exact flow, and everything else uses the normalised q. Driven coordinates (prescribed ones,
and the fixed ones that stand for welds) follow their functions of time.
"""

from __future__ import annotations

from typing import NamedTuple, assert_never

import numpy as np
import pinocchio as pin

from crosscheck.engines.conventions import quaternion_rate, scalar_first, scalar_last
from crosscheck.engines.functions_of_time import profile
from crosscheck.engines.links import Ball, Floating, Scalar
from crosscheck.engines.pinocchio.closures import PinocchioClosures
from crosscheck.engines.pinocchio.connections import PinocchioConnections
from crosscheck.engines.pinocchio.couplings import PinocchioCouplings
from crosscheck.engines.pinocchio.forces import JointForces, PlacedLoads
from crosscheck.engines.pinocchio.tree import PinocchioSlot, PinocchioTree, initial_state, places
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
    """Generalised forces (nv,), wrenches on joints and power (W) at time t (s) of all that acts but gravity and drives.
    """

    t: float
    tau: Real
    wrenches: pin.StdVec_Force | None
    power: float


class PinocchioState(NamedTuple):
    """q (nq,) with unit quaternions, v (nv,), driven accelerations (d,)."""

    q: Real
    v: Real
    driven: Real


class Dynamics:
    def __init__(self, tree: PinocchioTree, scene: Scene) -> None:
        self.tree = tree
        self.data = tree.model.createData()
        self.forces = JointForces(tree)
        self.loads = PlacedLoads(tree, scene)
        self.closures = PinocchioClosures(tree, scene)
        self.connections = PinocchioConnections(tree, scene)
        self.driven: list[PinocchioSlot] = [slot for slot in tree.slots if slot.driven]
        self.couplings = PinocchioCouplings(tree, scene, [slot.v for slot in self.driven])
        self._motions = [profile(slot.freedom.prescribed) for slot in self.driven]
        driven_q, driven_v = [slot.q for slot in self.driven], [slot.v for slot in self.driven]
        free_q = np.setdiff1d(np.arange(tree.model.nq), driven_q)
        self._free_count = len(free_q)
        self._driven_q, self._driven_v = places(driven_q), places(driven_v)
        self._free_q, self._free_v = places(free_q), places(np.setdiff1d(np.arange(tree.model.nv), driven_v))
        self._ballasted = tree.model.copy()
        self._ballasted.armature[self._driven_v] = BALLAST
        self._ballasted_data = self._ballasted.createData()
        scalars = [slot for slot in tree.slots if isinstance(slot.freedom, Scalar)]
        self._scalar_q, self._scalar_v = places([slot.q for slot in scalars]), places([slot.v for slot in scalars])
        turning = [slot for slot in tree.slots if not isinstance(slot.freedom, Scalar)]
        self._turning = [(slot, int(np.searchsorted(free_q, _quaternion_start(slot)))) for slot in turning]
        self._undriven = np.zeros(0)
        self._moved = any(not isinstance(slot.freedom.prescribed, Constant) for slot in self.driven)
        self._plain = not self.driven and not turning

    def initial(self) -> Real:
        q, v = initial_state(self.tree)
        return np.concatenate([q[self._free_q], v[self._free_v], [0.0]])

    def state(self, t: float, y: Real) -> PinocchioState:
        if self._plain:
            return PinocchioState(y[: self._free_count], y[self._free_count : -1], self._undriven)
        q, v = np.empty(self.tree.model.nq), np.empty(self.tree.model.nv)
        split = self._free_count
        q[self._free_q], v[self._free_v] = y[:split], y[split:-1]
        driven = self._undriven
        if self._motions:
            motion = np.array([each(t) for each in self._motions])
            q[self._driven_q], v[self._driven_v], driven = motion[:, 0], motion[:, 1], motion[:, 2]
        for slot, _ in self._turning:
            quaternion = q[(start := _quaternion_start(slot)) : start + 4]
            quaternion /= np.sqrt(quaternion @ quaternion)
        return PinocchioState(q, v, driven)

    def solve(self, t: float, state: PinocchioState) -> PinocchioSolution:
        """Articulated-body accelerations, or constrained ones where loops are closed, and drive loads.

        With driven coordinates, their rows of the inverse dynamics are the drives.
        """
        acting = self.acting(t, state)
        a, drive, D = self._accelerations(state, acting), self._undriven, self._driven_v
        if self.driven:
            drive = self.inverse(state, a, acting.wrenches)[D] - acting.tau[D]
        return PinocchioSolution(a, drive, acting.power + float(drive @ state.v[D]))

    def acting(self, t: float, state: PinocchioState) -> Acting:
        """With the loads of couplings, whose power is zero."""
        acting = self._applied(t, state)
        if not self.couplings:
            return acting
        efforts = self.couplings.efforts(state.q, self._accelerations(state, acting))
        return acting._replace(tau=acting.tau + efforts)

    def _applied(self, t: float, state: PinocchioState) -> Acting:
        tau, power = self.forces.springs(state.q), 0.0
        if self.forces.loses:
            lost = self.forces.dampers_and_motors(t, state.v)
            tau, power = tau + lost, float(lost @ state.v)
        for speed, each in self.connections.along(t, state.q, state.v).values():
            tau[speed] += each.load
            power += each.power
        if not (self.loads or self.connections):
            return Acting(t, tau, None, power)
        wrenches, working = self._wrenches(t, state)
        return Acting(t, tau, wrenches, power + working)

    def _accelerations(self, state: PinocchioState, acting: Acting) -> Real:
        if self.closures:  # nothing is driven beside them
            return self.closures.solve(state.q, state.v, acting.tau + self._generalised(state, acting.wrenches))
        return self._hybrid(state, acting.tau, acting.wrenches)

    def _hybrid(self, state: PinocchioState, tau: Real, wrenches: pin.StdVec_Force | None) -> Real:
        """Accelerations (nv,) of a tree with driven coordinates.

        Hybrid dynamics as a limit: a driven joint has the armature `BALLAST` and the effort BALLAST * acceleration, so
        nothing else moves it. Its acceleration is off by the drive load / BALLAST, which is below round-off.
        """
        if self.driven:
            tau = tau.copy()
            tau[self._driven_v] = BALLAST * state.driven
        extra = () if wrenches is None else (wrenches,)
        return np.asarray(pin.aba(self._ballasted, self._ballasted_data, state.q, state.v, tau, *extra))

    def _generalised(self, state: PinocchioState, wrenches: pin.StdVec_Force | None) -> Real:
        """(nv,) of wrenches on joints: constrained dynamics takes none, so they become efforts."""
        if wrenches is None:
            return np.zeros(self.tree.model.nv)
        still, data = np.zeros(self.tree.model.nv), self._ballasted_data
        without = pin.rnea(self.tree.model, data, state.q, still, still).copy()
        return without - pin.rnea(self.tree.model, data, state.q, still, still, wrenches)

    def inverse(self, state: PinocchioState, acceleration: Real, wrenches: pin.StdVec_Force | None) -> Real:
        """Generalised forces of the whole motion; leaves the joint wrenches in `data.f`."""
        extra = () if wrenches is None else (wrenches,)
        return pin.rnea(self.tree.model, self.data, state.q, state.v, acceleration, *extra)

    def resolve_loads(self, t: float, state: PinocchioState, acceleration: Real) -> None:
        """Fill `data.f` with the wrench of parent on child of every joint, in joint axes about the joint origin."""
        wrenches = self._wrenches(t, state)[0] if self.loads or self.connections else None
        if self.closures:
            closing = self.closures.on_joints()
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
        if self._plain:
            return np.concatenate([state.v, a, [power]])
        qdot = np.empty(self.tree.model.nq)
        qdot[self._scalar_q] = state.v[self._scalar_v]
        for slot, first in self._turning:
            self._turning_rate(slot, y[first : first + 4], state, qdot)
        return np.concatenate([qdot[self._free_q], a[self._free_v], [power]])

    def _turning_rate(self, slot: PinocchioSlot, own: Real, state: PinocchioState, qdot: Real) -> None:
        """Rates of ball and free-flyer coordinates; the quaternion's `own` (not normalised) value enters its rate."""
        start = _quaternion_start(slot)
        match slot.freedom:
            case Ball():
                omega = state.v[slot.v : slot.v + 3]
            case Floating():
                linear, omega = state.v[slot.v : slot.v + 3], state.v[slot.v + 3 : slot.v + 6]
                qdot[slot.q : slot.q + 3] = pin.Quaternion(state.q[start : start + 4]).toRotationMatrix() @ linear
            case Scalar():
                return  # without a quaternion the rates are the speeds
            case _:
                assert_never(slot.freedom)
        qdot[start : start + 4] = scalar_last(quaternion_rate(scalar_first(own).tolist(), omega.tolist()))

    def _wrenches(self, t: float, state: PinocchioState) -> tuple[pin.StdVec_Force, float]:
        """Of loads at nodes and connectors between nodes, and their power (W)."""
        pin.forwardKinematics(self.tree.model, self.data, state.q, state.v)
        wrenches, power = self.loads.wrenches(t, self.data)
        return wrenches, power + self.connections.add(t, self.data, wrenches)


def _quaternion_start(slot: PinocchioSlot) -> int:
    match slot.freedom:
        case Ball():
            return slot.q
        case Floating():
            return slot.q + 3
        case Scalar():
            raise ValueError(f'"{slot.link.joint}" has no quaternion')
        case _:
            assert_never(slot.freedom)
