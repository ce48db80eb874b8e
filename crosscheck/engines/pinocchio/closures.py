"""Closed loops in Pinocchio: constrained dynamics with welds and ball joints, their loads as wrenches on joints."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pinocchio as pin

from crosscheck.engines.links import closed_frames
from crosscheck.engines.pinocchio.forces import ClosedLoad, on_both_sides
from crosscheck.engines.pinocchio.tree import PinocchioTree, placement
from flexmb.scene.schema import Closure, Scene
from flexmb.typing import Real

# Proximal iterations stop at a residual: absolute, relative, regularisation, the most iterations. Regularised by 1e-12,
# loops without redundant closures converge in two or three.
_PROXIMAL = (1e-15, 1e-15, 1e-12, 100)


def of_its_own(scene: Scene) -> bool:
    """Whether Pinocchio has joints of its own for all closures of a scene."""
    return all(closure.type in ("weld", "spherical") for closure in scene.closures)


class PinocchioClosures:
    """Closures of a scene on its tree. `solve` leaves their loads for `loads` and `on_joints`."""

    def __init__(self, tree: PinocchioTree, scene: Scene, closures: Sequence[Closure]) -> None:
        self._model, self._names = tree.model, [closure.name for closure in closures]
        self._constraints = pin.StdVec_RigidConstraintModel()
        self._sides: list[tuple[int, int]] = []
        for closure in closures:
            kind = pin.ContactType.CONTACT_6D if closure.type == "weld" else pin.ContactType.CONTACT_3D
            ends = closed_frames(scene, tree.links, closure)
            joints = tuple(tree.joints[at.link] if at.link >= 0 else 0 for at in ends)
            (a, at_a), (b, at_b) = zip(joints, (placement(at.frame) for at in ends), strict=True)
            frame = pin.ReferenceFrame.LOCAL
            self._constraints.append(pin.RigidConstraintModel(kind, tree.model, a, at_a, b, at_b, frame))
            self._sides.append((a, b))
        self._data = tree.model.createData()
        self._solved = pin.StdVec_RigidConstraintData()
        for constraint in self._constraints:
            self._solved.append(constraint.createData())
        pin.initConstraintDynamics(tree.model, self._data, self._constraints, self._solved)
        self._settings = pin.ProximalSettings(*_PROXIMAL)

    def __bool__(self) -> bool:
        return bool(self._names)

    def solve(self, q: Real, v: Real, tau: Real) -> Real:
        """Accelerations (nv,) that keep the closures closed under generalised forces tau (nv,)."""
        accelerations = pin.constraintDynamics(
            self._model, self._data, q, v, tau, self._constraints, self._solved, self._settings
        )
        return np.array(accelerations)

    def loads(self) -> dict[str, Real]:
        """[torque; force] (6,) on body_b about frame B, World axes, of the state solved last."""
        return {name: load.wrench for name, load in zip(self._names, self._closed(), strict=True)}

    def on_joints(self) -> Iterator[tuple[int, Real]]:
        """The same on both sides' joints about their origins."""
        return on_both_sides(self._data, self._closed())

    def _closed(self) -> list[ClosedLoad]:
        """By closure; Pinocchio's force is that on A, in its axes."""
        loads = []
        for solved, sides in zip(self._solved, self._sides, strict=True):
            R, force = solved.oMc1.rotation, solved.contact_force
            wrench = -np.concatenate([R @ force.angular, R @ force.linear])
            loads.append(ClosedLoad(wrench, solved.oMc2.translation.copy(), sides))
        return loads
