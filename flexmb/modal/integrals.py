"""Modal integrals: the inertia of one flexible body in the equations of motion, summed once over its inertia points.

Body frame throughout; eta are modal coordinates, rho(eta) = r + phi eta a point's position, w and v angular velocity
and velocity of the body frame. Masses at points without `com_offset` have the kinetic energy

    T = 1/2 etadot' M_ff etadot + etadot' C(eta)' w + etadot' s1' v + 1/2 w' J(eta) w + v' (w x s(eta)) + 1/2 m v'v,

a polynomial in eta, without truncation. Inertia that turns with a point (tensors, offset masses) is not polynomial in
eta: such points are listed separately and summed at every evaluation.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexmb.modal.flexible_model import FlexibleModel, SecondOrder, join_second
from flexmb.scene.quaternions import cross_matrix
from flexmb.typing import Index, Real


@dataclass(frozen=True)
class TurningPoints:
    """Inertia that turns with its point by exp(skew(theta)), theta = rotation eta; k points, m modes.

    mass (k,) kg, zero if the mass is part of the polynomial integrals; position (k,3) m; com_offset (k,3) m and inertia
    (k,3,3) kg m^2 about the mass centre, both in point axes; translation and rotation mode shapes (k,3,m);
    second-order field (k,3,m,m), if the body has one; section (k,) of each point, at level exact.
    """

    mass: Real
    position: Real
    com_offset: Real
    inertia: Real
    translation: Real
    rotation: Real
    second: SecondOrder | None = None
    section: Index | None = None


_ARRAYS = ("mass", "position", "com_offset", "inertia", "translation", "rotation")  # of points, also of a FlexibleModel


@dataclass(frozen=True)
class ModalIntegrals:
    """Sums over the masses without offset, with m modes; ~ is the cross-product matrix.

    mass           kg          sum m
    s0             (3,)        sum m r
    s1             (3,m)       sum m phi                      s(eta) = s0 + s1 eta
    J0             (3,3)       sum m r~' r~
    J1             (m,3,3)     sum m phi_n~' r~               J(eta) = J0 + sum_n eta_n (J1_n + J1_n')
    J2             (m,m,3,3)   sum m phi_n~' phi_k~                    + sum_nk eta_n eta_k J2_nk
    C0             (3,m)       sum m r x phi_n                C(eta)_n = C0_n + sum_k eta_k C1_kn
    C1             (m,3,m)     sum m phi_k x phi_n            (first index k, last n; antisymmetric in k, n)
    M_ff           (m,m)       sum m phi_n . phi_k
    turning        points that are summed at every evaluation (see `TurningPoints`)
    spatial_mass   (m+6,m+6)   mass matrix at eta = 0 of the whole body, turning points included,
                               order [modes; angular; linear] about the body origin
    stiffness, damping (m,m)   as in the model
    """

    mass: float
    s0: Real
    s1: Real
    J0: Real
    J1: Real
    J2: Real
    C0: Real
    C1: Real
    M_ff: Real
    turning: TurningPoints
    spatial_mass: Real
    stiffness: Real
    damping: Real

    @property
    def mode_count(self) -> int:
        return self.M_ff.shape[0]


def modal_integrals(model: FlexibleModel) -> ModalIntegrals:
    """All integrals of one flexible body."""
    offset = np.any(model.com_offset != 0.0, axis=1)  # such masses swing with their point: not polynomial in eta
    m = np.where(offset, 0.0, model.mass)
    r, phi = model.position, model.translation
    r_cross, phi_cross = cross_matrix(r), cross_matrix(np.swapaxes(phi, 1, 2))
    return ModalIntegrals(
        mass=float(m.sum()),
        s0=m @ r,
        s1=np.einsum("p,pan->an", m, phi),
        J0=np.einsum("p,pca,pcb->ab", m, r_cross, r_cross),
        J1=np.einsum("p,pnca,pcb->nab", m, phi_cross, r_cross),
        J2=np.swapaxes(_summed(m[:, None, None, None] * phi_cross, phi_cross, (0, 2)), 1, 2),
        C0=np.einsum("p,pab,pbn->an", m, r_cross, phi),
        C1=np.tensordot(m[:, None, None, None] * phi_cross, phi, axes=((0, 3), (0, 1))),
        M_ff=_summed(m[:, None, None] * phi, phi, (0, 1)),
        turning=_turning(model, offset),
        spatial_mass=_spatial_mass(model),
        stiffness=model.stiffness,
        damping=model.damping,
    )


def _summed(a: Real, b: Real, axes: tuple[int, int]) -> Real:
    """Products summed over the same axes of both; by einsum, the search for an order would take longer than the sum."""
    return np.tensordot(a, b, axes=(axes, axes))


def _turning(model: FlexibleModel, offset: NDArray[np.bool_]) -> TurningPoints:
    """Points with an offset mass, with mass and tensor, and other points with a tensor, without their mass."""
    kept = np.flatnonzero(offset | np.any(model.inertia != 0.0, axis=(1, 2)))
    return _chosen(replace(model, mass=np.where(offset, model.mass, 0.0)), kept)


def _spatial_mass(model: FlexibleModel) -> Real:
    """sum m U'U + W' J W at eta = 0: U = [phi + psi x c, -(r + c)~, 1] and W = [psi, 1, 0] map [etadot; w; v] to the
    mass centre's velocity and the point's angular velocity."""
    count, _, modes = model.translation.shape
    one = np.broadcast_to(np.eye(3), (count, 3, 3))
    c = cross_matrix(model.com_offset)
    U = np.concatenate([model.translation - c @ model.rotation, -cross_matrix(model.position) - c, one], axis=2)
    W = np.concatenate([model.rotation, one, np.zeros((count, 3, 3))], axis=2)
    moving = _summed(model.mass[:, None, None] * U, U, (0, 1))
    return moving + _summed(W, model.inertia @ W, (0, 1))


def still_points(model: FlexibleModel, chosen: NDArray[np.intp]) -> TurningPoints:
    """Masses without offset, as points that are summed at every evaluation but do not turn."""
    zeros = {name: np.zeros_like(getattr(model, name)) for name in ("com_offset", "inertia", "rotation")}
    return _chosen(replace(model, **zeros), chosen)


def _chosen(model: FlexibleModel, chosen: NDArray[np.intp]) -> TurningPoints:
    """The points of these numbers."""
    second = None if model.second is None else model.second.map(lambda G: G[chosen])
    section = None if model.section is None else model.section[chosen]
    return TurningPoints(*(getattr(model, name)[chosen] for name in _ARRAYS), second=second, section=section)


def stacked(first: TurningPoints, then: TurningPoints) -> TurningPoints:
    """Two sets of points as one; both have a second-order field, or none."""

    def along(name: str) -> Real:
        return np.concatenate([getattr(first, name), getattr(then, name)])

    return TurningPoints(*map(along, _ARRAYS), second=join_second(first.second, then.second))
