"""Elements of a flexible body and sums over them: point masses at mass centres, and inertias that turn with them.

Element i is the mass m_i at its mass centre x_i = position + c, moved by the mode vectors phiT and turned by phiR, with
its own inertia Phi_i. It turns by exp(theta~), theta = sum_n a_n phiR_n, and carries c along, so that

    x_i(a) = x_i + sum_n a_n phiT_n + 1/2 sum_mn a_m a_n bend_mn + ...,    R_i(a) = 1 + theta~ + 1/2 theta~ theta~ + ...
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexmb.modal.flexible_model import FlexibleModel
from flexmb.modal.integrals import TurningPoints
from flexmb.scene.quaternions import cross_matrix
from flexmb.typing import Real


@dataclass(frozen=True)
class Elements:
    """p elements in body axes: mass (p,) kg, mass centre x (p,3) m, its offset c (p,3) m from the turning point,
    inertia (p,3,3) kg m^2 about the mass centre, modes phiT, phiR (p,n,3) of mass centre and rotation."""

    mass: Real
    x: Real
    c: Real
    inertia: Real
    phiT: Real
    phiR: Real


@dataclass(frozen=True)
class Particles:
    """Sums over masses, without the elements' own inertia; about the body's mass centre where a position enters.

    mass (7); Phi (3,3) the masses' part of (17); mA (n,3) mass times (48); mQ (n,3) the masses' part of (56);
    D (n,3,3) (51); F (n,n,3,3) (70); K (n,n,3) the masses' part of (72); M1 (n,n) that of (41).
    """

    mass: float
    Phi: Real
    mA: Real
    mQ: Real
    D: Real
    F: Real
    K: Real
    M1: Real


@dataclass(frozen=True)
class Rotary:
    """Sums over turning elements as printed: the contribution of the elements' own inertia.

    Phi (3,3) their part of (17); C (n,3) (55); J (n,3,3) (67); K (n,n,3) their part of (72); M1 (n,n) that of (41).
    """

    Phi: Real
    C: Real
    J: Real
    K: Real
    M1: Real


@dataclass(frozen=True)
class Slopes:
    """Sums over turning elements that the print omits or has in another form; indices as in `ModeParameters`.

    K (n,n,3) their part of K_mn; mA1, Q1 (n,n,3); M1 (n,n,n) [k,m,n]; F (n,n,3,3).
    """

    K: Real
    mA1: Real
    Q1: Real
    M1: Real
    F: Real


def elements(points: FlexibleModel | TurningPoints) -> Elements:
    """Elements of a body, or of its turning points: phiT is that of the mass centre, translation + rotation x c."""
    phi, psi = np.swapaxes(points.translation, 1, 2), np.swapaxes(points.rotation, 1, 2)
    c = points.com_offset
    return Elements(points.mass, points.position + c, c, points.inertia, phi + np.cross(psi, c[:, None]), psi)


def turning(e: Elements) -> Elements:
    """The elements that are not mere point masses: they have inertia, or a mass centre off the turning point."""
    kept = np.any(e.inertia != 0.0, axis=(1, 2)) | np.any(e.c != 0.0, axis=1)
    return Elements(e.mass[kept], e.x[kept], e.c[kept], e.inertia[kept], e.phiT[kept], e.phiR[kept])


def particles(e: Elements, alpha: Real) -> Particles:
    """Sums over the masses of `e` about the point `alpha` (3,)."""
    rho = e.x - alpha
    moment = np.einsum("p,pma,pnb->mnab", e.mass, e.phiT, e.phiT, optimize=True)
    return Particles(
        mass=float(e.mass.sum()),
        Phi=inertia_of(np.einsum("p,pa,pb->ab", e.mass, rho, rho)),
        mA=np.einsum("p,pna->na", e.mass, e.phiT),
        mQ=np.einsum("p,pna->na", e.mass, np.cross(rho[:, None], e.phiT)),
        D=inertia_of(np.einsum("p,pa,pnb->nab", e.mass, rho, e.phiT)),
        F=inertia_of(moment),
        K=axial(moment),
        M1=np.trace(moment, axis1=2, axis2=3),
    )


def mass_centre(e: Elements) -> Real:
    """alpha (3,), (8); the origin for a body without mass, such as the ring of a gimbal."""
    mass = e.mass.sum()
    return e.mass @ e.x / mass if mass > 0.0 else np.zeros(3)


def rotary(e: Elements) -> Rotary:
    """Sums over the inertia of turning elements, as printed."""
    turned = np.einsum("pab,pnb->pna", e.inertia, e.phiR)  # Phi_i . phiR_n
    moment = np.einsum("pma,pnb->mnab", turned, e.phiR, optimize=True)
    return Rotary(
        Phi=e.inertia.sum(axis=0),
        C=turned.sum(axis=0),
        J=np.einsum("pnab,pbc->nac", cross_matrix(e.phiR), e.inertia),
        K=0.5 * axial(moment),
        M1=np.trace(moment, axis1=2, axis2=3),
    )


def slopes(e: Elements, alpha: Real) -> Slopes:
    """First-order terms in the coordinates of the exact kinetic energy of turning elements, about `alpha`.

    At unit rate adot_n the angular velocity of an element is phiR_n + 1/2 theta~ phiR_n and the velocity of its mass
    centre phiT_n + sum_k a_k bend_kn; its inertia is Phi_i + [theta~, Phi_i], of which (12) omits the second term as if
    it were of second order. Hence

        M1[k,m,n] = sum m_i (bend_km . phiT_n + phiT_m . bend_kn)
                    - 1/2 ((phiR_k x phiR_m) . Phi_i phiR_n + phiR_m . Phi_i (phiR_k x phiR_n))
        Q1[k,n]   = sum m_i (x_i - alpha) x bend_kn + phiR_k x Phi_i phiR_n - 1/2 Phi_i (phiR_k x phiR_n)
        K[k,n]    = (Q1[k,n] - Q1[n,k]) / 2 = sum 1/2 (tr(Phi_i) 1 - 2 Phi_i)(phiR_k x phiR_n)

    in place of 1/2 (Phi_i phiR_k) x phiR_n in (72).
    """
    bend = _curvature(e)
    turn = np.cross(e.phiR[:, :, None], e.phiR[:, None])  # phiR_m x phiR_n
    turned = np.einsum("pab,pnb->pna", e.inertia, e.phiR)
    inertia_turn = np.einsum("pab,pmnb->mna", e.inertia, turn, optimize=True)
    trace = np.trace(e.inertia, axis1=1, axis2=2)
    half = np.einsum("p,pkma,pna->kmn", e.mass, bend, e.phiT, optimize=True)
    half -= 0.5 * np.einsum("pkma,pna->kmn", turn, turned, optimize=True)
    swept = np.einsum("p,pmna->mna", e.mass, np.cross((e.x - alpha)[:, None, None], bend))
    carried = axial(np.einsum("pma,pnb->mnab", e.phiR, turned, optimize=True))
    return Slopes(
        K=0.5 * (np.einsum("p,pmna->mna", trace, turn) - 2.0 * inertia_turn),
        mA1=np.einsum("p,pmna->mna", e.mass, bend),
        Q1=swept + carried - 0.5 * inertia_turn,
        M1=half + np.swapaxes(half, 1, 2),
        F=_curved_inertia(e, bend),
    )


def inertia_of(moment: Real) -> Real:
    """tr(S) 1 - S of second moments (..., 3, 3)."""
    return np.trace(moment, axis1=-2, axis2=-1)[..., None, None] * np.eye(3) - moment


def axial(moment: Real) -> Real:
    """sum a x b (..., 3) of sums of a b' (..., 3, 3)."""
    return np.stack([moment[..., i, j] - moment[..., j, i] for i, j in ((1, 2), (2, 0), (0, 1))], axis=-1)


