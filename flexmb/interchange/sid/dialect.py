"""The two dialects of SID files, and how to tell them apart.

"wallrapp": J is a 3 x 3 matrix, and the columns of Gr and Ge are ordered by mode, then axis, as in the textbooks.
"fembs": J is the vector xx, yy, zz, xy, xz, yz, and the columns are ordered by axis, then mode, as FEMBS and programs
after it write them. Files do not say which order theirs is; the redundancy of Gr and Ge with J and Cr does.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from flexmb.interchange.sid.blocks import Taylor
from flexmb.modal.cross import cross_matrix
from flexmb.modal.first_order import symmetric
from flexmb.typing import Index, Real

Dialect = Literal["wallrapp", "fembs"]
SIX = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""The elements of J in a vector of six."""


def inertia_of_six(six: Taylor) -> Taylor:
    """J (3,3) from its vector (6,1)."""

    def matrix(vector: Real) -> Real:
        J = np.zeros((*vector.shape[:-1], 3, 3))
        for place, (i, j) in enumerate(SIX):
            J[..., i, j] = J[..., j, i] = vector[..., place]
        return J

    first = None if six.first is None else np.moveaxis(matrix(six.first[:, :, 0].T), 0, 1)
    return Taylor(matrix(six.zero[:, 0]), first)


def six_of_inertia(J: Taylor) -> Taylor:
    """The vector (6,1) of J (3,3)."""
    rows, columns = np.array(SIX).T
    first = None if J.first is None else J.first.transpose(0, 2, 1)[rows, columns][:, :, None]
    return Taylor(J.zero[rows, columns][:, None], first)


def by_axis(block: Taylor) -> Taylor:
    """Gr or Ge with columns by mode, then axis, as one with columns by axis, then mode."""
    return _reordered(block, np.arange(block.zero.shape[1]).reshape(-1, 3).T.ravel())


def by_mode(block: Taylor) -> Taylor:
    """The inverse of `by_axis`."""
    return _reordered(block, np.arange(block.zero.shape[1]).reshape(3, -1).T.ravel())


def _reordered(block: Taylor, order: Index) -> Taylor:
    return Taylor(block.zero[:, order], None if block.first is None else block.first[:, :, order])


def with_columns_by_mode(J: Taylor, Cr: Taylor, Gr: Taylor, Ge: Taylor) -> tuple[Taylor, Taylor]:
    """Gr and Ge of a file, whose columns have either order, with columns by mode.

    The order is the one in which they agree better with J and Cr; columns by mode if there is no difference.
    """
    other = by_mode(Gr), by_mode(Ge)
    return other if _gap(J, Cr, *other) < _gap(J, Cr, Gr, Ge) else (Gr, Ge)


def _gap(J: Taylor, Cr: Taylor, Gr: Taylor, Ge: Taylor) -> float:
    """By how much Gr and Ge, of columns by mode, contradict J and Cr: a sum of relative differences."""
    m = len(Cr.zero)
    torque = Gr.zero.reshape(3, m, 3).swapaxes(0, 1)
    force = Ge.zero.reshape(m, m, 3)
    pairs = [(0.5 * (torque - np.swapaxes(torque, 1, 2)), -cross_matrix(Cr.zero)), (force, -np.swapaxes(force, 0, 1))]
    if J.first is not None:
        pairs.append((symmetric(torque), np.moveaxis(J.first, 1, 0)))
    if Cr.first is not None:
        pairs.append((force, Cr.first - np.swapaxes(Cr.first, 0, 1)))
    sizes = ((float(np.linalg.norm(a - b)), float(np.linalg.norm(a) + np.linalg.norm(b))) for a, b in pairs)
    return sum(gap / size for gap, size in sizes if size > 0.0)
