"""Modal mass matrix and bias of a flexible body to first order in its modal coordinates: the tables of level `linear`.

They are derivatives at the rest shape of the kinetic energy of all inertia points, whose inertias J and offset mass
centres turn with them. With sums over points and rho = r + c,

    rho(eta)  = rho + u_n eta_n + 1/2 a_kn eta_k eta_n     u_n = phi_n + psi_n x c
    L_n(eta)  = u_n + a_kn eta_k                           a_kn = 1/2 (psi_k x (psi_n x c) + psi_n x (psi_k x c))
    W_n(eta)  = psi_n + 1/2 eta_k psi_k x psi_n            angular velocity per modal speed
    RJR'(eta) = J + eta_k T_k                              T_k = psi_k~ J - J psi_k~

each table below is a product of these, truncated after the first order. Only G is of second order, that of J(eta); its
derivative with respect to a coordinate is of first order.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from flexmb.modal.flexible_model import FlexibleModel
from flexmb.scene.quaternions import cross_matrix
from flexmb.typing import Real

_BLOCK = 2**18  # vectors (one for each point and pair of modes) held in memory at once: 6 MB an array


@dataclass(frozen=True)
class FirstOrder:
    """First-order tables of one body about its origin, body axes; n, i, k count the m modes.

    mass            kg          sum m
    s0              (3,)        first moment                    s(eta) = s0 + sum_n eta_n L0_n
    J0              (3,3)       inertia                         J(eta) = J0 + sum_n eta_n E_n
    E               (m,3,3)     symmetric
    C0, L0          (m,3)       coupling of mode n to the       C_n(eta) = C0_n + sum_k eta_k C1_kn
    C1, L1          (m,m,3)     angular and linear velocity     L_n(eta) = L0_n + sum_k eta_k L1_kn    [k,n]
    G               (m,m,3,3)   1/2 d2J/(deta_n deta_k), symmetric in both pairs
    M0              (m,m)       modal masses                    M_ni(eta) = M0_ni + sum_k eta_k M1_kni
    M1              (m,m,m)     [k,n,i]; zero where no mass centre is off its point and all J are isotropic
    """

    mass: float
    s0: Real
    J0: Real
    E: Real
    C0: Real
    L0: Real
    C1: Real
    L1: Real
    G: Real
    M0: Real
    M1: Real


def first_order(model: FlexibleModel) -> FirstOrder:
    """All tables, summed over all points of `model`."""
    count = max(1, _BLOCK // (1 + model.mode_count**2))
    parts = [_sums(_points(model, slice(i, i + count))) for i in range(0, len(model.mass), count)]
    return FirstOrder(**{field.name: sum(getattr(part, field.name) for part in parts) for field in fields(FirstOrder)})


def _points(model: FlexibleModel, chosen: slice) -> FlexibleModel:
    """The chosen points alone."""
    return replace(
        model, mass=model.mass[chosen], position=model.position[chosen], com_offset=model.com_offset[chosen],
        inertia=model.inertia[chosen], translation=model.translation[chosen], rotation=model.rotation[chosen],
    )  # fmt: skip


def _sums(model: FlexibleModel) -> FirstOrder:
    """All tables, summed over the points of `model`; holds a vector for each point and pair of modes in memory."""
    m, J, psi = model.mass, model.inertia, np.swapaxes(model.rotation, 1, 2)
    rho, u, a = _mass_centres(model)
    T = _turning(model)
    # W_n = J_l(theta) psi_n = psi_n + 1/2 theta x psi_n + ...: its derivative by eta_k is half of `swirl`.
    swirl = np.cross(psi[:, :, None], psi[:, None])  # psi_k x psi_n  (p,k,n,3)
    spin = np.einsum("pab,pnb->pna", J, psi)  # J psi_n
    C1 = np.einsum("p,pkna->kna", m, np.cross(u[:, :, None], u[:, None]) + np.cross(rho[:, None, None], a))
    C1 += np.einsum("pkab,pnb->kna", T, psi) + 0.5 * np.einsum("pab,pknb->kna", J, swirl)
    # Product rule for m u_n . u_i + W_n' J W_i: each velocity (the other one by symmetry in n and i), then the tensor.
    M1 = np.einsum("p,pkna,pia->kni", m, a, u, optimize=True)
    M1 += 0.5 * np.einsum("pkna,pia->kni", swirl, spin, optimize=True)
    M1 += np.swapaxes(M1, 1, 2) + np.einsum("pna,pkab,pib->kni", psi, T, psi, optimize=True)
    return FirstOrder(
        mass=float(m.sum()),
        s0=m @ rho,
        J0=steiner(np.einsum("p,pa,pb->ab", m, rho, rho)) + J.sum(axis=0),
        E=inertia_slope(model),
        C0=np.einsum("p,pna->na", m, np.cross(rho[:, None], u)) + spin.sum(axis=0),
        L0=np.einsum("p,pna->na", m, u),
        C1=C1,
        L1=np.einsum("p,pkna->kna", m, a),
        G=_inertia_curvature(model),
        M0=np.einsum("p,pna,pia->ni", m, u, u, optimize=True) + np.einsum("pna,pia->ni", psi, spin, optimize=True),
        M1=M1,
    )


def inertia_slope(model: FlexibleModel) -> Real:
    """E_n = dJ/deta_n at rest shape (m,3,3): twice the symmetric part of sum m (rho.u_n 1 - rho u_n'), plus T_n."""
    rho, u, _ = _mass_centres(model)
    return 2.0 * steiner(np.einsum("p,pa,pnb->nab", model.mass, rho, u, optimize=True)) + _turning(model).sum(axis=0)


def _mass_centres(model: FlexibleModel) -> tuple[Real, Real, Real]:
    """rho (p,3), u (p,m,3) and a (p,m,m,3)."""
    c, psi = model.com_offset[:, None], np.swapaxes(model.rotation, 1, 2)
    swung = np.cross(psi, c)
    a = np.cross(psi[:, :, None], swung[:, None])
    u = np.swapaxes(model.translation, 1, 2) + swung
    return model.position + model.com_offset, u, 0.5 * (a + np.swapaxes(a, 1, 2))


def _turning(model: FlexibleModel) -> Real:
    """T_k = psi_k~ J - J psi_k~ of every point, (p,m,3,3)."""
    turned = cross_matrix(np.swapaxes(model.rotation, 1, 2)) @ model.inertia[:, None]
    return turned + np.swapaxes(turned, -1, -2)


def _inertia_curvature(model: FlexibleModel) -> Real:
    """G_nk = 1/2 d2J/(deta_n deta_k), from the mass centres and from exp(theta~) J exp(-theta~) to second order."""
    rho, u, a = _mass_centres(model)
    places = np.einsum("p,pna,pkb->nkab", model.mass, u, u, optimize=True)
    places += np.einsum("p,pa,pnkb->nkab", model.mass, rho, a, optimize=True)
    # exp(theta~) J exp(-theta~) has the second-order part 1/2 (theta~^2 J + J theta~^2) - theta~ J theta~.
    psi, J = cross_matrix(np.swapaxes(model.rotation, 1, 2)), model.inertia
    twice = 0.5 * np.einsum("pnab,pkbc,pcd->nkad", psi, psi, J, optimize=True)
    across = 0.5 * np.einsum("pnab,pbc,pkcd->nkad", psi, J, psi, optimize=True)
    turned = symmetric(twice + np.swapaxes(twice, 0, 1)) - across - np.swapaxes(across, 0, 1)
    return steiner(places) + turned


def steiner(A: Real) -> Real:
    """The symmetric part of sum m (a.b 1 - b a') from A = sum m a b' (...,3,3)."""
    return np.trace(A, axis1=-2, axis2=-1)[..., None, None] * np.eye(3) - symmetric(A)


def symmetric(A: Real) -> Real:
    """The symmetric part of matrices (...,n,n)."""
    return 0.5 * (A + np.swapaxes(A, -1, -2))