def _curvature(e: Elements) -> Real:
    """bend (p,n,n,3), the second derivatives of exp(theta~) c: 1/2 (phiR_m x (phiR_n x c) + phiR_n x (phiR_m x c))."""
    arm = np.cross(e.phiR, e.c[:, None])
    nested = np.cross(e.phiR[:, :, None], arm[:, None])
    return 0.5 * (nested + np.swapaxes(nested, 1, 2))


def _curved_inertia(e: Elements, bend: Real) -> Real:
    """Half the second derivatives (n,n,3,3) of the inertia about the body origin with respect to turning.

    The masses contribute by `bend` of their mass centres, the inertias exp(theta~) Phi_i exp(-theta~) by their
    second-order term 1/2 (theta~ theta~ Phi_i + Phi_i theta~ theta~) - theta~ Phi_i theta~.
    """
    moment = np.einsum("p,pa,pmnb->mnab", e.mass, e.x, bend, optimize=True)
    P = cross_matrix(e.phiR)
    P_inertia = np.einsum("pnab,pbc->pnac", P, e.inertia)
    outer = np.einsum("pmab,pnbc->mnac", P, P_inertia, optimize=True)
    inner = np.einsum("pmab,pnbc->mnac", P_inertia, P, optimize=True)
    turned = _symmetric(outer) - inner
    return inertia_of(_symmetric(moment)) + 0.5 * (turned + np.swapaxes(turned, 0, 1))


def _symmetric(tensors: Real) -> Real:
    """Symmetric parts of tensors (..., 3, 3)."""
    return 0.5 * (tensors + np.swapaxes(tensors, -2, -1))
