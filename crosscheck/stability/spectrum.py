"""Growth rates of motions whose equations do not change with time, from their exact derivatives."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexmb.entry.derivatives import jacobian
from flexmb.system.system import System
from flexmb.tables.state import pack
from flexmb.tables.status import OK, Status
from flexmb.typing import Real


def linearised(system: System, places: Sequence[int]) -> Real:
    """Rows and columns `places` of the derivative of d[q, u]/dt at the initial state of the scene.

    `places` must be closed: states that they do not name (angles about a spin, positions) must not affect them.
    """
    y = pack(system.initial_state)
    J = np.empty((len(y), len(y)))
    status = jacobian(0.0, y, J, system.constants, system.own_derivatives)
    if status != OK:
        raise ArithmeticError(Status(status).advice)
    return J[np.ix_(places, places)]


def growth_rate(system: System, places: Sequence[int]) -> float:
    """Largest real part (1/s) of the eigenvalues of the states at `places`."""
    return float(np.max(np.linalg.eigvals(linearised(system, places)).real))


def states_of(system: System, coordinates: Sequence[str], speeds: Sequence[str]) -> list[int]:
    """Places in [q, u] of named coordinates and speeds, as `System.coordinate` and `System.speed` know them."""
    places = [n for name in coordinates for n in _range(system.coordinate(name))]
    return places + [system.nq + n for name in speeds for n in _range(system.speed(name))]


def _range(places: slice) -> range:
    return range(places.start, places.stop)
