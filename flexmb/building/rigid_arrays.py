"""Frames of hinges on rigid bodies, and their inertia about the origins of links, for all rigid bodies at once."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain as joined
from typing import NamedTuple

import numpy as np

from flexmb.building.links import BodyLink, End
from flexmb.building.models import Models
from flexmb.levels.level import sixes
from flexmb.scene.quaternions import cross_matrix, rotation_matrix
from flexmb.typing import Real


class Frames(NamedTuple):
    """Frames on bodies at rest: rotation (n,3,3) to body axes and origin (n,3)."""

    R: Real
    p: Real

    def seen_from(self, base: Frames) -> Frames:
        """These frames relative to other frames on the same bodies."""
        back = np.swapaxes(base.R, 1, 2)
        return Frames(back @ self.R, np.einsum("nij,nj->ni", back, self.p - base.p))


def inboard_frames(links: Sequence[BodyLink]) -> Frames:
    """Inboard hinge frames of links whose parents are rigid or the ground, in the parents' own frames."""
    return _frames([link.inboard_end for link in links], [link.parent for link in links], links)


def outboard_frames(links: Sequence[BodyLink]) -> Frames:
    """Outboard hinge frames of rigid links, in the bodies' own frames."""
    return _frames([link.outboard_end for link in links], [link.name for link in links], links)


def _frames(ends: list[End], bodies: list[str], links: Sequence[BodyLink]) -> Frames:
    R = rotation_matrix(_numbers([end.quaternion for end in ends], 4))
    p = _numbers([end.offset for end in ends], 3)
    for i, end in enumerate(ends):
        if end.node != "origin":
            turn, position = _node(links[i].models, bodies[i], end.node)
            R[i], p[i] = turn @ R[i], position + turn @ p[i]
    return Frames(R @ np.array([link.turn for link in links]).reshape(-1, 3, 3), p)


def _node(models: Models, body: str, node: str) -> tuple[Real, Real]:
    frame = models.frame(body, node)
    return rotation_matrix(frame.quaternion), np.array(frame.position, float)


def rigid_inertia_rows(links: Sequence[BodyLink], outboard: Frames) -> Real:
    """(n,10) mass, first moment and inertia about the link's origin of rigid links without wheels."""
    properties = [link.mass_properties for link in links]
    mass = np.array([m for m, _, _ in properties], float)
    com = _numbers([c for _, c, _ in properties], 3)
    own = _numbers([row for _, _, J in properties for row in J], 3).reshape(-1, 3, 3)
    moved = Frames(np.broadcast_to(np.eye(3), own.shape), com).seen_from(outboard)
    across = cross_matrix(moved.p)
    inertia = moved.R @ own @ outboard.R - mass[:, None, None] * across @ across
    return np.column_stack([mass, mass[:, None] * moved.p, sixes(inertia)])


def _numbers(rows: list[tuple[float, ...]], length: int) -> Real:
    return np.fromiter(joined.from_iterable(rows), float).reshape(len(rows), length)
