"""Derivatives of the accelerations of a Pinocchio tree, by Pinocchio's own analytic ones.

Where all coordinates are free they are those of `computeABADerivatives`, else those of `computeRNEADerivatives` for the
accelerations of the whole motion, with the free rows and columns of the mass matrix. Both hold tau and the wrenches in
joint axes constant, so that the derivatives of springs, of dampers, and of loads in World axes are added here. Scenes
with connectors, whose laws have no derivatives here, are left out.

Pinocchio's displacements of a free flyer are [linear; angular] in outboard axes, its speeds likewise, and those of a
spherical joint the same as ours.
"""

from __future__ import annotations

from typing import assert_never

import numpy as np
import pinocchio as pin

from crosscheck.engines.conventions import rotation_vector, scalar_first
from crosscheck.engines.linear.axes import swapped_transport
from crosscheck.engines.linear.coordinates import obstacle
from crosscheck.engines.linear.matrices import LinearMatrices, exact
from crosscheck.engines.linear.slots import slot_places
from crosscheck.engines.links import Ball, Floating, Scalar
from crosscheck.engines.pinocchio.dynamics import Acting, Dynamics
from crosscheck.engines.pinocchio.forces import inverse_mass_matrix, mass_matrix
from crosscheck.engines.rigid_tree import PointLoad, TreeState
from flexmb.scene.schema import Scene
from flexmb.typing import Real


def linearised(dynamics: Dynamics, scene: Scene) -> PinocchioLinear | None:
    """None for scenes whose derivatives are not offered."""
    return None if obstacle(scene) or scene.connectors else PinocchioLinear(dynamics, scene)


class PinocchioLinear:
    def __init__(self, dynamics: Dynamics, scene: Scene) -> None:
        self._dynamics = dynamics
        self._model = dynamics.tree.model
        self._data = self._model.createData()
        slots = slot_places(scene, dynamics.tree.slots, self._model.nv, linear_first=True)
        self._places = slots.places
        self._turning, self._moving = [slot.v for slot in slots.balls], [slot.v for slot in slots.flying]
        self._free = not dynamics.driven

    def at(self, t: float, state: TreeState) -> LinearMatrices:
        """The derivatives at a state, in the order that all engines share."""
        acting = self._dynamics.acting(t, state)
        a = self._dynamics.solve(t, state).acceleration
        by_q, by_v, by_force = self._of_all(state, acting) if self._free else self._of_free(state, acting, a)
        place = self._places
        transport = swapped_transport(state.v, self._turning, self._moving)[np.ix_(place, place)]
        return exact(by_q, by_v, by_force, transport, state.v, a)

    def _of_all(self, state: TreeState, acting: Acting) -> tuple[Real, Real, Real]:
        """By forward dynamics: derivatives by displacements, speeds and forces."""
        extra = () if acting.wrenches is None else (acting.wrenches,)
        pin.computeABADerivatives(self._model, self._data, state.q, state.v, acting.tau, *extra)
        inverse = inverse_mass_matrix(self._data)
        by_q = self._data.ddq_dq + inverse @ self._pull(state, acting)
        by_v = self._data.ddq_dv + inverse @ self._drag(state)
        square = np.ix_(self._places, self._places)
        return by_q[square], by_v[square], inverse[square]

    def _of_free(self, state: TreeState, acting: Acting, a: Real) -> tuple[Real, Real, Real]:
        """The same by inverse dynamics, of the coordinates that no function of time drives."""
        extra = () if acting.wrenches is None else (acting.wrenches,)
        by_q, by_v, _ = pin.computeRNEADerivatives(self._model, self._data, state.q, state.v, a, *extra)
        by_q, by_v = by_q.copy(), by_v.copy()
        M = mass_matrix(self._model, self._data, state.q)
        square = np.ix_(self._places, self._places)
        inverse = np.linalg.inv(M[square])
        pull, drag = self._pull(state, acting)[square], self._drag(state)[square]
        return inverse @ (pull - by_q[square]), inverse @ (drag - by_v[square]), inverse

    def _pull(self, state: TreeState, acting: Acting) -> Real:
        """d tau/d xi (nv,nv) of springs and of loads in World axes."""
        stiffness = np.zeros((self._model.nv, self._model.nv))
        for slot in self._dynamics.tree.slots:
            match slot.freedom:
                case Scalar(stiffness=k):
                    stiffness[slot.v, slot.v] -= k
                case Ball(stiffness=k):
                    turn = rotation_vector(scalar_first(state.q[slot.q : slot.q + 4]))
                    stiffness[slot.v : slot.v + 3, slot.v : slot.v + 3] -= k * pin.Jlog3(pin.exp3(turn))
                case Floating():
                    pass  # free flight has no spring
                case _:
                    assert_never(slot.freedom)
        if acting.wrenches is not None:
            pin.computeJointJacobians(self._model, self._data, state.q)
            for link, load in self._dynamics.loads.at_nodes:
                if load.fixed_in_world:
                    joint = self._dynamics.tree.joints[link]
                    J = pin.getJointJacobian(self._model, self._data, joint, pin.ReferenceFrame.LOCAL)
                    stiffness += J.T @ _turned(load, acting.t, self._data.oMi[joint].rotation) @ J[3:]
        return stiffness

    def _drag(self, state: TreeState) -> Real:
        """d tau/d v (nv,nv) of dampers."""
        forces = np.zeros(self._model.nv)
        for slot in self._dynamics.tree.slots:
            match slot.freedom:
                case Scalar(damping=c):
                    forces[slot.v] -= c
                case Ball(damping=c):
                    forces[slot.v : slot.v + 3] -= c
                case Floating():
                    pass
                case _:
                    assert_never(slot.freedom)
        return np.diag(forces)


def _turned(load: PointLoad, t: float, R: Real) -> Real:
    """d [force; torque]/d xi_w (6,3) of a load f of World, in joint axes that turn by xi_w: they see it turn back, and
    df = f x xi_w."""
    force = pin.skew(R.T @ load.vector(t))
    return np.vstack([force, pin.skew(load.point) @ force]) if load.is_force else np.vstack([np.zeros((3, 3)), force])
