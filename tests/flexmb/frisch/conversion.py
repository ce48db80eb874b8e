"""Conversion between the mode-dependent parameters and the modal integrals of the recursion.

Both are sums over the same body. The parameters are about its mass centre, to first order in the coordinates. The
integrals are about the body origin and exact in the coordinates, with turning points listed one by one. Therefore the
integrals give all parameters, while the parameters give the integrals only together with the turning points: C_n, J_n
and the rotary parts of the others are sums from which the single points cannot be recovered.
"""

from __future__ import annotations

import numpy as np

from flexmb.frisch.elements import Particles, Rotary, Slopes, elements, inertia_of, particles, rotary, slopes
from flexmb.frisch.parameters import ModeParameters, assemble
from flexmb.modal.cross import cross_matrix
from flexmb.modal.integrals import ModalIntegrals, TurningPoints
from flexmb.typing import Real

# Relative difference between the turning inertia in the parameters and that of the given points that is still
# attributed to rounding in the sums.
_ROUND_OFF = 1e-12


def from_integrals(integrals: ModalIntegrals, *, as_printed: bool = False) -> ModeParameters:
    """All parameters (48)-(72) of a body of which only the modal integrals are known.

    The sums are moved from the body origin to the mass centre, by subtraction: with r the radius of gyration, relative
    rounding errors grow as (|alpha| / r)^2.
    """
    i = integrals
    turned = elements(i.turning)
    mass = i.mass + float(turned.mass.sum())
    alpha = (i.s0 + turned.mass @ turned.x) / mass
    s1 = i.s1.T
    moved = Particles(
        mass=i.mass,
        Phi=i.J0 - _steiner(alpha, i.s0) - _steiner(i.s0, alpha) + i.mass * _steiner(alpha, alpha),
        mA=s1,
        mQ=i.C0.T - np.cross(alpha, s1),
        D=i.J1 - _steiner(alpha, s1),
        F=np.swapaxes(i.J2, 0, 1),
        K=np.swapaxes(i.C1, 1, 2),
        M1=i.M_ff,
    )
    masses = _combined(moved, particles(turned, alpha), 1.0)
    return assemble(alpha, masses, turned, i.stiffness, i.damping, as_printed=as_printed)


def to_integrals(parameters: ModeParameters, turning: TurningPoints | None = None) -> ModalIntegrals:
    """The modal integrals about the body origin of the body with these corrected parameters.

    `turning` are its points with inertia or offset mass centre; if it is None, all masses must be particles. Raises
    ValueError if the turning inertia in the parameters is not that of `turning`, or if they are the printed ones.
    """
    p = parameters
    points = _none(p.mode_count) if turning is None else turning
    turned = elements(points)
    own, slope = rotary(turned), slopes(turned, p.alpha)
    K = p.K - slope.K
    every = Particles(
        mass=p.mass,
        Phi=p.Phi - own.Phi,
        mA=p.mass * p.A,
        mQ=p.Q - own.C,
        D=p.D,
        F=p.F - slope.F + 0.5 * cross_matrix(K),  # F_mn has only the symmetric part; K_mn has the antisymmetric one
        K=K,
        M1=p.M1 - own.M1,
    )
    _check(p, every, own, slope)
    rest = _combined(every, particles(turned, p.alpha), -1.0)
    s0 = p.mass * p.alpha - turned.mass @ turned.x
    return ModalIntegrals(
        mass=rest.mass,
        s0=s0,
        s1=rest.mA.T,
        J0=rest.Phi + _steiner(p.alpha, s0) + _steiner(s0, p.alpha) - rest.mass * _steiner(p.alpha, p.alpha),
        J1=rest.D + _steiner(p.alpha, rest.mA),
        J2=np.swapaxes(rest.F, 0, 1),
        C0=(rest.mQ + np.cross(p.alpha, rest.mA)).T,
        C1=np.swapaxes(rest.K, 1, 2),
        M_ff=rest.M1,
        turning=points,
        spatial_mass=_spatial_mass(p),
        stiffness=p.stiffness,
        damping=p.damping,
    )


def _check(p: ModeParameters, every: Particles, own: Rotary, slope: Slopes) -> None:
    """Raise ValueError unless the turning inertia in the parameters is that of the given points."""
    length = np.sqrt(np.trace(p.Phi) / p.mass) + float(np.linalg.norm(p.alpha))
    shape = np.sqrt(float(np.max(np.diag(p.M1), initial=0.0)) / p.mass)
    Q1 = every.K - p.mass * np.cross(p.A[:, None], p.A[None]) + slope.Q1
    left = {
        "C": (p.C - own.C, length * shape),
        "J": (p.J - own.J, length * shape),
        "A1": (p.mass * p.A1 - slope.mA1, shape**2 / length),
        "Q1": (p.Q1 - Q1, shape**2),
        "M1_slope": (p.M1_slope - slope.M1, shape**3 / length),
    }
    for name, (rest, size) in left.items():
        if np.any(np.abs(rest) > _ROUND_OFF * p.mass * size):
            raise ValueError(
                f"the parameters' {name} is not that of the given turning points, and the points cannot be recovered "
                "from the sums: pass the body's points with inertia or offset mass centre as `turning`, and corrected "
                "parameters, not the printed ones"
            )


def _combined(a: Particles, b: Particles, sign: float) -> Particles:
    """a + sign b, field by field, for sums about the same point."""
    return Particles(*(getattr(a, name) + sign * getattr(b, name) for name in Particles.__dataclass_fields__))


def _steiner(a: Real, b: Real) -> Real:
    """a.b 1 - a b' (..., 3, 3)."""
    return inertia_of(a[..., :, None] * b[..., None, :])


def _none(modes: int) -> TurningPoints:
    """No turning points, for a body with that many modes."""
    vectors, shapes = np.zeros((0, 3)), np.zeros((0, 3, modes))
    return TurningPoints(np.zeros(0), vectors, vectors, np.zeros((0, 3, 3)), shapes, shapes)


def _spatial_mass(p: ModeParameters) -> Real:
    """Mass matrix (n+6,n+6) at rest, order [modes; angular; linear], about the body origin."""
    mA = p.mass * p.A
    C0 = p.Q + np.cross(p.alpha, mA)
    J0 = p.Phi + p.mass * _steiner(p.alpha, p.alpha)
    arm = p.mass * cross_matrix(p.alpha)
    return np.block([[p.M1, C0, mA], [C0.T, J0, arm], [mA.T, arm.T, p.mass * np.eye(3)]])
