"""Inertia tensors and beam sections from dimensions and material data."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, Unpack

import numpy as np
from numpy.typing import ArrayLike

from flexmb.scene.bodies import BeamStation, Matrix3
from flexmb.scene.collecting import SectionShape, refuse_others
from flexmb.scene.sections import matrix


def inertia_moments(xx: float, yy: float, zz: float, xy: float = 0.0, xz: float = 0.0, yz: float = 0.0) -> Matrix3:
    """Inertia tensor (kg m²) from its six elements; `xy` is the element -∫ x y dm, not the product of inertia."""
    return ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))


def cuboid_inertia(mass: float, size: tuple[float, float, float]) -> Matrix3:
    """Inertia tensor (kg m²) of a homogeneous cuboid of `mass` (kg) and edges `size` (m) along x, y, z."""
    x, y, z = (edge * edge for edge in size)
    return inertia_moments(mass * (y + z) / 12.0, mass * (x + z) / 12.0, mass * (x + y) / 12.0)


def cylinder_inertia(mass: float, radius: float, length: float, axis: Literal["x", "y", "z"] = "z") -> Matrix3:
    """Inertia tensor (kg m²) of a homogeneous solid cylinder of `mass` (kg), `radius` and `length` (m) along `axis`."""
    transverse = mass * (3.0 * radius * radius + length * length) / 12.0
    moments = dict.fromkeys("xyz", transverse) | {axis: mass * radius * radius / 2.0}
    return inertia_moments(moments["x"], moments["y"], moments["z"])


def beam_section(
    *, E: float, G: float, A: float, Iy: float, Iz: float, rho: float, **shape: Unpack[SectionShape]
) -> BeamStation:
    """Section of a homogeneous beam at station `x` (m), by default 0.

    E, G: elastic moduli (Pa); A: area (m²); Iy, Iz: second moments of area about the section's y and z (m⁴), so that
    `Iz` resists bending in the x-y plane; rho: density (kg/m³). J: torsion constant (m⁴), by default Iy + Iz, which is
    exact for a circle only. `shear_factor` k gives the Timoshenko stiffness k G A; by default 5/6, that of a rectangle.
    TypeError for any other name.
    """
    refuse_others("a beam section", shape, SectionShape)
    J, k = shape.get("J"), shape.get("shear_factor", 5.0 / 6.0)
    return BeamStation(
        x_m=shape.get("x", 0.0),
        EA_N=E * A,
        EIy_Nm2=E * Iy,
        EIz_Nm2=E * Iz,
        GJ_Nm2=G * (Iy + Iz if J is None else J),
        mass_per_length_kg_m=rho * A,
        rotary_y_kg_m=rho * Iy,
        rotary_z_kg_m=rho * Iz,
        GAy_N=k * G * A,
        GAz_N=k * G * A,
    )


def coupled_section(
    *, stiffness: ArrayLike, inertia: ArrayLike, x: float = 0.0, reference_point: tuple[float, float] = (0.0, 0.0),
    order: Sequence[int] = range(6),
) -> BeamStation:  # fmt: skip
    """Section of a beam at station `x` (m) by matrices (6,6) of stiffness and of inertia per length (see BeamStation).

    Both are stated at `reference_point` (y, z) (m). `order`: which rows and columns of the given matrices are those of
    [x, y, z, about x, about y, about z] with x along the beam: [2, 0, 1, 5, 3, 4] where its axis is z, as in BeamDyn.
    ValueError unless both are symmetric to ten digits and `order` has each of 0 to 5 once.
    """
    if sorted(order) != list(range(6)):
        raise ValueError(f"order: give each of 0 to 5 once, not {list(order)}")
    sections = []
    for name, given in (("stiffness", stiffness), ("inertia", inertia)):
        values = np.array(given, dtype=float)
        if values.shape != (6, 6):
            raise ValueError(f"{name} has the shape {values.shape}: give a matrix (6, 6)")
        slack = 1e-9 * np.sqrt(np.outer(np.diag(values), np.diag(values)).clip(0.0))
        if not np.all(np.abs(values - values.T) <= slack):
            raise ValueError(f"{name} is not symmetric: give the same value on both sides of the diagonal")
        sections.append(matrix(values[np.ix_(list(order), list(order))]))
    return BeamStation(x_m=x, stiffness=sections[0], inertia=sections[1], reference_point_m=reference_point)
