"""An appendage with modes compared with the same appendage as a rigid body on a spring hinge, (149)-(151).

The two models describe the same motion as far as mass-centre velocity, rate of the inertia tensor and relative angular
momentum agree, seen from the base. With rates adot_n of the modes and omega = sum_m thetadot_m q_m of the hinge,

    (149)   omega x b                     against   sum_n adot_n A_n       b from the hinge to the mass centre
    (150)   omega x Phi - Phi x omega     against   sum_n adot_n E_n
    (151)   Phi . omega                   against   sum_n adot_n Q_n

**Norm.** The differences are measured by kinetic energy. A motion with the mass-centre velocity v and the angular
momentum h about the mass centre has at least the energy (m v.v + h.Phi^-1.h) / 2, that of a rigid body; the modes have
sum_mn adot_m M1_mn adot_n / 2, which is m |adot|^2 / 2 under (41). So the mismatches are

    (149)   sqrt(m) |difference|,   (150)   |difference|_F / sqrt(tr Phi),   (151)   |Phi^-1/2 difference|,

each divided by the square root of twice the modes' energy: fractions of the root-mean-square velocity of the appendage.
The scale of (150) makes it equal to (151) for a slender rod. "The norm" of a hinge is the root of the sum of the three
squares.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import eigh
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from flexmb.frisch.elements import inertia_of
from flexmb.frisch.equivalence.appendage import Appendage
from flexmb.frisch.parameters import ModeParameters
from flexmb.scene.quaternions import cross_matrix
from flexmb.typing import Real

_ROUND_OFF = 1e-12  # moments of inertia below this fraction of their scale are taken for rounding errors of zero


@dataclass(frozen=True)
class SpringHinge:
    """Where the rigid model turns: point (3,) m from the clamp, axes (k,3) unit vectors at rest, body axes, and the
    stiffness (k,) N m/rad of their springs."""

    point: Real
    axes: Real
    stiffness: Real


@dataclass(frozen=True)
class Relation:
    """One equivalence relation with numbers: `equation` of the paper, the quantity it compares, both sides, their
    mismatch.

    `rigid` and `flexible` are (3,) or (3,3), in SI units; `mismatch` is the difference in the norm of this module.
    """

    equation: int
    quantity: str
    rigid: Real
    flexible: Real
    mismatch: float


@dataclass(frozen=True)
class HingeFit:
    """A spring-hinged rigid model of an appendage.

    `hinge`; `modes` (k), those that its axes replace, counted from 0; `rates` (k,k), row i: hinge rates thetadot that
    fit unit rate of mode `modes[i]` best; `relations`, (149)-(151) for each of those modes; `mismatch`, their norm
    (root mean square over several modes); `frequencies` (k,) rad/s of the hinge with the base fixed;
    `effective_inertia` (6,6), order [angular about the clamp; linear], that the hinge couples to the base elastically.
    """

    hinge: SpringHinge
    modes: tuple[int, ...]
    rates: Real
    relations: tuple[tuple[Relation, ...], ...]
    mismatch: float
    frequencies: Real
    effective_inertia: Real


def rate_relations(
    body: Appendage, hinge: SpringHinge, rates: ArrayLike, hinge_rates: ArrayLike | None = None
) -> tuple[Relation, Relation, Relation]:
    """(149)-(151) for modal rates (n,) and hinge rates (k,) rad/s, by default those with the smallest norm."""
    p, r = body.parameters, np.asarray(rates, dtype=float)
    turn = best_rates(body, hinge.point, hinge.axes, r) if hinge_rates is None else np.asarray(hinge_rates, dtype=float)
    omega = turn @ hinge.axes
    rigid = np.cross(omega, p.alpha - hinge.point), _inertia_rate(p, omega), p.Phi @ omega
    flexible = r @ p.A, np.einsum("n,nab->ab", r, p.E), r @ p.Q
    velocity, inertia, momentum = _relative(p, _weighted(p, *(a - b for a, b in zip(rigid, flexible, strict=True))), r)
    return (
        Relation(149, "mass-centre velocity", rigid[0], flexible[0], velocity),
        Relation(150, "inertia rate", rigid[1], flexible[1], inertia),
        Relation(151, "angular momentum", rigid[2], flexible[2], momentum),
    )


def acceleration_relations(
    body: Appendage, hinge: SpringHinge, accelerations: ArrayLike, hinge_accelerations: ArrayLike | None = None
) -> tuple[Relation, ...]:
    """(160) and (159) for modal accelerations (n,) and hinge accelerations (k,) rad/s^2, by default the best ones."""
    velocity, _, momentum = rate_relations(body, hinge, accelerations, hinge_accelerations)
    return (
        replace(velocity, equation=160, quantity="mass-centre acceleration"),
        replace(momentum, equation=159, quantity="rate of angular momentum"),
    )


def displacement_relations(
    body: Appendage, hinge: SpringHinge, coordinates: ArrayLike, angles: ArrayLike | None = None
) -> tuple[Relation, ...]:
    """(47) and (49): mass centre and inertia of the displaced appendage, for modal coordinates (n,) and hinge angles
    (k,) rad, by default those that fit best at small angles.

    The rigid side has the finite rotation, the flexible side is of first order in the coordinates. The mismatch thus
    grows with the square of the displacement even where (149)-(151) agree.
    """
    p, a = body.parameters, np.asarray(coordinates, dtype=float)
    theta = best_rates(body, hinge.point, hinge.axes, a) if angles is None else np.asarray(angles, dtype=float)
    R = Rotation.from_rotvec(theta @ hinge.axes).as_matrix()
    centre, inertia = hinge.point + R @ (p.alpha - hinge.point), R @ p.Phi @ R.T
    moved, turned = p.alpha + a @ p.A, p.Phi + np.einsum("n,nab->ab", a, p.E)
    left = _weighted(p, centre - moved, inertia - turned, np.zeros(3))
    apart, twisted, _ = _relative(p, left, a)
    return Relation(47, "mass centre", centre, moved, apart), Relation(49, "inertia tensor", inertia, turned, twisted)


def best_rates(body: Appendage, point: Real, axes: Real, rates: ArrayLike) -> Real:
    """Hinge rates (k,) that minimise the norm of (149)-(151) for modal rates (n,)."""
    p = body.parameters
    return _least_squares(_hinge_columns(p, point, axes), _modal_side(p, np.asarray(rates, dtype=float)))


def turning_axis(body: Appendage, mode: int) -> Real:
    """Unit vector (3,) about which a mode turns the appendage: the omega that fits (150), (151) best.

    If all mass is in one point, (150) and (151) are empty, and omega about the clamp is fitted to (149). Raises
    ValueError for a mode that does not turn the appendage, such as an axial one.
    """
    p = body.parameters
    rates = np.eye(body.mode_count)[mode]
    if _compact(p):
        omega = np.cross(p.alpha, p.A[mode]) / (p.alpha @ p.alpha)
        turning = np.linalg.norm(np.cross(omega, p.alpha)) * np.sqrt(p.mass)
    else:
        omega = _least_squares(_hinge_columns(p, p.alpha, np.eye(3)), _modal_side(p, rates))
        turning = np.sqrt(omega @ p.Phi @ omega)
    if turning <= 1e-6 * np.sqrt(_scale(p, rates)):
        raise ValueError(
            f"{body.name}: mode {mode + 1} moves the appendage without turning it, so that no hinge can replace it; "
            "choose another mode"
        )
    largest = omega[np.argmax(np.abs(omega))]
    axis = np.where(np.abs(omega) > 1e-9 * abs(largest), omega / largest, 0.0)
    return axis / np.linalg.norm(axis)


def best_hinge(body: Appendage, axes: ArrayLike | None = None, modes: tuple[int, ...] | None = None) -> HingeFit:
    """The spring hinge that approximates the appendage best: its point minimises the norm of (149)-(151).

    `axes` (k,3): default one, about which the first of `modes` turns the appendage. `modes`, one for each axis, counted
    from 0; default: the mode that rotation about the axis explains best, and without `axes` the lowest. The springs
    give each axis the frequency of its mode with the base fixed. Along a single axis the position of the point is
    arbitrary; the one nearest to the clamp is taken. Raises ValueError for linearly dependent axes and for modes that
    do not turn the appendage.
    """
    axes, modes = _choice(body, axes, modes)
    starts = [_nearest_point(body, axis, mode) for axis, mode in zip(axes, modes, strict=True)]
    if len(axes) == 1:
        return fit_at(body, starts[0], axes, modes)

    def left(point: Real) -> Real:
        return np.concatenate([_left(body, point, axes, mode) for mode in modes])

    point = least_squares(left, np.mean(starts, axis=0), xtol=1e-15, ftol=1e-15, gtol=1e-15).x
    return fit_at(body, point, axes, modes)


def fit_at(
    body: Appendage, point: ArrayLike, axes: ArrayLike | None = None, modes: tuple[int, ...] | None = None
) -> HingeFit:
    """The spring hinge at a given point (3,), m from the clamp; axes, modes and springs as in `best_hinge`."""
    axes, modes = _choice(body, axes, modes)
    p, at = body.parameters, np.asarray(point, dtype=float)
    unit = np.eye(body.mode_count)
    arm = p.alpha - at
    inertia = axes @ (p.Phi + p.mass * inertia_of(np.outer(arm, arm))) @ axes.T
    if np.any(np.diag(inertia) <= 0.0):
        raise ValueError(f"{body.name}: no inertia about a hinge through the mass centre along the appendage")
    hinge = SpringHinge(at, axes, body.frequencies[list(modes)] ** 2 * np.diag(inertia))
    relations = tuple(rate_relations(body, hinge, unit[mode]) for mode in modes)
    squares = [relation.mismatch**2 for group in relations for relation in group]
    momenta = np.hstack([axes @ (p.Phi + _carried(p, arm)).T, p.mass * np.cross(axes, arm)])
    return HingeFit(
        hinge=hinge,
        modes=modes,
        rates=np.array([best_rates(body, at, axes, unit[mode]) for mode in modes]),
        relations=relations,
        mismatch=float(np.sqrt(np.sum(squares) / len(modes))),
        frequencies=np.sqrt(eigh(np.diag(hinge.stiffness), inertia, eigvals_only=True)),
        effective_inertia=momenta.T @ np.linalg.solve(inertia, momenta),
    )


def modal_effective_inertia(body: Appendage, modes: ArrayLike) -> Real:
    """(6,6), order [angular about the clamp; linear]: what these modes can move away from the base, the sum of
    s_n s_n' / m over their momenta s_n."""
    s = body.momenta[np.asarray(modes, dtype=int)]
    return s.T @ s / body.parameters.mass


