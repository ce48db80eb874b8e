"""Inertia tensors and beam sections from the numbers a user has at hand."""

from __future__ import annotations

from typing import Literal

from flexmb.scene.bodies import BeamStation, Matrix3


def inertia_moments(
    xx: float, yy: float, zz: float, xy: float = 0.0, xz: float = 0.0, yz: float = 0.0
) -> Matrix3:
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
    *,
    E: float,
    G: float,
    A: float,
    Iy: float,
    Iz: float,
    rho: float,
    J: float | None = None,
    shear_factor: float = 5.0 / 6.0,
    x: float = 0.0,
) -> BeamStation:
    """Section of a homogeneous beam at station `x` (m).

    E, G: elastic moduli (Pa); A: area (m²); Iy, Iz: second moments of area about the section's y and z (m⁴), so that
    `Iz` resists bending in the x-y plane; rho: density (kg/m³). J: torsion constant (m⁴), Iy + Iz (exact for a circle
    only) if not given. `shear_factor` k gives the Timoshenko stiffness k G A; 5/6 is that of a rectangle.
    """
    return BeamStation(
        x_m=x,
        EA_N=E * A,
        EIy_Nm2=E * Iy,
        EIz_Nm2=E * Iz,
        GJ_Nm2=G * (Iy + Iz if J is None else J),
        mass_per_length_kg_m=rho * A,
        rotary_y_kg_m=rho * Iy,
        rotary_z_kg_m=rho * Iz,
        GAy_N=shear_factor * G * A,
        GAz_N=shear_factor * G * A,
    )
