"""Section properties along a beam: piecewise linear between the stations of the scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexmb.scene.bodies import BeamBody
from flexmb.typing import Real

SHEAR = ("GAy_N", "GAz_N")


@dataclass(frozen=True)
class SectionTable:
    """Stations of a beam, sorted along x (m); the section is constant before the first and beyond the last.

    EA N; EIy, EIz, GJ N m^2; GAy, GAz N (None for Euler-Bernoulli); mass kg/m; rotary (rho Iy, rho Iz) kg m.
    Two stations at the same x are a jump.
    """

    x: Real
    EA: Real
    EIy: Real
    EIz: Real
    GJ: Real
    GAy: Real | None
    GAz: Real | None
    mass: Real
    rotary_y: Real
    rotary_z: Real

    def at(self, values: Real, x: Real) -> Real:
        """One property (a field of this table) at the positions x (n,)."""
        return np.interp(x, self.x, values)


def section_table(body: BeamBody) -> SectionTable:
    """The stations of `body` as arrays. Raises ValueError for no station or a missing shear stiffness."""
    stations = sorted(body.stations, key=lambda station: station.x_m)
    if not stations:
        raise ValueError(f"beam '{body.name}': no station; give at least one with the section's stiffness and mass")

    def column(key: str) -> Real:
        return np.array([getattr(station, key) for station in stations], dtype=float)

    shear: list[Real | None] = [None, None]
    if body.level == "exact":  # whose strains may include shear in any theory
        shear = [column(key) if all(getattr(s, key) is not None for s in stations) else None for key in SHEAR]
    elif body.theory == "timoshenko":
        missing = [s.x_m for s in stations if s.GAy_N is None or s.GAz_N is None]
        if missing:
            raise ValueError(
                f"beam '{body.name}': theory 'timoshenko' needs GAy_N and GAz_N at every station (missing at x = "
                f"{missing[0]:g} m)"
            )
        shear = [column(key) for key in SHEAR]
    return SectionTable(
        x=column("x_m"),
        EA=column("EA_N"),
        EIy=column("EIy_Nm2"),
        EIz=column("EIz_Nm2"),
        GJ=column("GJ_Nm2"),
        GAy=shear[0],
        GAz=shear[1],
        mass=column("mass_per_length_kg_m"),
        rotary_y=column("rotary_y_kg_m"),
        rotary_z=column("rotary_z_kg_m"),
    )
