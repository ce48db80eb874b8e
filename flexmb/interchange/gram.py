"""Few equal point masses with a given Gram matrix of the fields 1, coordinates of r, and coordinates of mode shapes.

The kinetic energy of point masses depends only on the sums m a b of two of these 4 + 3 m fields, their Gram matrix. The
rows of any factor X of it, X'X, are the fields at points, times the square root of the point's mass. A Householder
reflection makes all entries in the column of the field 1 equal, so that all points have the same mass.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexmb.typing import Real

NEGATIVE = 1e-6
"""Negative eigenvalues down to this fraction of the largest are attributed to printing in single precision."""
ROUNDING = 1e-15  # eigenvalues below this fraction of the largest are rounding errors


class EquivalentMasses(NamedTuple):
    """mass (n,) kg, position (n,3) m, translation_modes (n,3,m)."""

    mass: Real
    position: Real
    translation_modes: Real


class NoMasses(ValueError):
    """No masses have this Gram matrix; `field` is the field with the largest defect: 0 is 1, 1 to 3 are r, then phi."""

    def __init__(self, field: int) -> None:
        self.field = field
        super().__init__(f"no distribution of mass has these sums; the largest defect is that of field {field}")


def equivalent_masses(gram: Real, nearest: bool = False) -> EquivalentMasses:
    """Points whose fields have the Gram matrix `gram` (4+3m, 4+3m), of which the upper triangle is read.

    Raises NoMasses if it is not positive semidefinite; with `nearest` the points have the nearest one that is.
    """
    gram = np.triu(gram) + np.triu(gram, 1).T
    size = _sizes(np.diag(gram))
    with np.errstate(over="ignore", invalid="ignore"):
        scaled = gram / size[:, None] / size
    largest = np.max(np.abs(scaled), axis=1)
    if not np.all(np.isfinite(largest)):  # in a positive semidefinite matrix scaled elements are at most 1
        raise NoMasses(int(np.argmin(np.isfinite(largest))))
    values, vectors = np.linalg.eigh(scaled)
    if values[0] < -NEGATIVE * values[-1] and not nearest:
        raise NoMasses(int(np.argmax(np.abs(vectors[:, 0]))))
    kept = values > ROUNDING * values[-1]
    X = np.sqrt(values[kept])[:, None] * vectors[:, kept].T * size
    n, mass = len(X), float(X[:, 0] @ X[:, 0])
    normal = X[:, 0] - np.sqrt(mass / n)
    if np.any(normal):
        X = X - 2.0 * np.outer(normal, normal @ X) / (normal @ normal)
    fields = X / np.sqrt(mass / n)
    modes = fields[:, 4:].reshape(n, -1, 3).transpose(0, 2, 1)
    return EquivalentMasses(np.full(n, mass / n), fields[:, 1:4], modes)


def _sizes(squares: Real) -> Real:
    """Scales of the fields, the same for the three coordinates of a vector, so that one that is zero to round-off is
    compared with the others."""
    vectors = np.repeat(np.sqrt(np.abs(squares[1:].reshape(-1, 3).sum(axis=1))), 3)
    size = np.concatenate([np.sqrt(np.abs(squares[:1])), vectors])
    return np.where(size == 0.0, 1.0, size)
