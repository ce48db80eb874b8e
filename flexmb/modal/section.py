"""Section properties along a beam: matrices about its axis, piecewise linear between the stations of the scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexmb.scene.bodies import BeamBody
from flexmb.scene.sections import (
    SHEAR,
    SHEAR_KEYS,
    WITHOUT_SHEAR,
    has_plain_sections,
    inertia_on_axis,
    stiffness_on_axis,
    without_shear,
)
from flexmb.scene.strains import twist_inertia
from flexmb.typing import Real


@dataclass(frozen=True)
class SectionTable:
    """Stations of a beam, sorted along x (m); the section is constant before the first and beyond the last.

    stiffness (n,6,6): of [extension, shear y, shear z, twist, curvature y, curvature z], with [N, Qy, Qz, Mx, My, Mz]
    in N, N m, N m². Without shear (Euler-Bernoulli) its shear rows and columns are zero but for infinity on the
    diagonal. inertia (n,6,6): of the velocities and angular velocities of the section, kg/m, kg, kg m. Both are about
    the axis of the beam, whatever point the scene states them at. `plain`: nothing couples the strains, nor the
    velocities. twist (n,): kg m, see `flexmb.scene.strains.twist_inertia`. Two stations at the same x are a jump.
    """

    x: Real
    stiffness: Real
    inertia: Real
    plain: bool
    twist: Real

    @property
    def uniform(self) -> bool:
        """Whether all stations are alike."""
        return all(bool(np.all(matrix == matrix[0])) for matrix in (self.stiffness, self.inertia, self.twist))

    @property
    def sheared(self) -> bool:
        """Whether the beam has shear (Timoshenko)."""
        return bool(np.isfinite(self.stiffness[0, 1, 1]))

    @property
    def EA(self) -> Real:
        """(n,) N."""
        return self.stiffness[:, 0, 0]

    @property
    def GAy(self) -> Real:
        """(n,) N, infinite without shear."""
        return self.stiffness[:, 1, 1]

    @property
    def GAz(self) -> Real:
        """(n,) N, infinite without shear."""
        return self.stiffness[:, 2, 2]

    @property
    def GJ(self) -> Real:
        """(n,) N m², about the axis."""
        return self.stiffness[:, 3, 3]

    @property
    def EIy(self) -> Real:
        """(n,) N m², about the axis."""
        return self.stiffness[:, 4, 4]

    @property
    def EIz(self) -> Real:
        """(n,) N m², about the axis."""
        return self.stiffness[:, 5, 5]

    @property
    def mass(self) -> Real:
        """(n,) kg/m."""
        return self.inertia[:, 0, 0]

    def at(self, values: Real, x: Real) -> Real:
        """One property (n,...) at the positions x (X,): (X,...)."""
        found = np.zeros((len(x), *values.shape[1:]))
        for place in np.ndindex(*values.shape[1:]):
            found[(slice(None), *place)] = np.interp(x, self.x, values[(slice(None), *place)])
        return found

    def strain_stiffness(self, x: Real) -> Real:
        """Stiffness (X,6,6) at x (X,), with zeros in place of the infinite ones of shear."""
        return self.at(np.where(np.isfinite(self.stiffness), self.stiffness, 0.0), x)


def section_stiffness(body: BeamBody) -> Real:
    """`SectionTable.stiffness` of a beam: (n,6,6) about its axis at its stations, sorted by x."""
    return section_table(body).stiffness


def section_inertia(body: BeamBody) -> Real:
    """`SectionTable.inertia` of a beam: (n,6,6) per length about its axis at its stations, sorted by x."""
    return section_table(body).inertia


def section_table(body: BeamBody) -> SectionTable:
    """The stations of `body` as arrays. Raises ValueError for no station, or one without stiffness, shear or mass."""
    stations = sorted(body.stations, key=lambda station: station.x_m)
    if not stations:
        raise ValueError(f"beam '{body.name}': no station; give at least one with the section's stiffness and mass")
    sheared = body.theory == "timoshenko"
    missing = [s.x_m for s in stations if s.stiffness is None and None in [getattr(s, key) for key in SHEAR_KEYS]]
    if sheared and missing:
        raise ValueError(
            f"beam '{body.name}': theory 'timoshenko' needs GAy_N and GAz_N at every station (missing at x = "
            f"{missing[0]:g} m)"
        )
    try:
        stiffness = np.array([stiffness_on_axis(station) for station in stations])
        inertia = np.array([inertia_on_axis(station) for station in stations])
        twist = twist_inertia(body, stations)
    except ValueError as error:
        raise ValueError(f"beam '{body.name}': {error}") from None
    if not sheared and body.level != "exact":  # whose strains may include shear in any theory
        stiffness = np.array([_rigid_in_shear(matrix) for matrix in stiffness])
    plain = has_plain_sections(body)
    return SectionTable(np.array([station.x_m for station in stations], dtype=float), stiffness, inertia, plain, twist)


def _rigid_in_shear(K: Real) -> Real:
    """The stiffness (6,6) of a section that cannot be sheared."""
    stiffness = np.zeros((6, 6))
    stiffness[np.ix_(WITHOUT_SHEAR, WITHOUT_SHEAR)] = without_shear(K)
    stiffness[SHEAR, SHEAR] = np.inf
    return stiffness
