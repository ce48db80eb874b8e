"""Moments about another point than the declared one, as a cause why an angular momentum or a torque differs.

With a force or linear momentum f, the moment about a point P is that about O less r x f, where r = P - O:

    reference - values = r x f.

Where r is not known but constant (in World axes, or in those of a body) it follows from this by least squares: three
numbers from three for each sample, so that what is no moment about another point does not agree afterwards either.
A constant difference and a constant force that are perpendicular by symmetry say too little, and nothing is found.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np
from scipy.interpolate import make_interp_spline

from crosscheck.verify.evidence import VISIBLE, Evidence, turned
from flexmb.run.channels import norms
from flexmb.typing import Real

FEWEST = 8  # samples from which a point is found
NODES = 8  # between two samples, for Gauss's formula
HOPEFUL = 0.2  # part of a difference that may be left by an inaccurate integral
EPS = 1e-14  # relative change up to which a momentum is constant
MOMENTUM, LINEAR = "momentum.angular", "momentum.linear"
MOMENTUM_ABOUT, TORQUE_ABOUT = "it is the angular momentum about", "it is the torque about"


def about_other_points(seen: Evidence) -> Iterator[str]:
    """Causes that make the moment agree; none for channels that are no moments."""
    if len(seen.times) < FEWEST:
        return
    if seen.channel == MOMENTUM:
        yield from _momenta(seen)
    elif seen.channel.endswith(".torque"):
        yield from _torques(seen)


def _momenta(seen: Evidence) -> Iterator[str]:
    p = seen.channels.get(LINEAR)
    if p is None or not _says_enough(seen, p):
        return
    point = _fitted(seen, p, np.broadcast_to(np.eye(3), (len(p), 3, 3)))
    if point is not None:
        yield f"{MOMENTUM_ABOUT} another point than World's origin, such as ({_numbers(point)}) m"
    for marker, position in seen.markers("position").items():
        if _moves(position) and seen.agrees(seen.values + np.cross(position, p)):
            yield f'{MOMENTUM_ABOUT} the marker "{marker}", not about World\'s origin'


def about_mass_centre(seen: Evidence, mass: float | None, reference_at: Callable[[Real], Mapping[str, Real]]) -> str:
    """The cause that an angular momentum is that about the mass centre, if it then agrees; else "".

    The mass centre is at r + the integral of p / `mass` (kg), with a constant r that is found by least squares. The
    linear momentum p is integrated by Gauss's formula, for which `reference_at` gives it between the samples, unless
    an integral by a spline is already far from explaining the difference. Where the mass centre moves along p, no mass
    is needed.
    """
    p = seen.channels.get(LINEAR)
    if p is None or len(seen.times) < FEWEST or not _says_enough(seen, p):
        return ""
    wanted = seen.reference - seen.values
    travelled = np.asarray(make_interp_spline(seen.times, p, k=5).antiderivative()(seen.times), float)
    if np.max(np.ptp(p, axis=0)) <= EPS * np.max(np.abs(p)):
        turning = np.zeros_like(p)
    elif mass is None or not mass > 0.0:
        return ""
    else:
        rough = np.cross(travelled, p) / mass
        if np.linalg.norm(wanted - rough - _by_point(p, wanted - rough)) > HOPEFUL * np.linalg.norm(wanted):
            return ""
        integral = _integrated(seen.times, reference_at)
        if integral is None:
            return ""
        turning = np.cross(integral, p) / mass
    added = turning + _by_point(p, wanted - turning)
    return f"{MOMENTUM_ABOUT} the mass centre, not about World's origin" if seen.agrees(seen.values + added) else ""


def _by_point(p: Real, wanted: Real) -> Real:
    """What a constant r adds to a moment, by least squares."""
    columns = _crossed(np.broadcast_to(np.eye(3), (len(p), 3, 3)), p)
    return np.asarray(columns @ _least_squares(columns, wanted), float)


def _integrated(times: Real, reference_at: Callable[[Real], Mapping[str, Real]]) -> Real | None:
    """The integral (T,3) of the linear momentum from the first time to each; None if it is not known in between."""
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    half = 0.5 * np.diff(times)
    between = (times[:-1] + half)[:, None] + half[:, None] * nodes
    there = reference_at(between.ravel())
    if LINEAR not in there:
        return None
    p = there[LINEAR].reshape(len(half), NODES, 3)
    return np.concatenate([np.zeros((1, 3)), np.cumsum(half[:, None] * np.einsum("n,tnk->tk", weights, p), axis=0)])


def _torques(seen: Evidence) -> Iterator[str]:
    force = seen.channels.get(f"{seen.channel.removesuffix('.torque')}.force")
    if force is None or not _says_enough(seen, force):
        return
    point = _fitted(seen, force, np.broadcast_to(np.eye(3), (len(force), 3, 3)))
    if point is not None:
        yield f"{TORQUE_ABOUT} a point that is ({_numbers(point)}) m from the hinge point in World axes"
    for marker, quaternions in seen.markers("orientation").items():
        axes = np.stack([turned(quaternions, np.tile(unit, (len(force), 1))) for unit in np.eye(3)], axis=2)
        point = _fitted(seen, force, axes) if _moves(quaternions) else None
        if point is not None:
            place = f'({_numbers(point)}) m from the hinge point in the axes of "{marker}"'
            yield f"{TORQUE_ABOUT} a point of the body, its mass centre perhaps, {place}"
    for marker, position in seen.markers("position").items():
        if _moves(position) and seen.agrees(seen.values - np.cross(position, force)):
            yield f'{TORQUE_ABOUT} World\'s origin, not about the hinge point at "{marker}"'


def _says_enough(seen: Evidence, force: Real) -> bool:
    """Whether a wrong moment would hardly be one about another point by chance."""
    apart = seen.reference - seen.values
    along = np.abs(np.sum(seen.reference * force, axis=1)) / np.maximum(norms(force), np.finfo(float).tiny)
    return bool(max(np.max(np.ptp(apart, axis=0)), np.max(along)) > VISIBLE * seen.allowed)


def _fitted(seen: Evidence, force: Real, axes: Real) -> Real | None:
    """The constant r (3,) in such `axes` (T,3,3), whose columns are their directions, if it makes the moment agree."""
    columns = _crossed(axes, force)
    fitted = _least_squares(columns, seen.reference - seen.values)
    return fitted if seen.agrees(seen.values + columns @ fitted) else None


def _crossed(axes: Real, force: Real) -> Real:
    """What each unit of r in such axes adds to a moment: (T,3,3), one column for each direction."""
    return np.stack([np.cross(axes[:, :, i], force) for i in range(3)], axis=2)


def _least_squares(columns: Real, wanted: Real) -> Real:
    solution = np.linalg.lstsq(columns.reshape(-1, columns.shape[2]), wanted.ravel(), rcond=1e-12)[0]
    return np.asarray(solution, float)


def _moves(rows: Real) -> bool:
    return bool(np.max(np.ptp(rows, axis=0)) > 0.0)


def _numbers(point: Real) -> str:
    """The coordinates, without the digits that are rounding."""
    return ", ".join(f"{np.round(x, 9) + 0.0:.6g}" for x in point)
