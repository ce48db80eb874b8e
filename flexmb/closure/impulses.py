"""Closures for impulse computations: the Jacobian of their rows, and impulses of rows as wrenches."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flexmb.closure import dynamics
from flexmb.closure.closures import Closures
from flexmb.closure.tables import ROTATION
from flexmb.tables.arrays import Constants
from flexmb.tables.workspaces import workspace
from flexmb.typing import Real


class RowMotion:
    """The rows of closures at y = [q, u, work] and time t (s); their rates are J u, prescribed speeds included."""

    def __init__(self, closures: Closures, t: float, y: Real) -> None:
        constants, self._own = closures.constants
        nu = len(constants.speed)
        free, nq = _without_prescribed(constants), len(y) - 1 - nu
        chain = closures.on_tree(free, lambda: workspace(free, nq, nu)).chain("articulated")
        self.jacobian = np.empty((len(self._own.row), nu))
        """J (G,nu)."""
        nothing = np.zeros(nu)
        for j in range(nu):
            moving = np.concatenate([y[:nq], nothing, y[-1:]])
            moving[nq + j] = 1.0
            dynamics.move(t, moving, nothing, dynamics.UNCHANGED, chain)
            self.jacobian[:, j] = chain.cw.row["rate"]
        self._row, self._world = chain.cw.row.copy(), chain.cw.closure["world"].reshape(-1, 3, 3).copy()

    def wrenches(self, impulses: Real) -> Real:
        """(C,6) [N m s; N s] on body_b about frame B, World axes, of the impulses (G,) of the rows."""
        wrenches = np.zeros((len(self._world), 6))
        along = impulses[:, None] * self._row["direction"]
        for i, kind, part in zip(self._own.row["closure"], self._own.row["type"], along, strict=True):
            first = 0 if kind == ROTATION else 3
            wrenches[i, first : first + 3] += self._world[i] @ part
        return wrenches


def _without_prescribed(c: Constants) -> Constants:
    """The same tree with all speeds free."""
    speed = c.speed.copy()
    speed["prescribed"] = -1
    return replace(c, speed=speed)
