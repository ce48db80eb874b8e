"""Inertia points of a beam with its modes, from its stations and lumps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexmb.modal.beam import BeamElements
from flexmb.modal.stations import Lump, Stations
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
    """One point per station; the section's inertia is a tensor that turns with the point."""
    moved = elements.motion(stations.x, columns)
    inertia = np.zeros((len(stations.x), 3, 3))
    inertia[:, 0, 0] = stations.inertia_y + stations.inertia_z
    inertia[:, 1, 1] = stations.inertia_y
    inertia[:, 2, 2] = stations.inertia_z
    offset = np.zeros((len(stations.x), 3))
    return Points(stations.x, stations.mass, on_axis(stations.x), offset, inertia, moved[:, :3], moved[:, 3:])


def section_points(elements: BeamElements, columns: Real, stations: Stations) -> Points:
    """Four point masses per station at (+-a, +-b), a^2 = inertia_z / mass, b^2 = inertia_y / mass.

    Their second moments are those of the section, so that the mass matrix is that of `axis_points`. Without turning
    tensors the kinetic energy is a polynomial in the modal coordinates. Sections without inertia keep one point.
    """
    if not (np.any(stations.inertia_y) or np.any(stations.inertia_z)):
        return axis_points(elements, columns, stations)
    a = np.sqrt(stations.inertia_z / stations.mass)
    b = np.sqrt(stations.inertia_y / stations.mass)
    corners = [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)]
    offsets = [np.column_stack([np.zeros_like(a), sy * a, sz * b]) for sy, sz in corners]
    return join([_massy(elements, columns, stations.x, offset, stations.mass / 4.0) for offset in offsets])


def turning_lump(elements: BeamElements, columns: Real, lump: Lump) -> Points:
    """A lump as one point of the axis with an offset mass centre and an inertia tensor that turns with it."""
    x = np.array([lump.x])
    moved = elements.motion(x, columns)
    mass = np.array([lump.mass])
    return Points(x, mass, on_axis(x), lump.com[None], lump.inertia[None], moved[:, :3], moved[:, 3:])


def massy_lump(elements: BeamElements, columns: Real, lump: Lump) -> Points:
    """A lump as six equal point masses on its principal axes, at +-sqrt(3 s_k / mass) from the mass centre.

    s_k are the eigenvalues of the second-moment tensor S = tr(J)/2 - J: mass, mass centre and inertia are exact. A lump
    without inertia is one point mass. Raises ValueError if S has a negative eigenvalue beyond rounding.
    """
    if not np.any(lump.inertia):
        return _massy(elements, columns, np.array([lump.x]), lump.com[None], np.array([lump.mass]))
    second_moment, axes = np.linalg.eigh(np.trace(lump.inertia) / 2.0 * np.eye(3) - lump.inertia)
    floor = -8.0 * np.finfo(float).eps * np.trace(lump.inertia)  # a flat lump has a zero eigenvalue, up to rounding
    if second_moment.min() < floor:
        raise ValueError(
            f"tip mass at x = {lump.x:g} m: impossible inertia (principal moments break the triangle inequality); "
            "check inertia_kg_m2"
        )
    # Two of the six masses are on each axis: 2 (mass / 6) (3 s_k / mass) = s_k.
    arms = (axes * np.sqrt(3.0 * np.maximum(second_moment, 0.0) / lump.mass)).T
    offset = lump.com + np.concatenate([arms, -arms])
    return _massy(elements, columns, np.full(6, lump.x), offset, np.full(6, lump.mass / 6.0))


def _massy(elements: BeamElements, columns: Real, x: Real, offset: Real, mass: Real) -> Points:
    """Point masses (n,) at `offset` (n,3) from the axis points x (n,): displacement plus rotation x offset."""
    moved = elements.motion(x, columns)
    translation = moved[:, :3] + np.cross(moved[:, 3:], offset[:, :, None], axis=1)
    nothing = np.zeros((len(x), 3))
    return Points(x, mass, on_axis(x) + offset, nothing, np.zeros((len(x), 3, 3)), translation, moved[:, 3:])


def on_axis(x: Real) -> Real:
    """Positions (n,3) of axis points."""
    return np.column_stack([x, np.zeros_like(x), np.zeros_like(x)])
