"""Couplings of coordinates in Pinocchio: their loads from its mass matrix, as one more set of efforts."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from crosscheck.engines.pinocchio.tree import PinocchioTree
from crosscheck.engines.rigid_tree import placed_couplings
from flexmb.scene.schema import Scene
from flexmb.typing import Real


class PinocchioCouplings:
    """The couplings of a scene on its tree. `efforts` leaves their loads for `loads`."""

    def __init__(self, tree: PinocchioTree, scene: Scene, driven: list[int]) -> None:
        """`driven`: speeds whose accelerations are given."""
        self._placed, nv = placed_couplings(scene, tree.slots), tree.model.nv
        at = {slot.v: joint for joint, slot in enumerate(tree.slots, 1)}  # the joint of World comes first
        self._joints = [at[each.slots[0].v] for each in self._placed]
        self._model, self._data = tree.model, tree.model.createData()
        self._J = np.array([each.row(nv) for each in self._placed]).reshape(-1, nv)
        self._free = np.setdiff1d(np.arange(nv), driven)
        self._load = np.zeros(len(self._placed))

    def __bool__(self) -> bool:
        return bool(self._placed)

    def efforts(self, q: Real, accelerations: Real) -> Real:
        """(nv,) generalised forces that keep the relations, from the accelerations (nv,) without them.

        J M^-1 J' f = -J a with the mass matrix of the free speeds; the least f where couplings are redundant.
        """
        M = pin.crba(self._model, self._data, q)
        M = np.triu(M) + np.triu(M, 1).T
        J = self._J[:, self._free]
        response = np.linalg.solve(M[np.ix_(self._free, self._free)], J.T)
        self._load = -np.linalg.lstsq(J @ response, self._J @ accelerations, rcond=1e-12)[0]
        return self._J.T @ self._load

    def loads(self, data: pin.Data) -> dict[str, Real]:
        """[torque; force] (6,) by coupling along the axis of what it leads, World axes, of the state solved last."""
        return {
            each.name: each.load(size, data.oMi[joint].rotation @ each.slots[0].freedom.axis)
            for each, joint, size in zip(self._placed, self._joints, self._load.tolist(), strict=True)
        }
