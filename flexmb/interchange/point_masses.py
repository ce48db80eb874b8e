"""Few equal point masses with given sums, or near to them with exactly the kinetic energy at rest of a mass matrix.

The kinetic energy of point masses depends only on the sums m a b of two of the 4 + 3 m fields 1, coordinates of r, and
coordinates of mode shapes: their Gram matrix. The rows of any factor X of it, X'X, are the fields at points, times the
square root of the point's mass. A Householder reflection makes all entries in the column of the field 1 equal, so that
all points have the same mass.

The spatial mass S = [R Phi]' M [R Phi] of rigid-body motions R and modes Phi has mass, mass centre, inertia, coupling
and modal masses: all that vibrations about the undeformed shape need. How they change with the deformation is in sums
over masses that M does not contain unless it is that of masses which its nodes carry. The points start from those, and
their fields move as little as possible, in the least-squares sense, until they have S.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexmb.scene.quaternions import cross_matrix
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


MASSLESS = 1e-12  # share of the inertia below which there is none, as that of a line of points about itself
SLIGHT = 1e-9  # share of the largest 1/omega^2 of the body below which a motion has next to no mass
UNMOVED = 1e-9
FARTHEST = 0.25
"""Difference of frequencies, relative, up to which masses count as near."""


class RigidBlock(NamedTuple):
    """mass kg, mass centre (3,) m and inertia (3,3) kg m² about the origin."""

    mass: float
    centre: Real
    J: Real

    @classmethod
    def of(cls, S: Real) -> RigidBlock:
        """From a spatial mass, in the order translations, rotations, modes."""
        mass = float(np.trace(S[:3, :3])) / 3.0
        return cls(mass, np.array([S[5, 1], S[3, 2], S[4, 0]]) / mass, S[3:6, 3:6])


class NearPoints(NamedTuple):
    """The points, and by how much the frequencies of the free structure were off before their fields moved."""

    points: EquivalentMasses
    distance: float


def points_with(S: Real, sums: Real, omega: Real) -> NearPoints:
    """Points with the spatial mass S (6+m,6+m), near to those with the sums (4+3m,4+3m) of products of 1, r and phi_n.

    omega (m,) rad/s of the modes, which have unit mass. Raises NoMasses if no points have S.
    """
    start = equivalent_masses(sums, nearest=True)
    count, _, m = start.translation_modes.shape
    rigid = RigidBlock.of(S)
    each = rigid.mass / count
    second = 0.5 * np.trace(rigid.J) * np.eye(3) - rigid.J - rigid.mass * np.outer(rigid.centre, rigid.centre)
    spread = start.position - start.position.mean(axis=0)
    position = rigid.centre + _nearest(spread, second / each, np.ones((count, 1)), 1)
    R = np.concatenate([np.broadcast_to(np.eye(3), (count, 3, 3)), -cross_matrix(position)], axis=2).reshape(-1, 6)
    inverse = _inverse(each * R.T @ R)  # of the points: M may have rounding errors that no rigid body has
    follow = inverse @ S[:6, 6:]
    elastic = S[6:, 6:] - S[6:, :6] @ follow
    phi = start.translation_modes.reshape(-1, m)
    phi = phi - R @ (inverse @ (each * R.T @ phi))
    moved = R @ follow + _nearest(phi, elastic / each, R, 4)
    points = EquivalentMasses(np.full(count, each), position, moved.reshape(count, 3, m))
    return NearPoints(points, _distance(elastic, each * phi.T @ phi, omega))


def _distance(elastic: Real, start: Real, omega: Real) -> float:
    """The largest relative difference of the frequencies that these modal masses (m,m) of the free structure give."""
    exact, near = (np.linalg.eigvalsh(matrix / np.outer(omega, omega))[::-1] for matrix in (elastic, start))
    there = exact > SLIGHT / np.min(omega) ** 2
    if np.any(near[there] <= 0.0):
        return float("inf")
    return float(np.max(np.abs(np.sqrt(exact[there] / near[there]) - 1.0), initial=0.0))


def _inverse(inertia: Real) -> Real:
    """Pseudo-inverse of a rigid mass (6,6), whose translations and rotations have different units."""
    size = np.sqrt(np.repeat([np.trace(inertia[:3, :3]), np.trace(inertia[3:, 3:])], 3))
    size = np.where(size > 0.0, size, 1.0)
    return np.asarray(np.linalg.pinv(inertia / np.outer(size, size), MASSLESS, hermitian=True) / np.outer(size, size))


def _nearest(fields: Real, products: Real, others: Real, number: int) -> Real:
    """Fields (p,k) nearest to the given ones with these products (k,k), orthogonal to the `others` (p,b).

    An orthogonal Procrustes problem. Raises NoMasses, which names the field `number` and so on, if there are none.
    """
    from scipy.linalg import qr

    values, axes = np.linalg.eigh(0.5 * (products + products.T))
    if values[0] < -NEGATIVE * np.abs(values).max():
        raise NoMasses(number + int(np.argmax(np.abs(axes[:, 0]))))
    root = axes * np.sqrt(np.maximum(values, 0.0)) @ axes.T
    size = np.linalg.norm(others, axis=0)
    Q, R, _ = qr(others / np.where(size > 0.0, size, 1.0), pivoting=True)
    free = Q[:, np.count_nonzero(np.abs(np.diag(R)) > MASSLESS) :]
    left, _, right = np.linalg.svd(free.T @ fields @ root, full_matrices=False)
    inertias = np.asarray(free @ (left @ right) @ root)
    if not np.max(np.abs(inertias.T @ inertias - root @ root)) <= UNMOVED * np.abs(values).max():  # too few points
        raise NoMasses(number)
    return inertias
