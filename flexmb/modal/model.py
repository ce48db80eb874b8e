"""What modal preprocessing hands to the dynamics: inertia points, mode shapes, stiffness and damping of one body."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ModalNode:
    """A node: rest position (3,) m, rest rotation (3,3) node->body, mode shapes translation and rotation (3, m)."""

    position: Array
    rotation: Array
    translation: Array
    rotation_modes: Array

    def seen_from(self, origin: Array, turn: Array) -> ModalNode:
        """The same node in axes R_new_old = `turn` about `origin` (3,), old axes."""
        return ModalNode(
            turn @ (self.position - origin),
            turn @ self.rotation,
            turn @ self.translation,
            turn @ self.rotation_modes,
        )


@dataclass(frozen=True)
class FlexibleModel:
    """Inertia points and modes of one flexible body in its body frame.

    mass (n,) kg; position (n,3) m; com_offset (n,3) m, in point axes, turning with the point; inertia (n,3,3) kg m^2
    about the point's mass centre, turning with the point; translation and rotation mode shapes (n,3,m); stiffness and
    damping (m,m); `nodes` by name, always with "origin". `clamped`: the modes vanish at the body origin.
    """

    mass: Array
    position: Array
    com_offset: Array
    inertia: Array
    translation: Array
    rotation: Array
    stiffness: Array
    damping: Array
    nodes: dict[str, ModalNode]
    clamped: bool

    @property
    def mode_count(self) -> int:
        return self.translation.shape[2]
