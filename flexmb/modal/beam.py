"""Finite-element model of a straight beam: stiffness and mass of axial motion, torsion and two bending planes.

The four families of motion are uncoupled in a beam whose axis is centroidal and whose section axes are principal. They
are coupled by sections that are given as matrices or at a point off the axis, and by rigid lumps with an offset mass
centre or a product of inertia. A point of the axis moves by [displacement; rotation], the rotation about y being -w'
and about z v' (without shear). Families that are not chosen are held fixed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexmb.modal.interpolation import BendingField, ElementMesh, LineField
from flexmb.modal.section import SectionTable, section_table
from flexmb.modal.stations import Lump, Stations, quadrature
from flexmb.scene.bodies import FAMILIES, BeamBody
from flexmb.scene.quaternions import cross_matrix
from flexmb.scene.strains import families
from flexmb.typing import Real

# Rows of [ux, uy, uz, rx, ry, rz] that a family moves: translation row, rotation row, sign of the rotation.
_BENDING_ROWS = {"bending_y": (1, 5, 1.0), "bending_z": (2, 4, -1.0)}
_LINE_ROWS = {"axial": 0, "torsion": 3}
_TURNS_ABOUT = {"torsion": 0, "bending_y": 2, "bending_z": 1}


@dataclass(frozen=True)
class BeamElements:
    """Fields of the chosen families over one mesh; the coordinates of the families are stacked.

    `fields` maps family to its field, in the canonical order of `FAMILIES`.
    """

    mesh: ElementMesh
    table: SectionTable
    fields: dict[str, LineField | BendingField]

    @property
    def size(self) -> int:
        return sum(field.size for field in self.fields.values())

    def coordinates(self, family: str) -> slice:
        """The range of the coordinates of one family; KeyError for a family that is not chosen."""
        start = 0
        for name, field in self.fields.items():
            if name == family:
                return slice(start, start + field.size)
            start += field.size
        raise KeyError(family)

    def clamped_coordinates(self) -> list[int]:
        """Coordinates that a clamp at x = 0 fixes."""
        return [
            self.coordinates(name).start + k for name, field in self.fields.items() for k in field.clamped_coordinates
        ]

    def rigid(self) -> Real:
        """Rigid motions (size, r) in the chosen families: one of axial motion and of torsion, two per bending plane."""
        columns = []
        for name, field in self.fields.items():
            motion = np.zeros((self.size, field.rigid().shape[1]))
            motion[self.coordinates(name)] = field.rigid()
            columns.append(motion)
        return np.hstack(columns)

    def motion(self, x: Real, coefficients: Real) -> Real:
        """[displacement; rotation] (n, 6, m) of the axis points x (n,) for coordinate columns (size, m)."""
        x = np.asarray(x, dtype=float)
        moved = np.zeros((len(x), 6, coefficients.shape[1]))
        for name, field in self.fields.items():
            part = coefficients[self.coordinates(name)]
            if isinstance(field, LineField):
                moved[:, _LINE_ROWS[name]] = field.at(x).value @ part
            else:
                translation, rotation, sign = _BENDING_ROWS[name]
                rows = field.at(x)
                moved[:, translation] = rows.deflection @ part
                moved[:, rotation] = sign * (rows.rotation @ part)
        return moved

    def strain(self, x: Real, coefficients: Real) -> tuple[Real, Real]:
        """At x (n,) for coordinate columns (size, m): [stretch; shears] (n,3,m), [twist; curvatures] (n,3,m) 1/m."""
        stretch, turn = np.zeros((2, len(x), 3, coefficients.shape[1]))
        for name, field in self.fields.items():
            part = coefficients[self.coordinates(name)]
            if isinstance(field, LineField):
                (stretch if name == "axial" else turn)[:, 0] = field.at(x).slope @ part
            else:
                translation, rotation, sign = _BENDING_ROWS[name]
                rows = field.at(x)
                stretch[:, translation] = rows.shear @ part
                turn[:, rotation - 3] = sign * (rows.curvature @ part)
        return stretch, turn

    def stiffness(self) -> Real:
        """Stiffness matrix (size, size) of the energy 1/2 int strain' C strain dx; for sections that couple nothing
        1/2 int EA e^2 + GJ twist^2 + EI curvature^2 + GA shear^2 dx."""
        x, weight = quadrature(self.mesh, self.table)
        if not self.table.plain:
            strain = np.concatenate(self.strain(x, np.eye(self.size)), axis=1)
            return _congruent(strain, weight[:, None, None] * self.table.strain_stiffness(x))
        K = np.zeros((self.size, self.size))
        for name, field in self.fields.items():
            own = self.coordinates(name)
            if isinstance(field, LineField):
                rigidity = self.table.EA if name == "axial" else self.table.GJ
                K[own, own] = _weighted(field.at(x).slope, weight * self.table.at(rigidity, x))
            else:
                EI, GA = _plane_stiffness(self.table, name)
                rows = field.at(x)
                K[own, own] = _weighted(rows.curvature, weight * self.table.at(EI, x))
                if self.table.sheared:
                    K[own, own] += _weighted(rows.shear, weight * self.table.at(GA, x))
        return K

    def mass(self, stations: Stations, lumps: tuple[Lump, ...]) -> Real:
        """Mass matrix (size, size) of the stations and the lumps."""
        M = np.zeros((self.size, self.size))
        if not stations.plain:
            M = _congruent(self.motion(stations.x, np.eye(self.size)), stations.matrices())
        else:
            turning = {name: stations.about(axis) for name, axis in _TURNS_ABOUT.items()}
            turning["torsion"] = turning["torsion"] + stations.twist
            for name, field in self.fields.items():
                own = self.coordinates(name)
                if isinstance(field, LineField):
                    M[own, own] = _weighted(field.at(stations.x).value, turning.get(name, stations.mass))
                else:
                    rows = field.at(stations.x)
                    M[own, own] = _weighted(rows.deflection, stations.mass) + _weighted(rows.rotation, turning[name])
        for lump in lumps:
            U = self.motion(np.array([lump.x]), np.eye(self.size))[0]
            M += U.T @ lump_mass(lump) @ U
        return M


def beam_elements(body: BeamBody) -> BeamElements:
    """Mesh and fields of `body` for its families. Raises ValueError for bad mesh data."""
    if body.elements < 1 or body.length_m <= 0.0:
        raise ValueError(f"beam '{body.name}': needs elements >= 1 and length_m > 0")
    if not families(body):
        raise ValueError(f"beam '{body.name}': modes.families is empty; name at least one of {', '.join(FAMILIES)}")
    table = section_table(body)
    mesh = ElementMesh(np.linspace(0.0, body.length_m, body.elements + 1))
    bending = BendingField(mesh, shear=body.theory == "timoshenko")
    chosen = [name for name in FAMILIES if name in families(body)]
    return BeamElements(mesh, table, {name: LineField(mesh) if name in _LINE_ROWS else bending for name in chosen})


def lump_mass(lump: Lump) -> Real:
    """Mass matrix (6,6) of a lump for [displacement; rotation] of its axis point."""
    c = cross_matrix(lump.com)
    return np.block([[lump.mass * np.eye(3), -lump.mass * c], [lump.mass * c, lump.inertia - lump.mass * c @ c]])


def _plane_stiffness(table: SectionTable, family: str) -> tuple[Real, Real]:
    """EI and GA (n,) of a bending plane."""
    return (table.EIz, table.GAy) if family == "bending_y" else (table.EIy, table.GAz)


def _weighted(rows: Real, weight: Real) -> Real:
    """rows' diag(weight) rows."""
    return rows.T @ (weight[:, None] * rows)


def _congruent(rows: Real, matrices: Real) -> Real:
    """sum rows_n' matrices_n rows_n of rows (n, 6, size) and symmetric matrices (n, 6, 6)."""
    size = rows.shape[2]
    matrix: Real = rows.reshape(-1, size).T @ (matrices @ rows).reshape(-1, size)
    return 0.5 * (matrix + matrix.T)