def weighted_difference(p: ModeParameters, motion: Real, rates: Real) -> Real:
    """Differences (3,) between the sides of (149), (150), (151) in the units of the norm, square root of energy.

    `motion` (6,) is a rigid motion [omega; velocity of the clamp], `rates` (n,) are modal rates.
    """
    omega, velocity = motion[:3], motion[3:] + np.cross(motion[:3], p.alpha)
    return _parts(_weighted(p, velocity, _inertia_rate(p, omega), p.Phi @ omega) - _modal_side(p, rates))


def _carried(p: ModeParameters, arm: Real) -> Real:
    """m alpha x (omega x arm), as a matrix (3,3) of omega: angular momentum about the clamp of the mass centre."""
    return -p.mass * cross_matrix(p.alpha) @ cross_matrix(arm)


def _choice(body: Appendage, axes: ArrayLike | None, modes: tuple[int, ...] | None) -> tuple[Real, tuple[int, ...]]:
    """Unit axes (k,3) and a mode for each."""
    if modes is not None and any(not 0 <= mode < body.mode_count for mode in modes):
        raise ValueError(f"{body.name}: it has modes 1 to {body.mode_count} here")
    if axes is None:
        chosen = modes or (0,)
        return np.array([turning_axis(body, mode) for mode in chosen]), chosen
    given = np.atleast_2d(np.asarray(axes, dtype=float))
    sizes = np.linalg.norm(given, axis=1)
    if given.shape[1] != 3 or not np.all(sizes > 0.0):
        raise ValueError(f"{body.name}: a hinge axis is a vector of three numbers that are not all zero")
    unit = given / sizes[:, None]
    if np.linalg.matrix_rank(unit, tol=1e-6) < len(unit):
        raise ValueError(f"{body.name}: the hinge axes are linearly dependent; leave one of them out")
    if modes is None:
        axes_chosen: list[int] = []
        for axis in unit:
            gain = [-np.inf if n in axes_chosen else _explained(body, axis, n) for n in range(body.mode_count)]
            axes_chosen.append(int(np.argmax(gain)))
        modes = tuple(axes_chosen)
    if len(modes) != len(unit):
        raise ValueError(f"{body.name}: {len(unit)} hinge axes need as many modes, got {len(modes)}")
    return unit, modes


