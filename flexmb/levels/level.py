"""The declaration of a fidelity level, and the tables that it computes for a body."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from flexmb.modal.flexible_model import FlexibleModel
from flexmb.modal.integrals import TurningPoints
from flexmb.scene.bodies import Level
from flexmb.typing import Real, Record

_SIX = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


@dataclass(frozen=True)
class InertiaTables:
    """Tables of one body with m modes for `flexmb.tables.arrays.Constants`.

    `rigid` (10,) holds mass, first moment and inertia about the origin at rest; `summed` are the points to be summed at
    every evaluation. `mff` (m,m), `mfr` (6,m), `gyration` (6,m), `product`, `slope` (SLOPE records) and `mass_slope`
    are rows of the tables of these names.
    """

    rigid: Real
    mff: Real
    mfr: Real
    gyration: Real
    summed: TurningPoints | None = None
    product: Real | None = None
    slope: Record | None = None
    mass_slope: Real | None = None


@dataclass(frozen=True, eq=False)
class FidelityLevel:
    """One fidelity level. `inertia_and_bias(c, w, k)` is its kernel, see `flexmb.levels`; a helper where it is short.

    `tables(model, wheels)` computes the tables of a body, whose last `wheels` points are its despun wheels.
    `without_masses` is the kernel for bodies whose modes are condensed. It omits what is constant at this level and in
    their tables: the modal masses and, if the kinematics are those of the undeformed shape, the coupling. If nothing is
    constant, it is `inertia_and_bias`.
    """

    name: Level
    inertia_and_bias: Callable[..., Any]
    without_masses: Callable[..., Any]
    tables: Callable[[FlexibleModel, int], InertiaTables]
    cost: float  # operations of an evaluation with four modes, relative to level ruthless
    flexible: bool = True  # whether the body keeps its modes
    at_rest: bool = False  # whether inertia and kinematics are those of the undeformed shape
    second_order: bool = False  # whether displacements have a part of second order in the coordinates
    by_strain: bool = False  # whether the coordinates are those of strains, from which sections follow one by one


def six(m: Real) -> list[float]:
    """The elements xx, yy, zz, xy, xz, yz of a symmetric matrix."""
    return [float(m[i, j]) for i, j in _SIX]


def sixes(m: Real) -> Real:
    """The elements xx, yy, zz, xy, xz, yz (...,6) of symmetric matrices (...,3,3)."""
    return np.stack([m[..., i, j] for i, j in _SIX], axis=-1)
