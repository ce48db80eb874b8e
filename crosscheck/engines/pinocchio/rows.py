"""What closures and couplings keep, as rows on a Pinocchio tree: their loads from its Jacobians and its mass matrix.

Pinocchio's own constrained dynamics closes loops by welds and ball joints of trees without prescribed coordinates
(`crosscheck.engines.pinocchio.closures`). All else is here: joints that keep less, couplings, and drives beside them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from crosscheck.engines.conventions import Frame, axes_with, cross
from crosscheck.engines.links import closed_frames
from crosscheck.engines.pinocchio.forces import ClosedLoad, body_motion, mass_matrix, on_both_sides
from crosscheck.engines.pinocchio.tree import PinocchioTree
from crosscheck.engines.rigid_tree import TreeState, placed_couplings
from crosscheck.engines.tree_observer import BodyMotion
from flexmb.scene.hinges import WITH_AXIS, Closure, ClosureKind
from flexmb.scene.schema import Scene
from flexmb.typing import Real

_EVERY = (0, 1, 2)
_KEPT: dict[ClosureKind, tuple[tuple[tuple[int, int], ...], tuple[int, ...]]] = {
    "weld": (((1, 2), (0, 2), (0, 1)), _EVERY),
    "prismatic": (((1, 2), (0, 2), (0, 1)), (0, 1)),
    "revolute": (((0, 2), (1, 2)), _EVERY),
    "cylindrical": (((0, 2), (1, 2)), (0, 1)),
    "planar": (((0, 2), (1, 2)), (2,)),
    "universal": (((0, 1),), _EVERY),
    "spherical": ((), _EVERY),
    "in_line": ((), (0, 1)),
    "in_plane": ((), (2,)),
}
"""Which axes of A and B a closure keeps at right angles, and along which axes of A it keeps B at A; z is its axis."""
DEPENDENT = 1e-9
"""Singular values that count as zero, of rows scaled to length one in the metric of the mass matrix, whatever their
units: those of redundant rows are the gap of the closures, which begin closed to 1e-12, and rounding."""


class _End(NamedTuple):
    """One side of a closure: its joint (0 for World) and its frame there, z along the axis of the closure."""

    joint: int
    frame: Frame


class PinocchioRows:
    """Closures and the couplings of a scene on its tree. `efforts` leaves their loads for `loads` and `on_joints`."""

    def __init__(self, tree: PinocchioTree, scene: Scene, closures: Sequence[Closure], driven: list[int]) -> None:
        """`driven`: speeds whose accelerations are given."""
        self._couplings, nv = placed_couplings(scene, tree.slots), tree.model.nv
        at = {slot.v: joint for joint, slot in enumerate(tree.slots, 1)}  # the joint of World comes first
        self._led = [at[coupling.slots[0].v] for coupling in self._couplings]
        self._closures = {closure.name: (closure.type, _ends(tree, scene, closure)) for closure in closures}
        self._model, self._data = tree.model, tree.model.createData()
        self._coupled = np.array([coupling.row(nv) for coupling in self._couplings]).reshape(-1, nv)
        self._free = np.setdiff1d(np.arange(nv), driven)
        self._load = np.zeros(len(self._couplings))
        self._wrench: dict[str, tuple[Real, Real]] = {}  # of closures: [torque; force] on B about B, and where B is

    def __bool__(self) -> bool:
        return bool(self._couplings or self._closures)

    def efforts(self, state: TreeState, accelerations: Real) -> Real:
        """(nv,) generalised forces that keep what is kept, from the accelerations (nv,) without them.

        J M^-1 J' f = -(J a + dJ/dt v) with the mass matrix M of the free speeds. With M = L L' and W = L^-1 J', whose
        columns scaled to length one are U S V', the loads are f = -V S^-2 V' (J a + dJ/dt v) but for these scales;
        where rows are redundant, they are the least such ones.
        """
        M = mass_matrix(self._model, self._data, state.q)
        J, opening, directions = self._rows(state, accelerations)
        W = np.linalg.solve(np.linalg.cholesky(M[np.ix_(self._free, self._free)]), J[:, self._free].T)
        lengths = np.linalg.norm(W, axis=0)
        lengths[lengths == 0.0] = 1.0
        _, sizes, V = np.linalg.svd(W / lengths, full_matrices=False)
        sizes, V = sizes[kept := sizes > DEPENDENT], V[kept]
        load = -(V.T @ (V @ (opening / lengths) / sizes**2)) / lengths
        self._load, first = load[: len(self._couplings)], len(self._couplings)
        for name, (along, position) in directions.items():
            self._wrench[name] = along @ load[first : first + along.shape[1]], position
            first += along.shape[1]
        return J.T @ load

    def loads(self, data: pin.Data) -> dict[str, Real]:
        """[torque; force] (6,) of the state solved last, World axes: of closures on body_b about B, of couplings along
        the axis of what they lead."""
        of_couplings = {
            coupling.name: coupling.load(size, data.oMi[joint].rotation @ coupling.slots[0].freedom.axis)
            for coupling, joint, size in zip(self._couplings, self._led, self._load.tolist(), strict=True)
        }
        return of_couplings | {name: load for name, (load, _) in self._wrench.items()}

    def on_joints(self) -> Iterator[tuple[int, Real]]:
        """Those of closures on both sides' joints about their origins, World axes."""
        closed = ((*load_at, self._closures[name][1]) for name, load_at in self._wrench.items())
        return on_both_sides(self._data, (ClosedLoad(load, at, (a.joint, b.joint)) for load, at, (a, b) in closed))

    def _rows(self, state: TreeState, accelerations: Real) -> tuple[Real, Real, dict[str, tuple[Real, Real]]]:
        """J (G, nv) of couplings, then closures, their accelerations (G,), and for each closure [torque; force] (6, n)
        on B of unit loads of its rows, World axes, with the place of B."""
        J, opening, directions = [self._coupled], [self._coupled @ accelerations], {}
        if self._closures:
            pin.forwardKinematics(self._model, self._data, state.q, state.v, accelerations)
            pin.computeJointJacobians(self._model, self._data)
        for name, (kind, ends) in self._closures.items():
            a, b = (body_motion(self._data, end.joint).carrying(end.frame) for end in ends)
            along, rates = _kept(kind, a, b)
            directions[name] = along, b.position
            J.append(along.T @ (self._reach(ends[1].joint, b.position) - self._reach(ends[0].joint, b.position)))
            opening.append(rates)
        return np.concatenate(J), np.concatenate(opening), directions

    def _reach(self, joint: int, point: Real) -> Real:
        """(6, nv) [angular; linear] velocity in World axes of the body at a joint, there where `point` is."""
        rows = np.zeros((6, self._model.nv))
        if joint:
            J = pin.getJointJacobian(self._model, self._data, joint, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
            J = J.reshape(rows.shape)  # that of one speed comes as a vector
            arm = point - self._data.oMi[joint].translation
            rows[:3], rows[3:] = J[3:], J[:3] + cross(J[3:].T, arm).T
        return rows


def _ends(tree: PinocchioTree, scene: Scene, closure: Closure) -> tuple[_End, _End]:
    turn = axes_with(np.array(closure.axis), 2) if closure.type in WITH_AXIS else np.eye(3)
    a, b = (
        _End(tree.joints[at.link] if at.link >= 0 else 0, at.frame @ Frame(np.zeros(3), turn))
        for at in closed_frames(scene, tree.links, closure)
    )
    return a, b


def _kept(kind: ClosureKind, a: BodyMotion, b: BodyMotion) -> tuple[Real, Real]:
    """[torque; force] (6, n) on B of unit loads of the rows, and the second derivatives (n,) of what they keep zero."""
    pairs, steps = _KEPT[kind]
    along, rates = np.zeros((6, len(pairs) + len(steps))), []
    turning, alpha = b.angular - a.angular, b.alpha - a.alpha
    for k, (of_a, of_b) in enumerate(pairs):
        x, y = a.rotation[:, of_a], b.rotation[:, of_b]
        along[:3, k] = normal = cross(y, x)
        rates.append(alpha @ normal + turning @ (cross(cross(b.angular, y), x) + cross(y, cross(a.angular, x))))
    gap, moving = b.position - a.position, b.linear - a.linear
    for k, axis in enumerate(steps, len(pairs)):
        n = a.rotation[:, axis]
        along[3:, k], turned = n, cross(a.angular, n)
        bent = cross(a.alpha, n) + cross(a.angular, turned)
        rates.append(n @ (b.acceleration - a.acceleration) + 2.0 * turned @ moving + bent @ gap)
    return along, np.array(rates)
