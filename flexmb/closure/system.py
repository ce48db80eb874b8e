"""The closures of one scene from Python: accelerations and loads of the closed chain."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexmb.arrays import Constants, Real, Workspace
from flexmb.closure import dynamics
from flexmb.closure.tables import ClosureConstants, ClosureWorkspace, workspace
from flexmb.status import OK


class ClosedWorkspace(NamedTuple):
    """What one evaluation of a closed chain writes: of its tree, of its closures."""

    tree: Workspace
    closures: ClosureWorkspace

    @property
    def fault(self) -> Real:
        """(1,) body or closure where an evaluation failed."""
        return self.tree.fault


class ClosedMotion(NamedTuple):
    """Accelerations (nu,), drive loads (nu,), loads (N,6) of hinges and (C,6) of closures, World axes."""

    accelerations: Real
    drives: Real
    hinges: Real
    closures: Real


class Closures:
    """The closures of one scene and the tree under them. It owns one workspace: threads must not share it."""

    def __init__(self, constants: Constants, closures: ClosureConstants, tree: Workspace) -> None:
        self.constants = constants, closures
        self._tree, self._own = self.workspace(tree)
        self.rank = -1  # independent rows of a closed configuration; -1 before the first one is known

    def workspace(self, tree: Workspace) -> ClosedWorkspace:
        """A fresh workspace of the closures beside one of the tree."""
        c, cc = self.constants
        own = workspace(cc, *c.mode.shape, len(c.speed))
        own.rank[0] = getattr(self, "rank", -1)
        return ClosedWorkspace(tree, own)

    @property
    def _arrays(self) -> tuple[Constants, Workspace, ClosureConstants, ClosureWorkspace]:
        c, cc = self.constants
        return c, self._tree, cc, self._own

    @property
    def fault(self) -> int:
        """Body or closure at which the last evaluation failed."""
        return int(self._tree.fault[0])

    def motion(self, t: float, y: Real) -> tuple[int, ClosedMotion]:
        """Status code, and everything about accelerations and loads at y = [q, u, work], which must be closed."""
        c, w, cc, cw = self._arrays
        hinges, closures = np.zeros((len(c.body), 6)), np.zeros((len(cc.closure), 6))
        cw.rank[0] = self.rank
        status = dynamics.accelerations(t, y, c, w, cc, cw)
        if status == OK:
            row_loads = self._least(cw.row["load"].copy())
            status = dynamics.loads(t, y, row_loads, c, w, cc, cw, hinges, closures)
        drives = np.where(c.speed["prescribed"] >= 0, w.speed["drive"], 0.0)
        return status, ClosedMotion(w.speed["acceleration"].copy(), drives, hinges, closures)

    def _least(self, loads: Real) -> Real:
        """Of all loads of the rows that move the mechanism alike, the least in the sum of squares (SI)."""
        null = self.null_loads()
        return loads - null @ (null.T @ loads)

    def null_loads(self) -> Real:
        """Orthonormal loads (G,k) of the rows that move nothing, at the state evaluated last."""
        half = self._own.half
        rows, rank = len(half), int(self._own.rank[0])
        if rank == rows:
            return np.zeros((rows, 0))
        chosen, rest = self._own.chosen[:rank], self._own.chosen[rank:]
        null = np.zeros((rows, rows - rank))
        null[rest] = np.eye(rows - rank)
        null[chosen] = -np.linalg.lstsq(half[chosen].T, half[rest].T, rcond=None)[0]
        return np.linalg.qr(null)[0]
