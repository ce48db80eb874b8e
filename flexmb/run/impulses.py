"""Impulses along speeds: M du = impulses, which give some speeds new values at once and leave positions as they are."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from flexmb.system.tree_system import System
from flexmb.tables.state import State
from flexmb.typing import Real


class Struck(NamedTuple):
    """u (nu,) afterwards; impulses by place in u (N s or N m s), on the outboard side; energy gained (J)."""

    u: Real
    impulses: dict[int, float]
    energy: float


def struck(system: System, state: State, speeds: Mapping[int, float]) -> Struck:
    """The speeds of a tree after impulses that give those at some places in u the values that `speeds` says.

    Prescribed speeds keep theirs, by impulses of their drives. All momentum passes through the hinges: that of the
    whole changes by what the ground hinges take. The energy is the impulses' work, at the mean of the speeds before and
    after. Raises DynamicsError where the mass matrix is not positive definite.
    """
    prescribed = np.flatnonzero(system.constants.speed["prescribed"] >= 0).tolist()
    places = sorted({*prescribed, *speeds})
    change = np.array([speeds.get(j, state.u[j]) - state.u[j] for j in places])
    along = np.zeros((system.nu, len(places)))
    along[places, range(len(places))] = 1.0
    response = system.factorise(state).solve(along)
    impulses = np.linalg.solve(response[places], change)
    u = state.u + response @ impulses
    u[places] = state.u[places] + change
    energy = 0.5 * float(impulses @ (u[places] + state.u[places]))
    return Struck(u, dict(zip(places, impulses.tolist(), strict=True)), energy)