def _explained(body: Appendage, axis: Real, mode: int) -> float:
    """Fraction of the squared norm of a mode's (149)-(151) that a hinge about `axis` at the best point removes."""
    whole = _modal_side(body.parameters, np.eye(body.mode_count)[mode])
    try:
        left = _left(body, _nearest_point(body, axis, mode), axis[None], mode)
    except ValueError:
        return 0.0
    return float(whole @ whole / body.parameters.mass - left @ left)


def _nearest_point(body: Appendage, axis: Real, mode: int) -> Real:
    """The point nearest to the clamp at which a hinge about one axis minimises the norm.

    (150) and (151) do not depend on the point and determine the rate thetadot. The point then satisfies the components
    of (149) normal to the axis: thetadot q x (alpha - point) = A_n. If all mass is in one point, any point will do; the
    clamp is taken.
    """
    p = body.parameters
    if _compact(p):
        return np.zeros(3)
    unit = np.eye(body.mode_count)[mode]
    rate = float(best_rates(body, p.alpha, axis[None], unit)[0])
    if abs(rate) * np.sqrt(axis @ p.Phi @ axis) <= 1e-6 * np.sqrt(_scale(p, unit)):
        raise ValueError(f"{body.name}: mode {mode + 1} does not turn the appendage about that axis; choose another")
    point = p.alpha - np.cross(p.A[mode], axis) / rate
    return point - (point @ axis) * axis


