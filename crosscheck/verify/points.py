"""Moments about another point than the declared one, as a cause why an angular momentum or a torque differs.

With a force or linear momentum f, the moment about a point P is that about O less r x f, where r = P - O:

    reference - values = r x f.

Where r is not known but constant (in World axes, or in those of a body) it follows from this by least squares: three
numbers from three for each sample, so that what is no moment about another point does not agree afterwards either.
A constant difference and a constant force that are perpendicular by symmetry say too little, and nothing is found.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.interpolate import make_interp_spline

from crosscheck.verify.evidence import VISIBLE, Evidence, turned
from flexmb.run.channels import norms
from flexmb.typing import Real

FEWEST = 8  # samples from which a point is found


def about_other_points(seen: Evidence) -> Iterator[str]:
    """Causes that make the moment agree; none for channels that are no moments."""
    if len(seen.times) < FEWEST:
        return
    if seen.channel == "momentum.angular":
        yield from _momenta(seen)
    elif seen.channel.endswith(".torque"):
        yield from _torques(seen)


def _momenta(seen: Evidence) -> Iterator[str]:
    p = seen.channels.get("momentum.linear")
    if p is None or not _says_enough(seen, p):
        return
    at_rest, declared = "it is the angular momentum about", "not about World's origin"
    axes = np.broadcast_to(np.eye(3), (len(p), 3, 3))
    point = _fitted(seen, p, axes)
    if point is not None:
        yield f"{at_rest} the point ({_numbers(point, seen)}) m, {declared}"
    for marker, position in seen.markers("position").items():
        if _moves(position) and seen.agrees(seen.values + np.cross(position, p)):
            yield f'{at_rest} the marker "{marker}", {declared}'
    travelled = make_interp_spline(seen.times, p, k=5).antiderivative()(seen.times)
    columns = np.concatenate([_crossed(axes, p), np.cross(travelled, p)[:, :, None]], axis=2)
    found = _least_squares(columns, seen.reference - seen.values)
    moved = np.linalg.norm(np.cross(travelled, p)) > 0.0
    is_mass = found[3] > 0.0 or not moved or point is not None
    if is_mass and seen.agrees(seen.values + columns @ found):
        yield f"{at_rest} the mass centre, {declared}"


def _torques(seen: Evidence) -> Iterator[str]:
    force = seen.channels.get(f"{seen.channel.removesuffix('.torque')}.force")
    if force is None or not _says_enough(seen, force):
        return
    told = "it is the torque about"
    point = _fitted(seen, force, np.broadcast_to(np.eye(3), (len(force), 3, 3)))
    if point is not None:
        yield f"{told} a point that is ({_numbers(point, seen)}) m from the hinge point in World axes"
    for marker, quaternions in seen.markers("orientation").items():
        axes = np.stack([turned(quaternions, np.tile(unit, (len(force), 1))) for unit in np.eye(3)], axis=2)
        point = _fitted(seen, force, axes) if _moves(quaternions) else None
        if point is not None:
            place = f'({_numbers(point, seen)}) m from the hinge point in the axes of "{marker}"'
            yield f"{told} a point of the body that is {place}: its mass centre instead of the hinge point?"
    for marker, position in seen.markers("position").items():
        if _moves(position) and seen.agrees(seen.values - np.cross(position, force)):
            yield f'{told} World\'s origin, not about the hinge point at "{marker}"'


def _says_enough(seen: Evidence, force: Real) -> bool:
    """Whether a wrong moment would hardly be one about another point by chance."""
    apart = seen.reference - seen.values
    along = np.abs(np.sum(seen.reference * force, axis=1)) / np.maximum(norms(force), np.finfo(float).tiny)
    return bool(max(np.max(np.ptp(apart, axis=0)), np.max(along)) > VISIBLE * seen.allowed)


def _fitted(seen: Evidence, force: Real, axes: Real) -> Real | None:
    """The constant r (3,) in such `axes` (T,3,3), whose columns are their directions, if it makes the moment agree."""
    columns = _crossed(axes, force)
    found = _least_squares(columns, seen.reference - seen.values)
    return found if seen.agrees(seen.values + columns @ found) else None


def _crossed(axes: Real, force: Real) -> Real:
    """What each unit of r in such axes adds to a moment: (T,3,3), one column for each direction."""
    return np.stack([np.cross(axes[:, :, i], force) for i in range(3)], axis=2)


def _least_squares(columns: Real, wanted: Real) -> Real:
    found = np.linalg.lstsq(columns.reshape(-1, columns.shape[2]), wanted.ravel(), rcond=1e-12)[0]
    return np.asarray(found, float)


def _moves(rows: Real) -> bool:
    return bool(np.max(np.ptp(rows, axis=0)) > 0.0)


def _numbers(point: Real, seen: Evidence) -> str:
    """The coordinates, without the digits that are rounding."""
    return ", ".join(f"{np.round(x, 9) + 0.0:.6g}" for x in point)
