"""Mode-dependent parameters of one flexible body, (48)-(72): all sums over its elements, evaluated once.

Body axes; the body origin is the hinge point lambda-1; a_n are modal coordinates (`eta` elsewhere).

The printed parameters are exactly (48)-(72). The corrected ones give the mass matrix and the bias of the exact kinetic
energy of the elements to first order in a_n and its rate. The two differ only where elements turn:

    E_n    is H_n + H_n': the turning of inertias is of first order, while (12) calls it second, and (52) omits it
    K_mn   has the rotary part 1/2 (tr(Phi_i) 1 - 2 Phi_i)(phiR_m x phiR_n), not that of (72), which produces power
    F_mn   is half the second derivative of the inertia about the hinge point, (70) that of the masses alone
    A1, Q1, M1_slope   are the slopes of A_n, Q_n and of the modal mass; (64) and (96) drop them

with two exceptions: point masses have slopes Q1 as well, and the corrected F_mn is symmetric, because only its
symmetric part has an effect.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexmb.frisch.elements import Elements, Particles, elements, mass_centre, particles, rotary, slopes, turning
from flexmb.frisch.normalisation import check_boundary
from flexmb.modal.flexible_model import FlexibleModel
from flexmb.typing import Real


@dataclass(frozen=True)
class ModeParameters:
    """Mode-dependent parameters of one body with n modes; m, n, k count modes, body axes, SI.

    mass                  kg            (7)
    alpha     (3,)        m             (8), undeformed mass centre from the body origin
    Phi       (3,3)       kg m^2        (17), undeformed inertia about that mass centre
    A         (n,3)                     (48), mass centre (47): alpha(a) = alpha + sum_n A_n a_n
    B         (n,3)       m             (54)
    C         (n,3)       kg m          (55)
    Q         (n,3)       kg m          (56), angular momentum about the mass centre (53): sum_n Q_n adot_n
    D         (n,3,3)     kg m          (51)
    E         (n,3,3)     kg m          (52), inertia about the mass centre (49): Phi(a) = Phi + sum_n E_n a_n
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
    alpha: Real
    Phi: Real
    A: Real
    B: Real
    C: Real
    Q: Real
    D: Real
    E: Real
    H: Real
    J: Real
    F: Real
    K: Real
    M1: Real
    A1: Real
    Q1: Real
    M1_slope: Real
    stiffness: Real
    damping: Real

    @property
    def mode_count(self) -> int:
        return self.A.shape[0]


def mode_parameters(model: FlexibleModel, *, as_printed: bool = False, name: str = "flexible body") -> ModeParameters:
    """Parameters of one flexible body, corrected or exactly as printed, (48)-(72).

    Any assumed modes will do: if they are not normalised by (41), M1 is a full matrix, and the printed parameters are
    the paper's in other coordinates. The corrected ones are also valid for free-free modes. Raises ValueError, which
    names the body `name`, for printed parameters of modes that are not clamped at the body origin.
    """
    if as_printed:
        if not model.clamped:
            raise ValueError(
                f"{name}: its modes are free-free, but the paper's are clamped at the hinge point; give modes with the "
                'boundary "clamped-free", or use the corrected equations, which hold for both'
            )
        check_boundary(model, name)
    every = elements(model)
    alpha = mass_centre(every)
    masses = particles(every, alpha)
    return assemble(alpha, masses, turning(every), model.stiffness, model.damping, as_printed=as_printed)


def assemble(
    alpha: Real, masses: Particles, turned: Elements, stiffness: Real, damping: Real, *, as_printed: bool
) -> ModeParameters:
    """Parameters from the sums over all masses, about their mass centre alpha, and the turning elements."""
    m, D = masses.mass, masses.D
    A = masses.mA / m  # (48)
    own = rotary(turned)
    H = D + own.J  # (68)
    M1 = masses.M1 + own.M1
    n = len(A)
    if as_printed:
        E, F, K = D + np.swapaxes(D, 1, 2), masses.F, masses.K + own.K  # (52), (70), (72)
        A1, Q1, M1_slope = np.zeros((n, n, 3)), np.zeros((n, n, 3)), np.zeros((n, n, n))
    else:
        slope = slopes(turned, alpha)
        E = H + np.swapaxes(H, 1, 2)
        F = 0.5 * (masses.F + np.swapaxes(masses.F, 2, 3)) + slope.F
        K = masses.K + slope.K
        A1 = slope.mA1 / m
        Q1 = masses.K - m * np.cross(A[:, None], A[None]) + slope.Q1
        M1_slope = slope.M1
    return ModeParameters(
        mass=m,
        alpha=alpha,
        Phi=masses.Phi + own.Phi,  # (15), (17)
        A=A,
        B=masses.mQ / m + np.cross(alpha, A),  # (54)
        C=own.C,
        Q=own.C + masses.mQ,  # (56)
        D=D,
        E=E,
        H=H,
        J=own.J,
        F=F,
        K=K,
        M1=0.5 * (M1 + M1.T),
        A1=A1,
        Q1=Q1,
        M1_slope=M1_slope,
        stiffness=stiffness,
        damping=damping,
    )
