"""The structure of a mass matrix: one kernel for all directions, or lumps at the nodes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexmb.interchange.superelement.element import ALIKE, SuperElement, SuperElementError
from flexmb.modal.cross import cross_matrix
from flexmb.typing import Real


@dataclass(frozen=True, eq=False)
class NodalInertia:
    """Inertia of a structure with n nodes, and the mass matrix M (N,N) that belongs to it.

    kernel (n,n) kg: sum m f g = f' kernel g for two fields with values f and g at the nodes. This is exact for solids,
    whose shape functions are the same in all directions. second_moment (n,3,3) kg m²: sum m a a' of masses at arms a
    from the mass centres, turning with the nodes; offset (n,3) m: these mass centres. `note` describes changes to M.
    """

    kernel: Real
    offset: Real
    second_moment: Real
    M: Real
    note: str = ""

    def gram(self, position: Real, translation: Real, rotation: Real) -> Real:
        """Sums of products (4+3m, 4+3m) of the fields 1, r, phi_n for modes (n,3,m) of nodes at `position` (n,3)."""
        n, _, m = translation.shape
        shapes = translation + np.cross(rotation, self.offset[:, :, None], axis=1)
        fields = np.column_stack([np.ones(n), position + self.offset, shapes.transpose(0, 2, 1).reshape(n, 3 * m)])
        turned = cross_matrix(rotation.transpose(0, 2, 1)).reshape(n, 3 * m, 3)  # of masses at unit arms
        arms = np.concatenate([np.zeros((n, 1, 3)), np.broadcast_to(np.eye(3), (n, 3, 3)), turned], axis=1)
        return fields.T @ self.kernel @ fields + np.einsum(
            "iac,icd,ibd->ab", arms, self.second_moment, arms, optimize=True
        )


def nodal_inertia(element: SuperElement) -> NodalInertia:
    """The inertia of M: exact if M has one kernel or lumps at nodes; otherwise lumped, with a note.

    Lumping conserves the mass and the mass centre of the structure. SuperElementError for a node with mass in some
    directions only.
    """
    full, blocks = _by_nodes(element)
    largest = _max(element.M)
    kernel = _kernel(full, largest)
    if kernel is not None:
        nothing = np.zeros((len(kernel), 3, 3))
        return NodalInertia(kernel, nothing[:, 0], nothing, element.M)
    coupled = full.copy()
    coupled[np.arange(len(full)), :, np.arange(len(full)), :] = 0.0
    if _max(coupled) <= ALIKE * largest:
        return _lumps(element, blocks, "")
    rows = np.sum(full, axis=2)
    rows[:, :3, 3:] = rows[:, 3:, :3] = 0.0
    return _lumps(element, rows, "M couples rotations of different nodes, so it was lumped at the nodes")


def _by_nodes(element: SuperElement) -> tuple[Real, Real]:
    """M as (n,6,n,6), with zeros for displacements without a row, and its diagonal blocks (n,6,6)."""
    n = len(element.ids)
    there = element.place >= 0
    full = np.zeros((6 * n, 6 * n))
    full[np.ix_(np.flatnonzero(there), np.flatnonzero(there))] = element.M[
        np.ix_(element.place[there], element.place[there])
    ]
    by_nodes = full.reshape(n, 6, n, 6)
    return by_nodes, by_nodes[np.arange(n), :, np.arange(n), :]


def _kernel(full: Real, largest: float) -> Real | None:
    """The common kernel (n,n) of all three directions, or None if there is none or rotations have inertia."""
    if _max(full[:, 3:]) > 0.0:
        return None
    kernel = np.einsum("iaja->ij", full[:, :3, :, :3]) / 3.0
    rest = full[:, :3, :, :3] - kernel[:, None, :, None] * np.eye(3)[:, None, :]
    return kernel if _max(rest) <= ALIKE * largest else None


def _lumps(element: SuperElement, blocks: Real, note: str) -> NodalInertia:
    """Lumps from the blocks (n,6,6) [m, -m c~; m c~, J] of single nodes.

    Negative second moments, which no mass has, are set to zero; this increases the inertia.
    """
    mass = np.einsum("iaa->i", blocks[:, :3, :3]) / 3.0
    slack = ALIKE * float(np.max(mass))
    uneven = np.max(np.abs(blocks[:, :3, :3] - mass[:, None, None] * np.eye(3)), axis=(1, 2))
    if np.max(uneven) > slack:
        worst = element.ids[int(np.argmax(uneven))]
        raise SuperElementError(
            f"node {worst} has other mass in x than in y or z: give mass that acts in all directions"
        )
    first = 0.5 * (blocks[:, 3:, :3] - blocks[:, :3, 3:])
    moment = np.stack([first[:, 2, 1], first[:, 0, 2], first[:, 1, 0]], axis=1)
    offset = np.where(mass[:, None] > slack, moment / np.where(mass > slack, mass, 1.0)[:, None], 0.0)
    c = cross_matrix(offset)
    J = blocks[:, 3:, 3:] + mass[:, None, None] * c @ c
    S = 0.5 * np.trace(J, axis1=1, axis2=2)[:, None, None] * np.eye(3) - 0.5 * (J + J.transpose(0, 2, 1))
    values, axes = np.linalg.eigh(S)
    second = np.einsum("iac,ic,ibc->iab", axes, np.maximum(values, 0.0), axes)
    if np.min(values, initial=0.0) < -ALIKE * np.max(np.abs(J), initial=0.0):
        note = f"{note}; " if note else ""
        note += "rotary inertia about one axis only was completed to that of a mass"
    return NodalInertia(np.diag(mass), offset, second, _mass_matrix(element, mass, offset, second), note)


def _mass_matrix(element: SuperElement, mass: Real, offset: Real, second: Real) -> Real:
    """M (N,N) of the lumps."""
    c = cross_matrix(offset)
    J = np.trace(second, axis1=1, axis2=2)[:, None, None] * np.eye(3) - second - mass[:, None, None] * c @ c
    first = mass[:, None, None] * c
    upper = np.concatenate([mass[:, None, None] * np.broadcast_to(np.eye(3), c.shape), -first], axis=2)
    blocks = np.concatenate([upper, np.concatenate([first, J], axis=2)], axis=1)
    M = np.zeros_like(element.M)
    for rows, block in zip(element.place, blocks, strict=True):
        there = rows >= 0
        M[np.ix_(rows[there], rows[there])] = block[np.ix_(there, there)]
    return M


def _max(a: Real) -> float:
    return float(np.max(np.abs(a), initial=0.0))
