"""Closures and the operators of a tree: the inverse inertia at the closures, Jain & Rodriguez, section VIII; the
Jacobian of their rows, and impulses of rows as wrenches.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

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


@dataclass(frozen=True, eq=False)
class ClosureOperators:
    """Closures at one state, of G rows (the motions that they suppress) on a tree of nu speeds; SI.

        Lambda_inverse f = -opening,    udot = udot_0 + M^-1 J'f,    f = `loads`

    rows (G,)               "<closure>.rotation.x" and so on, axes of frame A turned so that the closure's axis is z;
                            "<coupling>.coordinate", the coordinate that is led less what leads it
    J (G,nu)                rates of the rows are J u, of all speeds
    Lambda_inverse (G,G)    J M^-1 J' of the free speeds, the inverse of the effective inertia of the tree at the
                            closures: row accelerations under unit row loads. Computed as B'B by the recursion
    opening (G,)            J udot_0 + gamma, row accelerations under the accelerations udot_0 of the tree
    loads (G,)              loads along the rows on body_b, N and N m; minimum-norm ones where rows are redundant

    M is the mass matrix and udot_0 the accelerations of the tree: those of `flexmb.System(scene)`.
    """

    rows: tuple[str, ...]
    J: Real
    Lambda_inverse: Real
    opening: Real
    loads: Real


def closure_operators(closures: Closures, t: float, y: Real) -> ClosureOperators:
    """The operators at y = [q, u, work], which must fulfil all closures; DynamicsError where they are singular."""
    closures.motion(t, y)
    loads = closures.row_loads
    opening, B = closures.opening(t, y)
    return ClosureOperators(_names(closures), RowMotion(closures, t, y).jacobian, B @ B.T, opening, loads)


def _names(closures: Closures) -> tuple[str, ...]:
    _, own = closures.constants
    kinds = ["rotation" if kind == ROTATION else "translation" for kind in own.row["type"]]
    owners = [closures.scene[i].name for i in own.row["closure"]]
    axes = ["xyz"[axis] for axis in own.row["axis"]]
    coupled = own.closure["term_stop"][own.row["closure"]] > 0
    return tuple(
        f"{owner}.coordinate" if one else f"{owner}.{kind}.{axis}"
        for owner, kind, axis, one in zip(owners, kinds, axes, coupled, strict=True)
    )
