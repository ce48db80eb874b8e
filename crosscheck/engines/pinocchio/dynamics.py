"""Forward and hybrid dynamics of a Pinocchio tree as an ordinary differential equation.

The state is that of `FreeCoordinates`; driven coordinates are the prescribed ones, and those that stand for welds.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from crosscheck.engines.connections import Moving
from crosscheck.engines.functions_of_time import Signals
from crosscheck.engines.pinocchio.closures import PinocchioClosures, of_its_own
from crosscheck.engines.pinocchio.forces import mass_matrix, moving, on_joints
from crosscheck.engines.pinocchio.rows import PinocchioRows
from crosscheck.engines.pinocchio.tree import COUNTING, PinocchioSlot, PinocchioTree
from crosscheck.engines.rigid_tree import FreeCoordinates, JointForces, TreeEquations, TreeLoads, TreeState
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


class Dynamics(TreeEquations[PinocchioSlot]):
    """`signals` are those of the scene's controllers, which act in motors and loads."""

    def __init__(self, tree: PinocchioTree, scene: Scene, signals: Signals | None = None) -> None:
        self.tree = tree
        self.data = tree.model.createData()
        self.forces = JointForces(tree.slots, tree.model.nv, COUNTING, signals)
        self.loads = TreeLoads(scene, tree.links, tree.slots, signals)
        self.coordinates = FreeCoordinates(tree.slots, tree.model.nq, tree.model.nv, COUNTING)
        closed = () if self.driven or scene.couplings or not of_its_own(scene) else scene.closures
        self.closures = PinocchioClosures(tree, scene, closed)
        rest = () if closed else scene.closures
        self.rows = PinocchioRows(tree, scene, rest, [slot.v for slot in self.driven])
        self._ballasted = tree.model.copy()
        self._ballasted.armature[self.coordinates.driven_v] = BALLAST
        self._ballasted_data = self._ballasted.createData()
        self._moved = any(not isinstance(slot.freedom.prescribed, Constant) for slot in self.driven)

    def masses(self, q: Real) -> Real:
        """The mass matrix (nv, nv), with armatures and without ballast."""
        return mass_matrix(self.tree.model, self._ballasted_data, q)

    def link_motion(self, link: int) -> Moving:
        """How the frame of a link moves; needs the kinematics of `data` to be up to date."""
        return moving(self.data, self.tree.joints[link])

    def solve(self, t: float, state: TreeState) -> PinocchioSolution:
        """Articulated-body accelerations, or constrained ones where loops are closed, and drive loads.

        With driven coordinates, their rows of the inverse dynamics are the drives.
        """
        acting = self.acting(t, state)
        a, drive, D = self._accelerations(state, acting), np.zeros(0), self.coordinates.driven_v
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
        for speed, exerted in self.loads.along(t, state.q, state.v).values():
            tau[speed] += exerted.load
            power += exerted.power
        if not self.loads.on_links:
            return Acting(t, tau, None, power)
        on_links, working = self._on_links(t, state)
        return Acting(t, tau, on_joints(self.tree.model, self.data, on_links), power + working)

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
            tau[self.coordinates.driven_v] = BALLAST * state.driven
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
        on_links, _ = self._on_links(t, state)
        every = [*on_links, *self.closures.on_joints(), *self.rows.on_joints()]
        self.inverse(state, acceleration, on_joints(self.tree.model, self.data, every))

    def motion(self, t: float, state: TreeState) -> tuple[Real, float]:
        """Accelerations and power. Loads of drives are found only where one moves, as those of others do no work."""
        if self._moved:
            a, _, power = self.solve(t, state)
            return a, power
        acting = self.acting(t, state)
        return self._accelerations(state, acting), acting.power

    def _on_links(self, t: float, state: TreeState) -> tuple[list[tuple[int, Real]], float]:
        """Joints with the wrenches of loads at nodes and connectors between nodes, World axes, and their power (W)."""
        pin.forwardKinematics(self.tree.model, self.data, state.q, state.v)
        wrenches, power = self.loads.wrenches(t, self.link_motion)
        return [(self.tree.joints[link], wrench) for link, wrench in wrenches.items()], power
