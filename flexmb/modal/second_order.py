"""Second-order field of a beam: the motion of axis and sections that is quadratic in the modal coordinates.

The modal coordinates measure strain: curvature and twist kappa = theta' of the modes, stretch and shears Gamma =
[e, gamma_y, gamma_z], all in axes that turn with the section, are linear in eta, so that the strain energy
1/2 eta' K eta is exact. The beam's kinematics R' = R kappa~, r' = R (e_x + Gamma) then give the rotation vector and the
position to second order,

    theta_2 = 1/2 int theta x theta' dx
    u_2'    = theta_2 x e_x + 1/2 theta x (theta x e_x) + theta x Gamma

with theta = psi eta of first order. For bending alone, u_2 is the foreshortening -1/2 int (v'^2 + w'^2) dx along the
axis, which causes centrifugal stiffening, gravity stiffening and buckling. Bending in two planes together with torsion
also turns the sections and displaces them laterally, which causes lateral buckling. The integrals start at the root,
whose motion is of first order.
"""

from __future__ import annotations

import numpy as np

from flexmb.modal.beam import BeamElements
from flexmb.modal.flexible_model import SecondOrder
from flexmb.scene.collocation import gauss_rule
from flexmb.typing import Real

GAUSS_POINTS = 6
"""Exact to degree 11. Between nodes theta and Gamma are polynomials of degree 4, x theta x theta' of degree 8."""
_X = np.array([1.0, 0.0, 0.0])


def beam_second_order(elements: BeamElements, columns: Real, x: Real, offset: Real) -> SecondOrder:
    """Field (n,3,m,m) of points at `offset` (n,3) m from the axis points x (n,), in the sections of these.

    `columns` (size,m) are the modes. A point off the axis turns with its section, which adds
    theta_2 x o + 1/2 theta x (theta x o) to the displacement of the axis.
    """
    # The integrals start at the root, so x = 0 is always among the places.
    where, place = np.unique(np.concatenate([[0.0], x]), return_inverse=True)
    axis = _axis(elements, columns, where).map(lambda G: G[place[1:]])
    theta = np.swapaxes(elements.motion(x, columns)[:, 3:], 1, 2)
    swung = np.cross(np.moveaxis(axis.rotation, 1, -1), offset[:, None, None])
    swung += _symmetric(np.cross(theta[:, :, None], np.cross(theta, offset[:, None])[:, None]))
    return SecondOrder(axis.translation + np.moveaxis(swung, -1, 1), axis.rotation)


def _axis(elements: BeamElements, columns: Real, x: Real) -> SecondOrder:
    """Field of the axis at ascending x (n,), the first of which is 0, by cumulative sums over the pieces in between.

    int_0^x theta_2 = x int theta_2' - int x theta_2' by parts, which needs no nested integral.
    """
    breaks = np.union1d(elements.mesh.nodes, x)
    s, w = gauss_rule(GAUSS_POINTS)
    half = np.diff(breaks) / 2.0
    at = (breaks[:-1] + half)[:, None] + half[:, None] * s
    pieces = np.array([_integrals(elements, columns, *piece) for piece in zip(at, half[:, None] * w, strict=True)])
    total = np.concatenate([np.zeros((1, *pieces.shape[1:])), np.cumsum(pieces, axis=0)])
    rotation, moment, slope = np.moveaxis(total[np.searchsorted(breaks, x)], 1, 0)
    translation = slope + np.cross(x[:, None, None, None] * rotation - moment, _X)
    return SecondOrder(np.moveaxis(translation, -1, 1), np.moveaxis(rotation, -1, 1))


def _integrals(elements: BeamElements, columns: Real, x: Real, weight: Real) -> Real:
    """Over the points x of one piece (3,m,m,3): of theta_2', x theta_2', u_2' - theta_2 x e_x."""
    turning, slope = _rates(elements, columns, x)
    sums = (weight, turning), (weight * x, turning), (weight, slope)
    return np.array([np.tensordot(w, rate, axes=1) for w, rate in sums])


def _rates(elements: BeamElements, columns: Real, x: Real) -> tuple[Real, Real]:
    """For pairs of modes (n,m,m,3): theta_2', and u_2' without theta_2 x e_x."""
    # The field is 1/2 eta' G eta: a term 1/2 a x b gives G the symmetric part of a x b, a term a x b twice that.
    theta = np.swapaxes(elements.motion(x, columns)[:, 3:], 1, 2)
    strain, curvature = (np.swapaxes(matrix, 1, 2) for matrix in elements.strain(x, columns))
    turning = _symmetric(np.cross(theta[:, :, None], curvature[:, None]))
    tilting = _symmetric(np.cross(theta[:, :, None], np.cross(theta, _X)[:, None]))
    return turning, tilting + 2.0 * _symmetric(np.cross(theta[:, :, None], strain[:, None]))


def _symmetric(product: Real) -> Real:
    """The part (n,m,m,3) that is symmetric in the modes."""
    return 0.5 * (product + np.swapaxes(product, 1, 2))
