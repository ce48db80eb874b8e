"""Reduction of the inertia points of a body to few point masses with the same kinetic energy to the third order.

All integrals of the masses are sums m a b of two scalar fields a, b on the points: 1, components of the rest position
r, of the mode shapes phi_n and of the second-order field G_ni. Take a basis that is orthonormal under sum m a b and
spans 1, r and phi, and equal masses, one for each basis function. The coefficients of the fields in this basis, divided
by the square root of such a mass, are the positions, the mode shapes and the field of the new points. Every integral
that contains 1, r or phi is then exact. Only products G.G, of fourth order in (eta, etadot), lack the part of G outside
the basis, a nonnegative term of the kinetic energy. The mass matrix is a sum over the new masses and thus positive.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flexmb.modal.flexible_model import FlexibleModel, SecondOrder, join_second
from flexmb.typing import Flags, Real

NEGLIGIBLE = 1e-12
"""A field of unit norm whose remainder orthogonal to the others is below this is taken to lie in their span."""


def with_equivalent_masses(model: FlexibleModel, like: FlexibleModel | None = None) -> FlexibleModel:
    """The body with the fewest possible point masses if it has a second-order field; else the body itself.

    Masses with an offset are kept. Inertia tensors are kept on points without mass. `like`: the same body with slightly
    other numbers, also with all its points. The basis is then turned such that it is nearest to that of `like`, and
    depends smoothly on the numbers of the body.
    """
    if model.second is None:
        return model
    still = _still(model)
    m, count = model.mass[still], int(np.count_nonzero(still))
    if count == 0:
        return model
    basis = _basis(_fields(model, still))
    if basis.shape[1] >= count:
        return model
    if like is not None:
        basis = _turned(basis, _basis(_fields(like, _still(like))))
    to_points = _equal_masses(basis, m) * np.sqrt(m)
    turning = ~still | np.any(model.inertia != 0.0, axis=(1, 2))
    size, none = len(to_points), np.zeros_like

    def joined(new: Real, old: Real) -> Real:
        return np.concatenate([new, old[turning]])

    def moved(field: Real) -> Real:
        return np.tensordot(to_points, field[still], axes=1)

    position, translation, G = moved(model.position), moved(model.translation), moved(model.second.translation)
    return replace(
        model,
        mass=joined(np.full(size, m.sum() / size), np.where(still, 0.0, model.mass)),
        position=joined(position, model.position),
        com_offset=joined(none(position), model.com_offset),
        inertia=joined(np.zeros((size, 3, 3)), model.inertia),
        translation=joined(translation, model.translation),
        rotation=joined(none(translation), model.rotation),
        second=join_second(SecondOrder(G, none(G)), model.second.map(lambda M: M[turning])),
    )


def _still(model: FlexibleModel) -> Flags:
    """Which points (n,) have a mass without an offset."""
    flags: Flags = (model.mass > 0.0) & ~np.any(model.com_offset != 0.0, axis=1)
    return flags


def _fields(model: FlexibleModel, still: Flags) -> Real:
    """Columns of 1, r and phi at these points, times sqrt(m): their scalar products are the integrals sum m a b, which
    an orthogonal map keeps."""
    m, count = model.mass[still], int(np.count_nonzero(still))
    fields = [np.ones((count, 1)), model.position[still], model.translation[still].reshape(count, -1)]
    return np.concatenate(fields, axis=1) * np.sqrt(m)[:, None]


def _turned(basis: Real, reference: Real) -> Real:
    """The orthonormal basis of the same space that is nearest to a reference basis (Procrustes)."""
    if basis.shape != reference.shape:
        raise ValueError(f"the equivalent masses change their number, {reference.shape[1]} to {basis.shape[1]}")
    U, _, Vt = np.linalg.svd(basis.T @ reference)
    return np.asarray(basis @ (U @ Vt))


def _basis(fields: Real) -> Real:
    """Orthonormal columns that span those of `fields` (points, n), each scaled to unit length first."""
    from scipy.linalg import qr  # slow to import, and only level stiffened needs it

    size = np.linalg.norm(fields, axis=0)  # scaled columns make the test for rank independent of units and modal masses
    Q, R, _ = qr(fields[:, size > 0.0] / size[size > 0.0], mode="economic", pivoting=True)
    return np.asarray(Q[:, np.abs(np.diag(R)) > NEGLIGIBLE])


def _equal_masses(basis: Real, m: Real) -> Real:
    """Rows (r, points) that map a field times sqrt(m) to its values at r points of mass sum(m) / r.

    The field 1 must have the value 1 at every new point, hence equal coefficients: a Householder reflection of the
    basis maps its coefficients to equal ones of the same norm.
    """
    r = basis.shape[1]
    coefficients, equal = basis.T @ np.sqrt(m), np.full(r, np.sqrt(m.sum() / r))
    normal = coefficients - equal
    if np.any(normal):
        basis = basis - 2.0 * np.outer(basis @ normal, normal) / (normal @ normal)
    return np.asarray(basis.T / np.sqrt(m.sum() / r))
