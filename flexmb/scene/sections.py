"""Sections of beams as matrices: stiffness and inertia about the beam's axis, whatever point they are stated at.

The order of strains is [extension, shear along y, shear along z, twist, curvature about y, curvature about z], that of
the forces [N, Qy, Qz, Mx, My, Mz], both of what lies beyond the section on the part before it. A point at rho = (0, y,
z) of a section has the displacement u + theta x rho and, the section being rigid, the strains gamma + kappa x rho with
the same kappa. Both are the transport

    T = [1, -rho~; 0, 1],    strains at the point = T (strains on the axis),

so that a stiffness or an inertia K that is stated at the point is T' K T on the axis. This is exact.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from msgspec.structs import replace

from flexmb.scene.bodies import BeamBody, BeamStation, Matrix6
from flexmb.scene.quaternions import cross_matrix
from flexmb.scene.rounding import ROUNDING
from flexmb.typing import Real

EXTENSION, TWIST, ABOUT_Y, ABOUT_Z = 0, 3, 4, 5
SHEAR = [1, 2]
WITHOUT_SHEAR = [EXTENSION, TWIST, ABOUT_Y, ABOUT_Z]
STRAINS = ("extension", "shear along y", "shear along z", "twist", "curvature about y", "curvature about z")
STIFFNESS_KEYS = ("EA_N", "EIy_Nm2", "EIz_Nm2", "GJ_Nm2")
SHEAR_KEYS = ("GAy_N", "GAz_N")
INERTIA_KEYS = ("mass_per_length_kg_m", "rotary_y_kg_m", "rotary_z_kg_m")


def transport(point: Sequence[float] | Real) -> Real:
    """T (6,6), which maps motion or strains of the axis to those of the point (y, z) m of the section."""
    y, z = point
    T = np.eye(6)
    T[0, 4], T[0, 5], T[1, 3], T[2, 3] = z, -y, -z, y
    return T


def is_plain(station: BeamStation) -> bool:
    """Whether a station is given by numbers on the axis, so that nothing couples extension, bending and torsion."""
    return station.stiffness is None and station.inertia is None and not any(station.reference_point_m)


def stiffness_on_axis(station: BeamStation) -> Real:
    """Stiffness (6,6) about the axis, N, N m, N m². Of a matrix only the symmetric part counts.

    Where the scene has no shear stiffness EA stands in its place: without shear nothing depends on it. ValueError for
    a station without stiffness.
    """
    if station.stiffness is None:
        EA, EIy, EIz, GJ = (_given(station, key) for key in STIFFNESS_KEYS)
        GAy, GAz = (EA if value is None else value for value in (station.GAy_N, station.GAz_N))
        stated = np.diag([EA, GAy, GAz, GJ, EIy, EIz])
    else:
        stated = symmetric(station.stiffness)
    return _on_axis(stated, station.reference_point_m)


def inertia_on_axis(station: BeamStation) -> Real:
    """Inertia per length (6,6) about the axis, kg/m, kg, kg m; ValueError for a station without mass.

    The mass of a matrix is its element [0][0], the first moment is in its first row and column, and of J the symmetric
    part counts: the other elements repeat these.
    """
    if station.inertia is None:
        m, y, z = _given(station, "mass_per_length_kg_m"), station.rotary_y_kg_m, station.rotary_z_kg_m
        stated = np.diag([m, m, m, y + z, y, z])
    else:
        given = symmetric(station.inertia)
        m, moment = given[0, 0], np.array([[0.0, -given[0, 5], given[0, 4]]])
        stated = np.zeros((6, 6))
        stated[:3, :3] = m * np.eye(3)
        stated[3:, :3] = cross_matrix(moment)[0]
        stated[:3, 3:] = stated[3:, :3].T
        stated[3:, 3:] = given[3:, 3:]
    return _on_axis(stated, station.reference_point_m)


def between_stations(body: BeamBody, of: Callable[[BeamStation], Real], x: Real) -> Real:
    """Matrices (n,6,6) at x (n,) m, linear between those `of` the stations, which ascend; constant beyond them."""
    at = [station.x_m for station in body.stations]
    values = np.array([of(station) for station in body.stations]).reshape(len(at), -1)
    found = np.tile(values[0], (len(x), 1))
    for k in np.flatnonzero(np.ptp(values, axis=0)):
        found[:, k] = np.interp(x, at, values[:, k])
    return found.reshape(-1, 6, 6)


def mass_per_length(station: BeamStation) -> float:
    """kg/m; ValueError for a station without mass."""
    return _given(station, "mass_per_length_kg_m") if station.inertia is None else float(station.inertia[0][0])


def mass_centres(inertia: Real) -> tuple[Real, Real, Real]:
    """Masses (n,), mass centres (n,3; without mass zero) and inertias (n,3,3) about these of inertias (n,6,6)."""
    m = inertia[:, 0, 0]
    com = np.zeros((len(m), 3))
    np.divide(-inertia[:, 0, 5], m, out=com[:, 1], where=m != 0.0)
    np.divide(inertia[:, 0, 4], m, out=com[:, 2], where=m != 0.0)
    about_axis, of_mass = inertia[:, 3:, 3:], -m[:, None, None] * cross_matrix(com) @ cross_matrix(com)
    return m, com, _above_rounding(about_axis - of_mass, np.abs(about_axis) + np.abs(of_mass))


def inertia_matrices(mass: Real, com: Real, inertia: Real) -> Real:
    """Inertias (n,6,6) of masses (n,), mass centres (n,3) and inertias (n,3,3) about these."""
    c = mass[:, None, None] * cross_matrix(com)
    return np.block([[mass[:, None, None] * np.eye(3), -c], [c, inertia - c @ cross_matrix(com)]])


def restated(station: BeamStation, point: tuple[float, float]) -> BeamStation:
    """The same section, as matrices that are stated at the point (y, z) m."""
    back = transport((-point[0], -point[1]))
    K, M = (back.T @ matrix @ back for matrix in (stiffness_on_axis(station), inertia_on_axis(station)))
    by_numbers = dict.fromkeys((*STIFFNESS_KEYS, *SHEAR_KEYS, INERTIA_KEYS[0])) | dict.fromkeys(INERTIA_KEYS[1:], 0.0)
    return replace(
        station, **by_numbers, stiffness=matrix(K), inertia=matrix(M), reference_point_m=point,
    )  # fmt: skip


def matrix(values: Real) -> Matrix6:
    """The symmetric part of an array (6,6) as a scene has it."""
    return tuple(tuple(row) for row in symmetric(values).tolist())  # type: ignore[return-value]


def symmetric(values: Sequence[Sequence[float]] | Real) -> Real:
    """The symmetric part (6,6)."""
    matrix: Real = np.array(values, dtype=float)
    return 0.5 * (matrix + matrix.T)


def without_shear(K: Real) -> Real:
    """Stiffness (4,4) of [extension, twist, curvatures] with no shear force: the inverse of that part of K^-1."""
    rest = K[np.ix_(WITHOUT_SHEAR, WITHOUT_SHEAR)]
    stiffness: Real = rest + K[np.ix_(WITHOUT_SHEAR, SHEAR)] @ free_shear(K)
    return 0.5 * (stiffness + stiffness.T)


def free_shear(K: Real) -> Real:
    """Shears (2,4) without shear force for unit [extension, twist, curvatures]; those of the last three in m."""
    return np.asarray(-np.linalg.solve(K[np.ix_(SHEAR, SHEAR)], K[np.ix_(SHEAR, WITHOUT_SHEAR)]), dtype=float)


def has_plain_sections(body: BeamBody) -> bool:
    """Whether all stations of a beam are given by numbers on its axis."""
    return all(map(is_plain, body.stations))


def twists_with_inertia(body: BeamBody) -> bool:
    """Whether the sections of a beam have inertia about its axis, which those without mass or inertia have not."""
    return any(
        _about_axis(station, body) > 0.0
        for station in body.stations
        if station.inertia is not None or station.mass_per_length_kg_m is not None
    )


def _about_axis(station: BeamStation, body: BeamBody) -> float:
    """Inertia per length (kg m) about the axis, as `body.points` has it."""
    M = inertia_on_axis(station)
    if body.points != "line":
        return float(M[TWIST, TWIST])
    first = float(np.hypot(M[0, 4], M[0, 5]))  # of the mass at its centre
    return first**2 if first > ROUNDING * float(M[0, 0]) * body.length_m else 0.0


def _on_axis(stated: Real, point: tuple[float, float]) -> Real:
    if not any(point):
        return stated
    T = transport(point)
    return _above_rounding(T.T @ stated @ T, np.abs(T.T) @ np.abs(stated) @ np.abs(T))


def _above_rounding(found: Real, terms: Real) -> Real:
    """Sums, with zeros where nothing is left of terms of these sizes but rounding: what they cancel couples nothing."""
    return np.where(np.abs(found) > ROUNDING * terms, found, 0.0)


def _given(station: BeamStation, key: str) -> float:
    value: float | None = getattr(station, key)
    if value is None:
        other = "inertia" if key in INERTIA_KEYS else "stiffness"
        raise ValueError(f"the station at x = {station.x_m:g} m has no {key}: give it, or the matrix {other}")
    return value
