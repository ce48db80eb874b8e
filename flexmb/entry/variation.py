"""How a free motion changes with the state: what trees and closed chains have in common."""

from __future__ import annotations

from typing import NamedTuple

from flexmb.typing import Real


class StateDerivatives(NamedTuple):
    """Derivatives of m numbers: by [q, u] (m,nq+nu), by time (m,), by generalised forces along all speeds (m,nu)."""

    by_state: Real
    by_time: Real
    by_force: Real


class Variation(NamedTuple):
    """The accelerations (nu,) of a free motion and the loads (G,) of the rows of closures, with their derivatives.

    motion (nq,nu): N = d(qdot)/du, the change of the coordinates by displacements along the speeds. Columns of
    prescribed coordinates and speeds vanish. Trees have no rows. lever (nu,G): P = M^-1 J' Lambda, accelerations that
    give the rows unit accelerations; inertia (G,G): Lambda = (J M^-1 J')^-1, the loads for that; of the independent
    rows, zero for the others.
    """

    accelerations: Real
    of_accelerations: StateDerivatives
    motion: Real
    loads: Real
    of_loads: StateDerivatives
    lever: Real
    inertia: Real
