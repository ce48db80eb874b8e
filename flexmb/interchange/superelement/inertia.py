"""The inertia of a finite-element structure as masses that its nodes carry.

Node i moves masses by N_i u_i + theta_i x A_i, with a share N_i and arms A_i at every mass: at one place N_i = 1 and
A_i = 0 for a lump, shape functions for solids, and for a surface that is tied to a node its masses with their arms. The
sums of products of shares and arms are a kernel, which M contains: the block of two displacements is int N_i N_j 1,
that of a displacement and a rotation -int N_i A_j~, and that of two rotations int A_i~' A_j~.

Mass matrices with this structure are those of lumps with tensors and offsets, of solids, of shells, and of whatever of
these is tied rigidly. Others, as of consistent beams, have the nearest kernel: that of their symmetric and skew parts.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexmb.interchange.superelement.element import SuperElement
from flexmb.modal.cross import cross_matrix
from flexmb.typing import Real


def carried_sums(element: SuperElement, position: Real, translation: Real, rotation: Real) -> Real:
    """Sums (4+3m, 4+3m) over the masses of products of the fields 1, r, phi_n.

    position (n,3) m of the nodes, translation and rotation modes (n,3,m).
    """
    n, _, m = translation.shape
    shares = np.column_stack([np.ones(n), position, translation.transpose(0, 2, 1).reshape(n, 3 * m)])
    arms = np.zeros((3, n, 4 + 3 * m))
    arms[:, :, 1:4] = np.eye(3)[:, None]
    arms[:, :, 4:] = np.moveaxis(cross_matrix(rotation.transpose(0, 2, 1)).reshape(n, 3 * m, 3), 2, 0)
    turns = np.any(element.place[:, 3:] >= 0, axis=1)
    fields = np.concatenate([shares, *arms[:, turns]])
    return np.asarray(fields.T @ _kernel(element, turns) @ fields)


def _kernel(element: SuperElement, turns: NDArray[np.bool_]) -> Real:
    """Sums (n+3k, n+3k) of products of the shares of all nodes and the arms along x, y and z of the k that turn."""
    padded = np.pad(element.M, ((0, 1), (0, 1)))  # index -1 selects zeros
    move, turn = element.place[:, :3].T, element.place[turns, 3:].T

    def block(rows: NDArray[np.int64], columns: NDArray[np.int64]) -> Real:
        return padded[np.ix_(rows, columns)]

    share = sum(block(rows, rows) for rows in move) / 3.0
    mixed = [0.5 * (block(move[b], turn[c]) - block(move[c], turn[b])) for b, c in ((1, 2), (2, 0), (0, 1))]
    half = 0.5 * sum(block(rows, rows) for rows in turn)
    own = [[(half if a == b else 0.0) - block(turn[b], turn[a]) for b in range(3)] for a in range(3)]
    return np.block([[share, *mixed], *([mixed[a].T, *own[a]] for a in range(3))])
