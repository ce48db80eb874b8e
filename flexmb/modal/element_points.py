"""Inertia points of a beam with its modes, from its stations and lumps."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from flexmb.modal.beam import BeamElements
from flexmb.modal.stations import Lump, Stations
from flexmb.scene.rounding import PRINTED, tensor_dust
from flexmb.typing import Real


@dataclass(frozen=True)
class Points:
    """Inertia points with mode shapes. Units and frames are those of the same arrays of `FlexibleModel`.

    x (n,) m: the axis point to whose section each is fixed.
    """

    x: Real
    mass: Real
    position: Real
    com_offset: Real
    inertia: Real
    translation: Real
    rotation: Real


def join(groups: list[Points]) -> Points:
    """Several sets as one."""
    return Points(*(np.concatenate([getattr(g, name) for g in groups]) for name in Points.__dataclass_fields__))


def axis_points(elements: BeamElements, columns: Real, stations: Stations) -> Points:
    """One point per station; the section's inertia is a tensor that turns with the point, as its mass centre does."""
    moved = elements.motion(stations.x, columns)
    place = on_axis(stations.x)
    return Points(stations.x, stations.mass, place, stations.com, stations.inertia, moved[:, :3], moved[:, 3:])


def section_points(elements: BeamElements, columns: Real, stations: Stations) -> Points:
    """Four point masses per station at its mass centre +- a +- b; a and b are the columns of the square root of S/mass,
    S being the second moments of the section about its mass centre.

    With principal axes a and b are along y and z, a^2 = inertia_z / mass, b^2 = inertia_y / mass. Their second moments
    are those of the section, so that the mass matrix is that of `axis_points`. Without turning tensors the kinetic
    energy is a polynomial in the modal coordinates. Sections without inertia keep one point.
    """
    moved = elements.motion(stations.x, columns)
    if not np.any(stations.inertia):
        return _massy(moved, stations.x, stations.com, stations.mass)
    a, b = _arms(stations)
    corners = [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)]
    offsets = [stations.com + (sy * a + sz * b) for sy, sz in corners]
    return join([_massy(moved, stations.x, offset, stations.mass / 4.0) for offset in offsets])


def _arms(stations: Stations) -> tuple[Real, Real]:
    """Columns (n,3) of the symmetric square root of [Jz, -Jyz; -Jyz, Jy] / mass.

    Of a matrix A (2,2) that is (A + sqrt(det A) 1) / sqrt(trace A + 2 sqrt(det A)), which is smooth in A > 0.
    """
    yy, zz, yz = stations.about(2), stations.about(1), -stations.inertia[:, 1, 2]
    a, b = np.zeros((2, len(stations.x), 3))
    if stations.plain:
        a[:, 1], b[:, 2] = np.sqrt(yy / stations.mass), np.sqrt(zz / stations.mass)
        return a, b
    root = np.sqrt(np.maximum(yy * zz - yz**2, 0.0))  # a thin strip has none, up to rounding
    size = np.sqrt(stations.mass * np.maximum(yy + zz + 2.0 * root, 0.0))
    size[size == 0.0] = 1.0  # a section without inertia, beside others
    a[:, 1], a[:, 2], b[:, 1], b[:, 2] = ((yy + root) / size, yz / size, yz / size, (zz + root) / size)
    return a, b


def twisting(points: Points, twist: Real) -> Points:
    """Each of the points (n,) as two halves that move apart along the axis as it turns about it, so that the twist has
    the inertia `twist` (n,) kg m^2 of its own.

    No rigid motion feels it, nor do bending and stretch; the kinetic energy stays a sum of squares, and a polynomial.
    """
    if not (np.any(twist) and np.any(points.rotation[:, 0])):
        return points
    along = np.zeros_like(points.translation)
    along[:, 0] = np.sqrt(twist / points.mass)[:, None] * points.rotation[:, 0]
    half = replace(points, mass=points.mass / 2.0, inertia=points.inertia / 2.0)
    return join([replace(half, translation=points.translation + sign * along) for sign in (1.0, -1.0)])


def turning_lump(elements: BeamElements, columns: Real, lump: Lump) -> Points:
    """A lump as one point of the axis with an offset mass centre and an inertia tensor that turns with it."""
    x = np.array([lump.x])
    moved = elements.motion(x, columns)
    mass = np.array([lump.mass])
    return Points(x, mass, on_axis(x), lump.com[None], lump.inertia[None], moved[:, :3], moved[:, 3:])


def massy_lump(elements: BeamElements, columns: Real, lump: Lump) -> Points:
    """A lump as six equal point masses on its principal axes, at +-sqrt(3 s_k / mass) from the mass centre.

    s_k are the eigenvalues of the second-moment tensor S = tr(J)/2 - J: mass, mass centre and inertia are exact. A lump
    without inertia is one point mass. Raises ValueError if S has a negative eigenvalue beyond what checks allow.
    """
    moved = elements.motion(np.array([lump.x]), columns)
    largest, dust = np.max(np.abs(lump.inertia)), tensor_dust(lump.mass, float(elements.mesh.nodes[-1]))
    if largest <= dust:
        return _massy(moved, np.array([lump.x]), lump.com[None], np.array([lump.mass]))
    second_moment, axes = np.linalg.eigh(np.trace(lump.inertia) / 2.0 * np.eye(3) - lump.inertia)
    if second_moment.min() < -(PRINTED * largest + dust):  # a flat lump has a zero eigenvalue, up to rounding
        raise ValueError(
            f"tip mass at x = {lump.x:g} m: impossible inertia (principal moments break the triangle inequality); "
            "check inertia_kg_m2"
        )
    # Two of the six masses are on each axis: 2 (mass / 6) (3 s_k / mass) = s_k.
    arms = (axes * np.sqrt(3.0 * np.maximum(second_moment, 0.0) / lump.mass)).T
    offset = lump.com + np.concatenate([arms, -arms])
    return _massy(np.repeat(moved, 6, axis=0), np.full(6, lump.x), offset, np.full(6, lump.mass / 6.0))


def _massy(moved: Real, x: Real, offset: Real, mass: Real) -> Points:
    """Point masses (n,) at `offset` (n,3) from the axis points x (n,), which are `moved` (n,6,m): displacement plus
    rotation x offset."""
    translation = moved[:, :3] + np.cross(moved[:, 3:], offset[:, :, None], axis=1)
    nothing = np.zeros((len(x), 3))
    return Points(x, mass, on_axis(x) + offset, nothing, np.zeros((len(x), 3, 3)), translation, moved[:, 3:])


def on_axis(x: Real) -> Real:
    """Positions (n,3) of axis points."""
    return np.column_stack([x, np.zeros_like(x), np.zeros_like(x)])