def _left(body: Appendage, point: Real, axes: Real, mode: int) -> Real:
    """The remainder of (149)-(151) for unit rate of a mode, weighted by the norm."""
    p, unit = body.parameters, np.eye(body.mode_count)[mode]
    columns, flexible = _hinge_columns(p, point, axes), _modal_side(p, unit)
    return (columns @ best_rates(body, point, axes, unit) - flexible) / np.sqrt(_scale(p, unit))


def _inertia_rate(p: ModeParameters, omega: Real) -> Real:
    """omega x Phi - Phi x omega."""
    turn = cross_matrix(omega)
    return turn @ p.Phi - p.Phi @ turn


def _hinge_columns(p: ModeParameters, point: Real, axes: Real) -> Real:
    """Left-hand sides of (149)-(151) at unit hinge rates, weighted (15,k)."""
    arm = p.alpha - point
    return np.column_stack([_weighted(p, np.cross(q, arm), _inertia_rate(p, q), p.Phi @ q) for q in axes])


def _modal_side(p: ModeParameters, rates: Real) -> Real:
    """Right-hand sides of (149)-(151), weighted (15,)."""
    return _weighted(p, rates @ p.A, np.einsum("n,nab->ab", rates, p.E), rates @ p.Q)


def _weighted(p: ModeParameters, velocity: Real, inertia_rate: Real, momentum: Real) -> Real:
    """Velocity, inertia rate and angular momentum in the units of the norm, square root of energy, (15,)."""
    moments, principal = np.linalg.eigh(p.Phi)
    size = float(moments.sum())
    if _compact(p):
        return np.concatenate([np.sqrt(p.mass) * velocity, np.zeros(12)])
    solid = moments > _ROUND_OFF * size  # about an axis without inertia there is no angular momentum
    own = np.where(solid, principal.T @ momentum / np.sqrt(np.where(solid, moments, 1.0)), 0.0)
    return np.concatenate([np.sqrt(p.mass) * velocity, inertia_rate.ravel() / np.sqrt(size), own])


def _scale(p: ModeParameters, rates: Real) -> float:
    """Twice the kinetic energy of modal rates with the base at rest."""
    return float(rates @ p.M1 @ rates)


def _parts(weighted: Real) -> Real:
    """Lengths (3,) of the velocity, the inertia rate and the angular momentum in a weighted column (15,)."""
    return np.array([np.linalg.norm(part) for part in np.split(weighted, (3, 12))])


def _relative(p: ModeParameters, weighted: Real, rates: Real) -> tuple[float, float, float]:
    """The parts over the size of the modes' motion; zero where there is none."""
    size = np.sqrt(_scale(p, rates))
    velocity, inertia, momentum = _parts(weighted) / size if size > 0.0 else np.zeros(3)
    return float(velocity), float(inertia), float(momentum)


def _compact(p: ModeParameters) -> bool:
    """Whether all mass is in one point away from the clamp: without inertia of its own (150) and (151) are empty."""
    return float(np.trace(p.Phi)) <= _ROUND_OFF * p.mass * float(p.alpha @ p.alpha)


def _least_squares(columns: Real, side: Real) -> Real:
    """The shortest x that makes |columns x - side| smallest."""
    return np.asarray(np.linalg.lstsq(columns, side, rcond=None)[0], dtype=np.float64)
