"""A flexible body for Exudyn's floating frame of reference: nodes, and the inertia integrals as sums over points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crosscheck.engines.conventions import cross_matrix, rotation_matrix
from crosscheck.engines.exudyn.rotations import cross_matrices
from flexmb.scene.modal_data import modal_arrays
from flexmb.scene.schema import ModalBody
from flexmb.scene.tree import node_frame
from flexmb.typing import Real


@dataclass(frozen=True)
class NodeShape:
    """A node in some body axes: `position` (3,) m, `rotation` (3,3) node -> body at rest, mode shapes (3, m)."""

    position: Real
    rotation: Real
    translation: Real
    rotation_modes: Real

    @property
    def deforms(self) -> bool:
        """Whether any mode moves or turns the node."""
        return bool(np.any(self.translation) or np.any(self.rotation_modes))


def node_shape(body: ModalBody, name: str, axes: Real) -> NodeShape:
    """Node `name` in the axes `axes` @ (body axes). The implicit origin of a clamped body has zero shapes."""
    rest = node_frame(body, name)
    translation = rotation = np.zeros((3, modal_arrays(body).translation_modes.shape[2]))
    for node in body.nodes:
        if node.name == name:
            translation, rotation = np.array(node.translation_modes).T, np.array(node.rotation_modes).T
    return NodeShape(
        axes @ np.array(rest.position), axes @ rotation_matrix(rest.quaternion), axes @ translation, axes @ rotation
    )


@dataclass(frozen=True)
class PointIntegrals:
    """Inertia integrals over the points (position r, modes Phi (3,m)) of one body, about the frame origin, in its axes.

    With ~ the cross matrix and [Phi~] the (3, 3m) row of cross matrices of the mode columns:
    mass = sum m; first = sum m r (3,); inertia = sum m r~'r~ (3,3); shape = sum m Phi (3,m);
    shape_cross = sum m [Phi~] (3,3m); position_shape = sum m r~'Phi (3,m); position_cross = sum m r~'[Phi~] (3,3m);
    cross_shape = sum m [Phi~]'Phi (3m,m); cross_cross = sum m [Phi~]'[Phi~] (3m,3m); modal = sum m Phi'Phi (m,m).
    """

    mass: float
    first: Real
    inertia: Real
    shape: Real
    shape_cross: Real
    position_shape: Real
    position_cross: Real
    cross_shape: Real
    cross_cross: Real
    modal: Real
    stiffness: Real
    damping: Real


def integrals(body: ModalBody, axes: Real) -> PointIntegrals:
    """Integrals of a body without rotary inertia of its points, in the axes `axes` @ (body axes)."""
    arrays = modal_arrays(body)
    m, r = arrays.mass, arrays.position @ axes.T
    Phi = np.einsum("ab,pbn->pan", axes, arrays.translation_modes)
    r_cross = cross_matrices(r)
    crosses = np.moveaxis(cross_matrices(np.moveaxis(Phi, 2, 1)), 1, 2)  # (points, 3, modes, 3)
    row = crosses.reshape(len(m), 3, -1)

    def total(a: Real, b: Real) -> Real:
        """sum m a'b."""
        return np.einsum("p,pki,pkj->ij", m, a, b)

    return PointIntegrals(
        mass=float(m.sum()), first=m @ r, inertia=total(r_cross, r_cross),
        shape=np.einsum("p,pkn->kn", m, Phi), shape_cross=np.einsum("p,pkn->kn", m, row),
        position_shape=total(r_cross, Phi), position_cross=total(r_cross, row),
        cross_shape=total(row, Phi), cross_cross=total(row, row), modal=total(Phi, Phi),
        stiffness=arrays.stiffness, damping=arrays.damping,
    )  # fmt: skip


def gravity_force(data: PointIntegrals, g: Real, A: Real, rate_map: Real, eta: Real) -> Real:
    """Generalised weight [World force; rotation coordinates; modes] of the deformed body.

    Exudyn's own mass-proportional load leaves out the moment of the deformation, A skew(shape eta) G, so that energy
    drifts. `g` (3,) m/s² in World, `A` (3,3) frame to World, `rate_map` (3,k): body-axes angular velocity = map qdot.
    """
    local = A.T @ g
    moment = cross_matrix(data.first + data.shape @ eta) @ local
    return np.concatenate([data.mass * g, rate_map.T @ moment, data.shape.T @ local])
