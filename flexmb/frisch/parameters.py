"""Mode-dependent parameters of one flexible body, (48)-(72): every sum over its elements, done once.

An element is a mass centre: point i of the model carries its mass at x_i = position + com_offset, moved by
phiT_n = translation - com_offset x ... (`_elements`), turned by phiR_n = rotation. All vectors are in body axes; the
origin is the hinge point lambda-1, from which alpha leads to the undeformed mass centre. a_n are modal coordinates.

As printed, the parameters are exactly (48)-(72). As corrected, they give the mass matrix and the bias of the exact
kinetic energy of the elements (which turn by exp(theta~), with their inertia) to first order in a_n and its rate:

    E_n    holds the turning of the elements' inertia, which (12) takes for second order and (52) leaves out;
    K_mn   is the antisymmetric part of dC_n/da_m, of which (72) has another rotary part;
    F_mn   is half the second derivative of the inertia about the hinge point, of which (70) has the particles' part;
    A1, Q1, M1_slope   are what (64) and (96) drop: the slopes of A_n, Q_n and of the modal mass.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexmb.modal.cross import cross_matrix
from flexmb.modal.model import FlexibleModel

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ModeParameters:
    """Mode-dependent parameters of one body with n modes; m, n, k count modes, body axes, SI.

    mass                  kg            (7)
    alpha     (3,)        m             (8), undeformed mass centre from the body origin
    Phi       (3,3)       kg m^2        (17), undeformed inertia about that mass centre
    A         (n,3)                     (48), mass centre: alpha(a) = alpha + sum_n A_n a_n
    B         (n,3)       m             (54)
    C         (n,3)       kg m          (55)
    Q         (n,3)       kg m          (56), angular momentum about the mass centre: sum_n Q_n adot_n
    D         (n,3,3)     kg m          (51)
    E         (n,3,3)     kg m          (52), inertia about the mass centre: Phi(a) = Phi + sum_n E_n a_n
    J         (n,3,3)     kg m          (67)
    H         (n,3,3)     kg m          (68)
    F         (n,n,3,3)   kg            (70), F[m,n]
    K         (n,n,3)     kg            (72), K[m,n], antisymmetric in m, n where corrected
    M1        (n,n)       kg            modal mass, left side of (41): m delta for modes normalised as in the paper
    A1        (n,n,3)     1/m           A1[m,n] = dA_n/da_m; zero in the print
    Q1        (n,n,3)     kg            Q1[m,n] = dQ_n/da_m; zero in the print
    M1_slope  (n,n,n)     kg/m          M1_slope[k,m,n] = dM1_mn/da_k; zero in the print
    stiffness, damping (n,n)            as in the model

    Units are those of modes whose coordinate is a length.
    """

    mass: float
    alpha: Array
    Phi: Array
    A: Array
    B: Array
    C: Array
    Q: Array
    D: Array
    E: Array
    H: Array
    J: Array
    F: Array
    K: Array
    M1: Array
    A1: Array
    Q1: Array
    M1_slope: Array
    stiffness: Array
    damping: Array

    @property
    def mode_count(self) -> int:
        return self.A.shape[0]


@dataclass(frozen=True)
class _Elements:
    """The elements of a body: mass (p,), mass centre x (p,3), its offset c (p,3) from the turning point, inertia
    (p,3,3) about it, and modes phiT, phiR (p,n,3) of mass centre and rotation."""

    mass: Array
    x: Array
    c: Array
    inertia: Array
    phiT: Array
    phiR: Array


def mode_parameters(model: FlexibleModel, *, as_printed: bool = False) -> ModeParameters:
    """Parameters of one flexible body, corrected or exactly as printed; any assumed modes, normalised or not."""
    elements = _elements(model)
    return _printed(elements, model) if as_printed else _corrected(elements, model)


def _elements(model: FlexibleModel) -> _Elements:
    """Mass centres as elements: x = position + c, phiT = translation + rotation x c, phiR = rotation."""
    phi, psi = np.swapaxes(model.translation, 1, 2), np.swapaxes(model.rotation, 1, 2)
    c = model.com_offset
    return _Elements(model.mass, model.position + c, c, model.inertia, phi + np.cross(psi, c[:, None]), psi)


def _printed(e: _Elements, model: FlexibleModel) -> ModeParameters:
    """(48)-(72) to the letter."""
    mass = float(e.mass.sum())  # (7)
    alpha = e.mass @ e.x / mass  # (8)
    rho = e.x - alpha
    Phi = e.inertia.sum(axis=0) + _inertia(np.einsum("p,pa,pb->ab", e.mass, rho, rho))  # (15), (17)
    A = np.einsum("p,pna->na", e.mass, e.phiT) / mass  # (48)
    D = _inertia(np.einsum("p,pa,pnb->nab", e.mass, rho, e.phiT))  # (50), (51)
    B = np.einsum("p,pna->na", e.mass, np.cross(e.x[:, None], e.phiT)) / mass  # (54)
    C = np.einsum("pab,pnb->na", e.inertia, e.phiR)  # (55)
    J = np.einsum("pnab,pbc->nac", cross_matrix(e.phiR), e.inertia)  # (67)
    F = _inertia(np.einsum("p,pma,pnb->mnab", e.mass, e.phiT, e.phiT, optimize=True))  # (70)
    turned = np.einsum("pab,pnb->pna", e.inertia, e.phiR)
    K = _cross_sum(e.mass[:, None, None] * e.phiT, e.phiT) + 0.5 * _cross_sum(turned, e.phiR)  # (72)
    M1 = np.einsum("p,pma,pna->mn", e.mass, e.phiT, e.phiT, optimize=True)  # (41)
    M1 += np.einsum("pma,pna->mn", turned, e.phiR, optimize=True)
    n = len(A)
    return ModeParameters(
        mass=mass,
        alpha=alpha,
        Phi=Phi,
        A=A,
        B=B,
        C=C,
        Q=C + mass * (B - np.cross(alpha, A)),  # (56)
        D=D,
        E=D + np.swapaxes(D, 1, 2),  # (52)
        H=D + J,  # (68)
        J=J,
        F=F,
        K=K,
        M1=0.5 * (M1 + M1.T),
        A1=np.zeros((n, n, 3)),
        Q1=np.zeros((n, n, 3)),
        M1_slope=np.zeros((n, n, n)),
        stiffness=model.stiffness,
        damping=model.damping,
    )


def _corrected(e: _Elements, model: FlexibleModel) -> ModeParameters:
    """(48)-(72) with what the exact kinetic energy has besides, to first order in the coordinates and their rates."""
    print_ = _printed(e, model)
    rho = e.x - print_.alpha
    bend = _curvature(e)
    turn = np.cross(e.phiR[:, :, None], e.phiR[:, None])  # phiR_m x phiR_n
    turned = np.einsum("pab,pnb->pna", e.inertia, e.phiR)
    inertia_turn = np.einsum("pab,pmnb->pmna", e.inertia, turn, optimize=True)
    trace = np.trace(e.inertia, axis1=1, axis2=2)

    # Inertia tensors turn with their element: [phiR~, Phi_i] at first order, instead of (12).
    E = print_.H + np.swapaxes(print_.H, 1, 2)
    A1 = np.einsum("p,pmna->mna", e.mass, bend) / print_.mass
    particles = _cross_sum(e.mass[:, None, None] * e.phiT, e.phiT)
    K = particles + 0.5 * (np.einsum("p,pmna->mna", trace, turn) - 2.0 * inertia_turn.sum(axis=0))
    Q1 = particles - print_.mass * np.cross(print_.A[:, None], print_.A[None])
    Q1 += np.einsum("p,pmna->mna", e.mass, np.cross(rho[:, None, None], bend))
    Q1 += _cross_sum(e.phiR, turned) - 0.5 * inertia_turn.sum(axis=0)
    half = np.einsum("p,pkma,pna->kmn", e.mass, bend, e.phiT, optimize=True)
    half -= 0.5 * np.einsum("pkma,pna->kmn", turn, turned, optimize=True)
    return replace(
        print_, E=E, F=_curved_inertia(e, bend), K=K, A1=A1, Q1=Q1, M1_slope=half + np.swapaxes(half, 1, 2)
    )


def _curvature(e: _Elements) -> Array:
    """Second derivatives (p,n,n,3) of the mass centres exp(theta~) c: (phiR_m x (phiR_n x c) + the same n, m) / 2."""
    arm = np.cross(e.phiR, e.c[:, None])
    nested = np.cross(e.phiR[:, :, None], arm[:, None])
    return 0.5 * (nested + np.swapaxes(nested, 1, 2))


def _curved_inertia(e: _Elements, bend: Array) -> Array:
    """F[m,n] (n,n,3,3): half the second derivatives of sum m (x.x 1 - x x') + R Phi_i R' about the hinge point."""
    moment = np.einsum("p,pma,pnb->mnab", e.mass, e.phiT, e.phiT, optimize=True)
    moment += np.einsum("p,pa,pmnb->mnab", e.mass, e.x, bend, optimize=True)
    moment = 0.5 * (moment + np.swapaxes(moment, 2, 3))
    P = cross_matrix(e.phiR)
    PJ = np.einsum("pnab,pbc->pnac", P, e.inertia)
    # exp(theta~) J exp(-theta~) at second order: (theta~ theta~ J + J theta~ theta~) / 2 - theta~ J theta~
    outer = np.einsum("pmab,pnbc->mnac", P, PJ, optimize=True)
    inner = np.einsum("pmab,pnbc->mnac", PJ, P, optimize=True)
    squared = 0.5 * (outer + np.swapaxes(outer, 2, 3)) - inner
    return _inertia(moment) + 0.5 * (squared + np.swapaxes(squared, 0, 1))


def _inertia(moment: Array) -> Array:
    """tr(S) 1 - S of second moments (..., 3, 3)."""
    return np.trace(moment, axis1=-2, axis2=-1)[..., None, None] * np.eye(3) - moment


def _cross_sum(a: Array, b: Array) -> Array:
    """sum_p a_m x b_n (m,n,3) of vectors (p,m,3) and (p,n,3)."""
    moment = np.einsum("pma,pnb->mnab", a, b, optimize=True)
    return np.stack([moment[..., i, j] - moment[..., j, i] for i, j in ((1, 2), (2, 0), (0, 1))], axis=-1)
