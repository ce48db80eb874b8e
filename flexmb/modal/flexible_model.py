"""The result of modal preprocessing: inertia points, mode shapes, stiffness and damping of one body."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flexmb.modal.strain_field import StrainField
from flexmb.typing import Index, Real


@dataclass(frozen=True)
class SecondOrder:
    """Displacement of second order in the modal coordinates, 1/2 eta' G eta; G is symmetric in its last two axes.

    translation (...,3,m,m) is the G that adds to the displacement phi eta of a point (m), rotation (...,3,m,m) the one
    that adds to its rotation vector psi eta. Leading axes: points, or none for a node.
    """

    translation: Real
    rotation: Real

    def turned(self, turn: Real) -> SecondOrder:
        """The same field in other axes, R_new_old = `turn`."""
        return self.map(lambda G: np.einsum("ab,...bmn->...amn", turn, G))

    def map(self, linear: Callable[[Real], Real]) -> SecondOrder:
        """A linear operation applied to both fields."""
        return SecondOrder(linear(self.translation), linear(self.rotation))


@dataclass(frozen=True)
class FlexibleNode:
    """A node: rest position (3,) m, rest rotation (3,3) node->body, mode shapes translation and rotation (3, m).

    `second` (3,m,m): its second-order field, if the body has one. `section`: its section, of a body of level exact,
    whose mode shapes are those at rest; -1 where the node does not deform.
    """

    position: Real
    rotation: Real
    translation: Real
    rotation_modes: Real
    second: SecondOrder | None = None
    section: int = -1

    def seen_from(self, origin: Real, turn: Real) -> FlexibleNode:
        """The same node in other axes, R_new_old = `turn`, with the new origin at `origin` (3,) in the old axes."""
        return FlexibleNode(
            turn @ (self.position - origin),
            turn @ self.rotation,
            turn @ self.translation,
            turn @ self.rotation_modes,
            None if self.second is None else self.second.turned(turn),
            self.section,
        )


def undeforming_node(modes: int) -> FlexibleNode:
    """The body frame as a node, which no mode moves."""
    none = np.zeros((3, modes))
    return FlexibleNode(np.zeros(3), np.eye(3), none, none)


@dataclass(frozen=True, eq=False)
class FlexibleModel:
    """Inertia points and modes of one flexible body in its body frame. Models are compared by identity.

    mass (n,) kg; position (n,3) m; com_offset (n,3) m, in point axes, turning with the point; inertia (n,3,3) kg m^2
    about the point's mass centre, turning with the point; translation and rotation mode shapes (n,3,m); stiffness and
    damping (m,m); `nodes` by name, always with "origin". `clamped`: the modes vanish at the body origin. `second`: the
    second-order field of the points (n,3,m,m), of bodies of level `stiffened`. `field`: how the sections of a beam of
    level `exact` move, whose mode shapes are those at rest; `section` (n,): the sections that the points are fixed to.
    """

    mass: Real
    position: Real
    com_offset: Real
    inertia: Real
    translation: Real
    rotation: Real
    stiffness: Real
    damping: Real
    nodes: dict[str, FlexibleNode]
    clamped: bool
    second: SecondOrder | None = None
    field: StrainField | None = None
    section: Index | None = None

    @property
    def mode_count(self) -> int:
        return self.translation.shape[2]


def join_second(first: SecondOrder | None, then: SecondOrder | None) -> SecondOrder | None:
    """The fields of two sets of points as one; None if either is None."""
    if first is None or then is None:
        return None
    return SecondOrder(
        np.concatenate([first.translation, then.translation]), np.concatenate([first.rotation, then.rotation])
    )


def with_node(model: FlexibleModel, node: FlexibleNode) -> SecondOrder | None:
    """The second-order field of the points of `model` and, as one more point, of `node`; None if the model has none.

    A node without a field of its own does not deform, and gets zeros.
    """
    if model.second is None:
        return None
    m = model.mode_count
    last = node.second or SecondOrder(np.zeros((3, m, m)), np.zeros((3, m, m)))
    return join_second(model.second, last.map(lambda G: G[None]))
