"""Hybrid dynamics of an OpenSim tree as an ordinary differential equation.

The state is that of `FreeCoordinates`, speeds of ball and free joints in outboard axes. Drives and couplings keep rows
of Simbody's accelerations, J u' = c. Their loads f follow from its inverse mass matrix, J M^-1 J' f = c - J u', where
u' are the accelerations without them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import opensim

from crosscheck.engines.conventions import cross, shift_wrench
from crosscheck.engines.opensim.tree import OpensimSlot, OpensimTree, angles, outboard_rotation, spatial, vector
from crosscheck.engines.rigid_tree import (
    FreeCoordinates,
    JointForces,
    TreeEquations,
    TreeLoads,
    TreeState,
    placed_couplings,
    places,
    scalars,
)
from flexmb.scene.schema import Scene
from flexmb.typing import Real

DEPENDENT = 1e-12
"""Rows whose singular value, in units of each row's own inertia, is this part of the greatest say nothing new."""


class OpensimSolution(NamedTuple):
    """Accelerations (nv,), loads of drives (d,) and couplings (c,), power (W) of all but springs and gravity."""

    acceleration: Real
    drive: Real
    coupling: Real
    power: float


class OpensimDynamics(TreeEquations[OpensimSlot]):
    def __init__(self, tree: OpensimTree, scene: Scene) -> None:
        self.tree = tree
        self.forces = JointForces(tree.slots, tree.nv)
        self.loads = TreeLoads(scene, tree.links, tree.slots)
        self.couplings = placed_couplings(scene, tree.slots)
        self.coordinates = FreeCoordinates(tree.slots, tree.nq, tree.nv)
        self._scalar_places = places([slot.place for slot in scalars(tree.slots)])
        self._matter = tree.model.getMatterSubsystem()
        single = np.eye(tree.nv)[self.coordinates.driven_v]
        self._rows = np.concatenate([single, *(each.row(tree.nv)[None] for each in self.couplings)])

    def solve(self, t: float, state: TreeState) -> OpensimSolution:
        """Accelerations and the loads of what is kept; the model's state has all of it, with the joints' loads."""
        u = self._speeds(state)
        self._place(t, state.q, u)
        lost = self.forces.dampers_and_motors(t, u)
        tau, power = self.forces.springs(state.q) + lost, float(lost @ u)
        for speed, each in self.loads.along(t, state.q, u).values():
            tau[speed] += each.load
            power += each.power
        wrenches, working = self._wrenches(t)
        a, kept = self._realized(tau, wrenches), np.zeros(len(self._rows))
        if len(self._rows):
            wanted = np.concatenate([state.driven, np.zeros(len(self.couplings))])
            kept = self._keeping(wanted - self._rows @ a)
            a = self._realized(tau + self._rows.T @ kept, wrenches)
        drive, coupling = np.split(kept, [len(self.driven)])
        power += working + float(drive @ u[self.coordinates.driven_v])
        return OpensimSolution(a, drive, coupling, power)

    def motion(self, t: float, state: TreeState) -> tuple[Real, float]:
        solution = self.solve(t, state)
        return self.outboard(state, solution.acceleration), solution.power

    def outboard(self, state: TreeState, acceleration: Real) -> Real:
        """The rates (nv,) of the scene's speeds, of Simbody's: those of components in outboard axes."""
        vdot = acceleration.copy()
        for slot, _, _, turning, moving in self.coordinates.turning:
            R = outboard_rotation(slot, state.q)
            vdot[turning] = R.T @ vdot[turning]
            if moving is not None:
                vdot[moving] = R.T @ vdot[moving] - cross(state.v[turning], state.v[moving])
        return vdot

    def inverse_mass(self, state: TreeState) -> Real:
        """The inverse mass matrix (nv, nv) of the scene's speeds, in a state that was solved last."""
        axes = np.eye(self.tree.nv)  # Simbody's speeds of the scene's
        for slot, *_ in self.coordinates.turning:
            R = outboard_rotation(slot, state.q)
            for first in range(slot.v, slot.v + slot.freedom.sizes[1], 3):
                axes[first : first + 3, first : first + 3] = R
        return axes.T @ self._responses(axes.T)

    def closing(self) -> dict[str, Real]:
        """[torque; force] (6,) of closures on body_b about frame B, World axes, in the state of the model."""
        tree, loads = self.tree, {}
        for closure in tree.closures:
            own, every = np.zeros(tree.state.getNMultipliers()), tree.state.getMultipliers().to_numpy()
            own[closure.multipliers] = every[closure.multipliers]
            on_bodies, on_speeds = opensim.VectorOfSpatialVec(), opensim.Vector()
            self._matter.calcConstraintForcesFromMultipliers(tree.state, vector(own), on_bodies, on_speeds)
            place, arm = 0, closure.b.frame.position
            if closure.b.link >= 0:
                place = int(tree.bodies[closure.b.link].getMobilizedBodyIndex())
                arm = tree.motion(closure.b.link).rotation @ arm
            # Simbody's forces of constraints stand beside those of inertia, with the same sign.
            loads[closure.name] = -shift_wrench(spatial(on_bodies.get(place)), -arm)
        return loads

    def _speeds(self, state: TreeState) -> Real:
        """Simbody's speeds (nv,) of the scene's."""
        u = state.v.copy()
        for slot, *_ in self.coordinates.turning:
            R, (_, count) = outboard_rotation(slot, state.q), slot.freedom.sizes
            own = slice(slot.v, slot.v + count)
            u[own] = (u[own].reshape(-1, 3) @ R.T).ravel()
        return u

    def _place(self, t: float, q: Real, u: Real) -> None:
        """Put the model's state at the scene's coordinates (nq,) and Simbody's speeds (nv,), and realize it to them."""
        model, state, coordinates = self.tree.model, self.tree.state, self.coordinates
        own = np.zeros(state.getNQ())
        own[self._scalar_places] = q[coordinates.scalar_q]
        for slot, *_, moving in coordinates.turning:
            own[slot.place : slot.place + 3] = angles(outboard_rotation(slot, q))
            if moving is not None:
                own[slot.place + 3 : slot.place + 6] = q[slot.q : slot.q + 3]
        state.setTime(t)
        state.setQ(vector(own))
        state.setU(vector(u))
        model.realizeVelocity(state)

    def _realized(self, tau: Real, wrenches: Real) -> Real:
        """Accelerations (nv,) under generalised forces (nv,) and wrenches (n, 6), to which the state is realized."""
        model, state = self.tree.model, self.tree.state
        model.setControls(state, vector(np.concatenate([tau[self.tree.actuated], wrenches.ravel()])))
        model.realizeAcceleration(state)
        return np.array(state.getUDot().to_numpy())

    def _keeping(self, missing: Real) -> Real:
        """Loads (G,) of the rows that make up for missing accelerations (G,); the least where rows are redundant.

        Closures stay closed under them: their rows miss nothing.
        """
        rows = np.concatenate([self._rows, self._closed()])
        flexibility, change = rows @ self._responses(rows), np.zeros(len(rows))
        change[: len(missing)] = missing
        unit = 1.0 / np.sqrt(np.diag(flexibility))
        loads = unit * np.linalg.lstsq(unit[:, None] * flexibility * unit, unit * change, rcond=DEPENDENT)[0]
        return loads[: len(missing)]

    def _responses(self, rows: Real) -> Real:
        """M^-1 (nv, G) of generalised forces (G, nv)."""
        responses, column = np.empty((self.tree.nv, len(rows))), opensim.Vector()
        for k, row in enumerate(rows):
            self._matter.multiplyByMInv(self.tree.state, vector(row), column)
            responses[:, k] = column.to_numpy()
        return responses

    def _closed(self) -> Real:
        """Simbody's Jacobian (m, nv) of the closures."""
        if not self.tree.closures:
            return np.zeros((0, self.tree.nv))
        jacobian = opensim.Matrix()
        self._matter.calcG(self.tree.state, jacobian)
        return np.array(jacobian.to_numpy())

    def _wrenches(self, t: float) -> tuple[Real, float]:
        """Of loads at nodes and connectors between nodes on the links `loaded` (n, 6), and their power (W)."""
        wrenches, power = self.loads.wrenches(t, self.tree.motion)
        return np.array([wrenches[link] for link in self.tree.loaded]).reshape(-1, 6), power
